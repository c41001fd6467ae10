//! The common normal against an independent slow minimiser, spheres against the sphere code, curvatures
//! against closed forms.

use super::curvature::Ellipse;
use super::normal::{Ellipsoids, MAX_ITERATIONS};
use super::touch::{self, Shapes};
use super::*;
use crate::contact::section::{Partners, Section};
use crate::contact::shift::{ShiftTable, encode};
use crate::force::geometry::{self, CellMotion};
use crate::force::lane::portable::Portable;
use crate::force::lane::{add, cross, scale, sub};
use crate::state::particles::Record;
use bytemuck::Zeroable;
use rand_chacha::ChaCha8Rng;
use rand_core::{RngCore, SeedableRng};

const PAIRS: usize = 10_000;

struct Random(ChaCha8Rng);

impl Random {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }
    /// Uniform in [low, high).
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }
    fn direction(&mut self) -> [f64; 3] {
        loop {
            let v = [0; 3].map(|_| self.between(-1.0, 1.0));
            let square = dot(v, v);
            if square > 0.01 && square < 1.0 {
                return scale(v, 1.0 / square.sqrt());
            }
        }
    }
    fn orientation(&mut self) -> [f64; 4] {
        loop {
            let q = [0; 4].map(|_| self.between(-1.0, 1.0));
            let square: f64 = q.iter().map(|c| c * c).sum();
            if square > 0.01 && square < 1.0 {
                return q.map(|c| c / square.sqrt());
            }
        }
    }
    /// Semi-axes with aspect ratios up to 5 and sizes up to a factor of 2 around 1 µm.
    fn semi_axes(&mut self) -> [f64; 3] {
        let size = 1e-6 * self.between(0.7, 1.4);
        [0; 3].map(|_| size * self.between(0.2, 1.0))
    }
}

fn smallest(axes: [f64; 3]) -> f64 {
    axes.into_iter().fold(f64::INFINITY, f64::min)
}

/// o(n) without any tensor: support functions in body axes.
struct Slow {
    axes: [[f64; 3]; 2],
    turns: [[f64; 4]; 2],
    /// Rows are body axes in space.
    frames: [[[f64; 3]; 3]; 2],
    branch: [f64; 3],
}

impl Slow {
    fn overlap(&self, n: [f64; 3]) -> f64 {
        let support = |k: usize| {
            let square: f64 = (0..3).map(|i| (self.axes[k][i] * dot(self.frames[k][i], n)).powi_two()).sum();
            square.sqrt()
        };
        support(0) + support(1) - dot(n, self.branch)
    }

    /// Global minimum: a fine grid, then compass search from its best points.
    fn minimum(&self, grid: &[[f64; 3]]) -> f64 {
        let mut values: Vec<(f64, [f64; 3])> = grid.iter().map(|n| (self.overlap(*n), *n)).collect();
        values.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut starts: Vec<(f64, [f64; 3])> = Vec::new();
        for candidate in values {
            if starts.iter().all(|start| dot(start.1, candidate.1) < 0.95) {
                starts.push(candidate);
            }
            if starts.len() == 4 {
                break;
            }
        }
        starts.into_iter().map(|(value, n)| self.descend(value, n)).fold(f64::INFINITY, f64::min)
    }

    fn descend(&self, mut value: f64, mut n: [f64; 3]) -> f64 {
        let mut step = 0.1;
        while step > 1e-9 {
            let side = if n[0].abs() < 0.6 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
            let u = unit(cross(n, side));
            let w = cross(n, u);
            let mut best = (value, n);
            for k in 0..8 {
                let angle = std::f64::consts::FRAC_PI_4 * f64::from(k);
                let (sine, cosine) = libm::sincos(angle);
                let trial = unit(add(n, scale(add(scale(u, cosine), scale(w, sine)), step)));
                let overlap = self.overlap(trial);
                if overlap < best.0 {
                    best = (overlap, trial);
                }
            }
            if best.0 < value {
                (value, n) = best;
            } else {
                step *= 0.5;
            }
        }
        value
    }
}

trait PowiTwo {
    fn powi_two(self) -> f64;
}

impl PowiTwo for f64 {
    fn powi_two(self) -> f64 {
        self * self
    }
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    scale(v, 1.0 / dot(v, v).sqrt())
}

/// Points spread evenly over the sphere (golden spiral).
fn grid(count: usize) -> Vec<[f64; 3]> {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    (0..count)
        .map(|k| {
            let z = 1.0 - (2.0 * k as f64 + 1.0) / count as f64;
            let (sine, cosine) = libm::sincos(golden * k as f64);
            let r = (1.0 - z * z).sqrt();
            [r * cosine, r * sine, z]
        })
        .collect()
}

fn turn(q: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let u = [q[1], q[2], q[3]];
    let t = scale(cross(u, v), 2.0);
    add(add(v, scale(t, q[0])), cross(u, t))
}

