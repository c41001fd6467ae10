//! Removes overlaps by minimising the energy of harmonic overlaps. Serial, and deterministic.

use super::grid::{Ball, Cell, Grid, Image};
use super::overlap::Worst;
use super::rcp::wrap;

/// Reach of the list of pairs over the sum of radii.
const REACH: f64 = 1.15;

// FIRE with the constants of the source; time in units of √(mass/stiffness) of one contact.
const FIRST_STEP: f64 = 0.1;
const LARGEST_STEP: f64 = 0.4;
const LONGER: f64 = 1.1;
const SHORTER: f64 = 0.5;
const STEPS_DOWNHILL: usize = 5;
const FIRST_MIXING: f64 = 0.1;
const LESS_MIXING: f64 = 0.99;

/// What the relaxation attained.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relaxed {
    /// The largest overlap left, if any.
    pub worst: Option<Worst>,
    /// Steps taken.
    pub steps: usize,
}

/// Move balls (index = id) until none overlaps another, or an image, by more than `tolerance` times the
/// smaller radius, or until so many steps are taken. Balls that nothing overlaps stay where they are.
///
/// Minimises `E = ½ Σ (R_i + R_j − |d|)²` over the overlapping pairs by FIRE. Positions are wrapped into
/// the cell, whose sides are at least a diameter.
///
/// # Source
/// Bitzek et al. 2006, doi:10.1103/PhysRevLett.97.170201.
pub fn relax(cell: &Cell, balls: &mut [Ball], tolerance: f64, max_steps: usize) -> Relaxed {
    let mut pairs = Pairs::new(cell, balls);
    let mut velocity = vec![[0.0; 3]; balls.len()];
    let mut force = vec![[0.0; 3]; balls.len()];
    let (mut step, mut mixing, mut downhill) = (FIRST_STEP, FIRST_MIXING, 0);
    for steps in 0.. {
        let worst = pairs.forces(balls, &mut force);
        if steps == max_steps || worst.is_none_or(|worst| worst.fraction <= tolerance) {
            balls.iter_mut().for_each(|ball| ball.position = wrapped(cell, ball.position));
            return Relaxed { worst, steps };
        }
        let [power, speed, push] = products(&velocity, &force);
        if power > 0.0 {
            let towards = mixing * (speed / push).sqrt();
            for (v, f) in velocity.iter_mut().zip(&force) {
                *v = [0, 1, 2].map(|k| (1.0 - mixing) * v[k] + towards * f[k]);
            }
            downhill += 1;
            if downhill > STEPS_DOWNHILL {
                step = (step * LONGER).min(LARGEST_STEP);
                mixing *= LESS_MIXING;
            }
        } else {
            velocity.fill([0.0; 3]);
            (step, mixing, downhill) = (step * SHORTER, FIRST_MIXING, 0);
            step = step.max(0.1 * FIRST_STEP);
        }
        for ((ball, v), f) in balls.iter_mut().zip(&mut velocity).zip(&force) {
            // A ball that is free stops: what is far from the overlaps then moves less.
            *v = if *f == [0.0; 3] { *f } else { [0, 1, 2].map(|k| v[k] + step * f[k]) };
            ball.position = [0, 1, 2].map(|k| ball.position[k] + step * v[k]);
        }
        if pairs.outdated(balls) {
            balls.iter_mut().for_each(|ball| ball.position = wrapped(cell, ball.position));
            pairs = Pairs::new(cell, balls);
        }
    }
    unreachable!("the loop has no other end")
}

fn wrapped(cell: &Cell, position: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| if cell.periodic[k] { wrap(position[k], cell.sides[k]) } else { position[k] })
}

/// v·f, v·v and f·f.
fn products(velocity: &[[f64; 3]], force: &[[f64; 3]]) -> [f64; 3] {
    let mut sums = [0.0; 3];
    for (v, f) in velocity.iter().zip(force) {
        for k in 0..3 {
            sums[0] += v[k] * f[k];
            sums[1] += v[k] * v[k];
            sums[2] += f[k] * f[k];
        }
    }
    sums
}

/// Pairs that may overlap before one of their balls has gone half of the skin.
struct Pairs {
    list: Vec<(u32, u32, Image)>,
    /// Positions when the list was made.
    origin: Vec<[f64; 3]>,
}