/// A random pair that overlaps by a known amount along a random normal, from grazing (10⁻⁶ of the smallest semi-axis)
/// to deep (half of it).
fn random_pair(random: &mut Random) -> (Ellipsoids<f64>, Slow) {
    let axes = [random.semi_axes(), random.semi_axes()];
    let turns = [random.orientation(), random.orientation()];
    let tensors = [0, 1].map(|k| shape_tensor(axes[k], turns[k]));
    let normal = random.direction();
    let points = [0, 1].map(|k| support(&tensors[k], normal).1);
    let share = libm::pow(10.0, random.between(-6.0, -0.3));
    let overlap = share * smallest(axes[0]).min(smallest(axes[1]));
    let branch = sub(add(points[0], points[1]), scale(normal, overlap));
    let frames = turns.map(|q| [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|e| turn(q, e)));
    (Ellipsoids { tensors, branch }, Slow { axes, turns, frames, branch })
}

#[test]
fn ten_thousand_random_pairs_find_the_minimum_that_a_slow_optimiser_finds() {
    let mut random = Random::new(1);
    let grid = grid(2500);
    let (mut evaluations, mut missed) = (Vec::new(), 0);
    for number in 0..PAIRS {
        let (pair, slow) = random_pair(&mut random);
        let search = pair.common_normal([0.0; 3], [0.0; 3], 0.0);
        assert!(!search.failed, "pair {number} does not converge in {MAX_ITERATIONS}");
        evaluations.push(search.evaluations);
        let expected = slow.minimum(&grid);
        let error = search.found.overlap - expected;
        let size = dot(pair.branch, pair.branch).sqrt();
        if error > 1e-8 * expected + 1e-15 * size {
            missed += 1;
            println!("pair {number}: {:e}, slow {expected:e}", search.found.overlap);
        }
        // The slow one stops at a step of 1e-9, and can itself be no lower.
        assert!(
            error > -1e-8 * expected - 1e-15 * size,
            "pair {number}: {:e}, slow {expected:e}",
            search.found.overlap
        );
    }
    evaluations.sort_unstable();
    println!(
        "evaluations: median {}, 99 % {}, most {}",
        evaluations[PAIRS / 2],
        evaluations[PAIRS * 99 / 100],
        evaluations[PAIRS - 1]
    );
    assert_eq!(missed, 0, "pairs whose global minimum was missed");
}

#[test]
fn the_points_lie_on_the_surfaces_and_the_gradient_vanishes() {
    let mut random = Random::new(2);
    for _ in 0..2000 {
        let (pair, _) = random_pair(&mut random);
        let found = pair.common_normal([0.0; 3], [0.0; 3], 0.0).found;
        let size = dot(pair.branch, pair.branch).sqrt();
        let between = sub(sub(found.first_point, found.second_point), pair.branch);
        // Surface points are apart by δ n.
        for k in 0..3 {
            assert!((between[k] - found.overlap * found.normal[k]).abs() < 1e-12 * size, "{between:?} {found:?}");
        }
        assert!((dot(found.normal, found.normal) - 1.0).abs() < 1e-14);
    }
}

#[test]
fn a_stored_normal_finds_the_same_place_in_a_few_evaluations() {
    let mut random = Random::new(3);
    let mut most = 0;
    for _ in 0..2000 {
        let (mut pair, _) = random_pair(&mut random);
        let before = pair.common_normal([0.0; 3], [0.0; 3], 0.0).found;
        let size = dot(pair.branch, pair.branch).sqrt();
        pair.branch = add(pair.branch, scale(random.direction(), 1e-5 * size));
        let warm = pair.common_normal(before.normal, [0.0; 3], 0.0);
        let cold = pair.common_normal([0.0; 3], [0.0; 3], 0.0);
        if warm.found.overlap > 0.0 {
            assert!((warm.found.overlap - cold.found.overlap).abs() < 1e-14 * size);
            let between = sub(sub(warm.found.first_point, warm.found.second_point), pair.branch);
            for k in 0..3 {
                assert!((between[k] - warm.found.overlap * warm.found.normal[k]).abs() < 1e-12 * size, "{between:?}");
                assert!((warm.found.normal[k] - cold.found.normal[k]).abs() < 1e-10);
            }
            most = most.max(warm.evaluations);
        }
    }
    assert!(most <= 5, "{most} evaluations");
}

#[test]
fn separated_pairs_show_no_overlap_and_stop_early() {
    let mut random = Random::new(4);
    for _ in 0..2000 {
        let (mut pair, _) = random_pair(&mut random);
        pair.branch = scale(pair.branch, 1.6);
        let search = pair.common_normal([0.0; 3], [0.0; 3], 0.0);
        assert!(search.found.overlap <= 0.0 && !search.failed);
    }
}