impl Pairs {
    fn new(cell: &Cell, balls: &[Ball]) -> Self {
        let grid = Grid::new(*cell, balls, REACH);
        let mut list = Vec::new();
        for (index, ball) in balls.iter().enumerate() {
            // Each pair once, from its smaller ball; of one class from the later one.
            grid.visit_near(index, ball, REACH, true, |other, image| {
                let partner = &balls[other];
                let first = (ball.radius, index) < (partner.radius, other);
                let d = image.separation(ball, partner);
                let reach = REACH * (ball.radius + partner.radius);
                if first && d[0] * d[0] + d[1] * d[1] + d[2] * d[2] < reach * reach {
                    list.push((index as u32, other as u32, image));
                }
            });
        }
        Self { list, origin: balls.iter().map(|ball| ball.position).collect() }
    }

    /// Whether a ball has moved so far that a pair may be missing.
    fn outdated(&self, balls: &[Ball]) -> bool {
        balls.iter().zip(&self.origin).any(|(ball, origin)| {
            let d = [0, 1, 2].map(|k| ball.position[k] - origin[k]);
            let allowed = 0.5 * (REACH - 1.0) * 2.0 * ball.radius;
            d[0] * d[0] + d[1] * d[1] + d[2] * d[2] > allowed * allowed
        })
    }

    /// Forces on all balls, and the pair that overlaps most.
    fn forces(&self, balls: &[Ball], force: &mut [[f64; 3]]) -> Option<Worst> {
        force.fill([0.0; 3]);
        let mut worst: Option<Worst> = None;
        for (i, j, image) in &self.list {
            let (a, b) = (*i as usize, *j as usize);
            let (ball, partner) = (&balls[a], &balls[b]);
            let d = image.separation(ball, partner);
            let square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
            let sum = ball.radius + partner.radius;
            if square >= sum * sum {
                continue;
            }
            let distance = square.sqrt();
            let overlap = sum - distance;
            let direction = if distance > 0.0 { d.map(|x| x / distance) } else { [1.0, 0.0, 0.0] };
            for k in 0..3 {
                force[a][k] -= overlap * direction[k];
                force[b][k] += overlap * direction[k];
            }
            let fraction = overlap / ball.radius.min(partner.radius);
            if worst.is_none_or(|worst| fraction > worst.fraction) {
                worst = Some(Worst { ids: [(*i).min(*j), (*i).max(*j)], fraction });
            }
        }
        worst
    }
}

#[cfg(test)]
mod tests {
    use super::super::random::{Draws, Purpose};
    use super::super::test_input::smallest_relative_distance;
    use super::*;

    fn cube(side: f64) -> Cell {
        Cell { sides: [side; 3], periodic: [true; 3] }
    }

    #[test]
    fn two_balls_part_symmetrically_and_a_third_stays() {
        let ball = |x: f64, radius: f64| Ball { position: [x, 5.0, 5.0], radius };
        let mut balls = [ball(0.5, 1.0), ball(9.3, 0.5), ball(5.0, 1.0)];
        let relaxed = relax(&cube(10.0), &mut balls, 1e-8, 1000);
        assert!(relaxed.worst.is_none_or(|worst| worst.fraction <= 1e-8), "{relaxed:?}");
        // They overlapped by 0.3 across the face; half the way for each, and not much further.
        let [first, second] = [balls[0].position[0], balls[1].position[0]];
        assert!((first + second - 9.8).abs() < 1e-12 && (0.65 - 1e-8..0.7).contains(&first), "{balls:?}");
        assert_eq!(balls[2], ball(5.0, 1.0));
    }

    /// Random balls of radii 0.5 to 1.
    fn scattered(count: u64, side: f64) -> Vec<Ball> {
        let ball = |id| {
            let mut draws = Draws::new(4, Purpose::Position, id);
            Ball { position: [0; 3].map(|_| side * draws.uniform()), radius: 0.5 + 0.5 * draws.uniform() }
        };
        (0..count).map(ball).collect()
    }

    #[test]
    fn random_balls_below_jamming_come_apart() {
        let mut balls = scattered(200, 9.5);
        let cell = cube(9.5);
        let relaxed = relax(&cell, &mut balls, 1e-7, 5000);
        assert!(relaxed.worst.is_none_or(|worst| worst.fraction <= 1e-7), "{relaxed:?}");
        let positions: Vec<_> = balls.iter().map(|ball| ball.position).collect();
        let radii: Vec<_> = balls.iter().map(|ball| ball.radius).collect();
        assert!(smallest_relative_distance(&positions, &radii, &cell) > 1.0 - 1e-7);
    }

    #[test]
    fn balls_without_room_keep_the_overlap_that_is_reported() {
        let mut balls = scattered(200, 7.0);
        let relaxed = relax(&cube(7.0), &mut balls, 1e-7, 500);
        assert_eq!(relaxed.steps, 500);
        assert!(relaxed.worst.unwrap().fraction > 0.01, "{relaxed:?}");
    }
}