#[test]
fn a_hint_changes_no_touch_and_no_gap() {
    let mut random = Random::new(9);
    let none = [0.0; 3];
    for number in 0..10_000 {
        let (mut pair, _) = random_pair(&mut random);
        let found = pair.common_normal(none, none, 0.0).found;
        let hinted = pair.common_normal(none, found.normal, 0.0).found;
        assert_eq!((hinted.overlap, hinted.normal), (found.overlap, found.normal));
        // Apart along the normal by little or much: without the hint the search must see it too.
        let gap = libm::pow(10.0, random.between(-9.0, -0.5)) * dot(pair.branch, pair.branch).sqrt();
        pair.branch = add(pair.branch, scale(found.normal, found.overlap + gap));
        assert!(pair.common_normal(none, found.normal, 0.0).found.overlap <= 0.0);
        let cold = pair.common_normal(none, none, 0.0).found.overlap;
        assert!(cold <= 0.0, "pair {number}, gap {gap:e}: {cold:e}");
        // A law that reaches over a gap: near enough with the hint or not at all.
        let bound = -gap * random.between(0.5, 2.0);
        let [with, without] = [found.normal, none].map(|hint| pair.common_normal(none, hint, bound).found);
        assert_eq!(with.overlap > bound, without.overlap > bound, "pair {number}");
        if with.overlap > bound {
            assert_eq!((with.overlap, with.normal), (without.overlap, without.normal));
        }
    }
}

#[test]
fn eight_lanes_give_the_scalar_bits() {
    let mut random = Random::new(5);
    for _ in 0..200 {
        let pairs: Vec<Ellipsoids<f64>> = (0..8).map(|_| random_pair(&mut random).0).collect();
        let stored: Vec<[f64; 3]> =
            pairs.iter().map(|p| if random.between(0.0, 1.0) < 0.5 { [0.0; 3] } else { unit(p.branch) }).collect();
        let lanes = |f: &dyn Fn(usize) -> f64| Portable::<8>(std::array::from_fn(f));
        let together = Ellipsoids {
            tensors: [0, 1].map(|side| std::array::from_fn(|c| lanes(&|k| pairs[k].tensors[side][c]))),
            branch: std::array::from_fn(|c| lanes(&|k| pairs[k].branch[c])),
        };
        let start = std::array::from_fn(|c| lanes(&|k| stored[k][c]));
        let wide = together.common_normal(start, [Portable::splat(0.0); 3], Portable::splat(0.0)).found;
        let shape = Ellipse::new(&wide.radii);
        for k in 0..8 {
            let alone = pairs[k].common_normal(stored[k], [0.0; 3], 0.0).found;
            let ellipse = Ellipse::new(&alone.radii);
            assert_eq!(wide.overlap.0[k].to_bits(), alone.overlap.to_bits());
            assert_eq!(wide.normal.map(|c| c.0[k].to_bits()), alone.normal.map(f64::to_bits));
            assert_eq!(shape.radius_factor.0[k].to_bits(), ellipse.radius_factor.to_bits());
            assert_eq!(shape.effective_radius.0[k].to_bits(), ellipse.effective_radius.to_bits());
        }
    }
}

/// A cell at rest.
fn still() -> CellMotion {
    CellMotion {
        sides: [1.0; 3],
        shift: ShiftTable::new([1.0; 3]),
        faces_move: true,
        shift_velocity: ShiftTable::new([0.0; 3]),
        gradient: [0.0; 3],
        wall_velocity: [0.0; 3],
    }
}

/// A contact of the first and the second of two records.
fn contact() -> Section {
    let mut section = Section::new(0, Partners::Near, 0, 0);
    section.resize(1);
    section.set(0, 0, 1, encode([0; 3]));
    section
}

#[test]
fn spheres_as_ellipsoids_give_what_the_sphere_code_gives() {
    let mut random = Random::new(6);
    let (motion, section) = (still(), contact());
    for _ in 0..2000 {
        let radii = [random.between(0.5e-6, 1e-6), random.between(0.5e-6, 1e-6)];
        let overlap = libm::pow(10.0, random.between(-4.0, -0.7)) * radii[0].min(radii[1]);
        let branch = scale(random.direction(), radii[0] + radii[1] - overlap);
        let body =
            |position, radius| Record { position, radius, radius_again: radius, inverse_mass: 1.0, ..Record::zeroed() };
        let records = [body([0.0; 3], radii[0]), body(branch, radii[1])];
        let sphere = geometry::spheres::<f64>(&section.pairs(&records).block(0), 0, &motion);
        let pair = Ellipsoids { tensors: radii.map(sphere_tensor), branch };
        let found = pair.common_normal([0.0; 3], [0.0; 3], 0.0).found;
        let ellipse = Ellipse::new(&found.radii);
        assert!((found.overlap / sphere.touch.overlap - 1.0).abs() < 1e-10);
        assert!((ellipse.effective_radius / sphere.touch.effective_radius - 1.0).abs() < 1e-10);
        assert!((ellipse.radius_factor - 1.0).abs() < 1e-10 && (ellipse.overlap_factor - 1.0).abs() < 1e-10);
        for k in 0..3 {
            assert!((found.normal[k] - sphere.touch.normal[k]).abs() < 1e-10);
        }
    }
}

#[test]
fn curvatures_at_the_vertices_are_those_of_becker_table_3() {
    let reference =
        &crate::force::testing::table(include_str!("../../../tests/data/becker_kamlah_case1_geometry.csv"))[0];
    let size = 4.675e-6;
    let axes = |ratio: [f64; 3]| {
        let mean = libm::cbrt(ratio[0] * ratio[1] * ratio[2]);
        ratio.map(|r| r * size / mean)
    };
    let (first, second) = (axes([1.0, 1.25, 1.5]), axes([1.0, 0.5, 0.8]));
    // Vertex to vertex along x, both turned together by some angle.
    let q = [0.8, 0.36, -0.48, 0.0];
    let tensors = [shape_tensor(first, q), shape_tensor(second, q)];
    let branch = turn(q, [first[0] + second[0] - 1e-8, 0.0, 0.0]);
    let found = Ellipsoids { tensors, branch }.common_normal([0.0; 3], [0.0; 3], 0.0).found;
    let ellipse = Ellipse::new(&found.radii);
    assert!((found.overlap / 1e-8 - 1.0).abs() < 1e-6);
    assert!((ellipse.effective_radius / reference[0] - 1.0).abs() < 1e-12);
    assert!((1.0 - libm::pow(ellipse.ratio, -4.0 / 3.0) - 0.650).abs() < 5e-4);
    assert!((1.0 - libm::pow(ellipse.ratio, -4.0 / 3.0) - reference[1]).abs() < 1e-12);
    assert!((ellipse.radius_factor - reference[2]).abs() < 1e-12);
    assert!((ellipse.overlap_factor - reference[3]).abs() < 1e-12);
}

/// A body that moves on with its velocity and spin.
struct Moving {
    semi_axes: [f64; 3],
    orientation: [f64; 4],
    position: [f64; 3],
    velocity: [f64; 3],
    spin: [f64; 3],
}

impl Moving {
    fn at(&self, time: f64) -> (Record, Shapes<f64>) {
        // A turn about the spin by |ω| t.
        let rate = dot(self.spin, self.spin).sqrt();
        let (sine, cosine) = libm::sincos(0.5 * rate * time);
        let axis = scale(self.spin, sine / rate);
        let turned = crate::state::shape::product([cosine, axis[0], axis[1], axis[2]], self.orientation);
        let record = Record {
            position: add(self.position, scale(self.velocity, time)),
            radius: 1.4e-6,
            velocity: self.velocity,
            inverse_mass: 1.0,
            spin: self.spin,
            radius_again: 1.4e-6,
        };
        (record, Shapes { semi_axes: self.semi_axes, mean_radius: 1e-6, orientation: turned })
    }
}

#[test]
fn the_overlap_rate_is_the_derivative_of_the_overlap_of_moving_and_turning_bodies() {
    let mut random = Random::new(8);
    let (motion, section) = (still(), contact());
    for _ in 0..500 {
        let (pair, slow) = random_pair(&mut random);
        let mut body = |position, semi_axes, orientation| Moving {
            semi_axes,
            orientation,
            position,
            velocity: random.direction(),
            spin: scale(random.direction(), 1e6),
        };
        let bodies = [body([0.0; 3], slow.axes[0], slow.turns[0]), body(pair.branch, slow.axes[1], slow.turns[1])];
        let at = |time: f64| {
            let [(a, s), (b, t)] = [bodies[0].at(time), bodies[1].at(time)];
            let records = [a, b];
            let bodies = geometry::relative(&section.pairs(&records).block(0), 0, &motion);
            let normal = pair.common_normal([0.0; 3], [0.0; 3], 0.0).found.normal;
            touch::ellipsoids(&bodies, &[s, t], [normal, [0.0; 3]], 0.0)
        };
        let (now, h) = (at(0.0).pair, 1e-12);
        let slope = (at(h).pair.touch.overlap - at(-h).pair.touch.overlap) / (2.0 * h);
        // Where the motion pulls the bodies apart the search stops at no overlap.
        if now.touch.overlap > 1e-11 {
            assert!((now.touch.overlap_rate - slope).abs() < 1e-4, "{} {slope}", now.touch.overlap_rate);
        }
        let arms = at(0.0).arms;
        for k in 0..3 {
            assert!((arms[0][k] - arms[1][k] - pair.branch[k]).abs() < 1e-20);
        }
    }
}
