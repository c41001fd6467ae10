//! Time per contact of the ellipsoid geometry and how often the overlap is evaluated in it, from a cold start and
//! from the normal of the last step: `cargo bench --bench ellipsoid_contact`.

use bytemuck::Zeroable;
use dem_mpi::contact::section::{BLOCK, Partners, Section};
use dem_mpi::contact::shift::{ShiftTable, encode};
use dem_mpi::force::ellipsoid::normal::Ellipsoids;
use dem_mpi::force::ellipsoid::shape_tensor;
use dem_mpi::force::ellipsoid::touch::{BlockSource, Surroundings};
use dem_mpi::force::geometry::CellMotion;
use dem_mpi::force::simd::Simd;
use dem_mpi::force::touches::BlockTouches;
use dem_mpi::state::particles::Record;
use dem_mpi::state::shape::Shape;
use rand_chacha::ChaCha8Rng;
use rand_core::{RngCore, SeedableRng};
use std::hint::black_box;
use std::time::Instant;

const PAIRS: usize = 8192;
const REPEATS: usize = 20;

struct Random(ChaCha8Rng);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn unit<const N: usize>(&mut self) -> [f64; N] {
        loop {
            let v = [0.0; N].map(|_| self.between(-1.0, 1.0));
            let square: f64 = v.iter().map(|c| c * c).sum();
            if square > 0.01 && square < 1.0 {
                return v.map(|c| c / square.sqrt());
            }
        }
    }
}

struct Scene {
    records: Vec<Record>,
    shapes: Vec<Shape>,
    section: Section,
}

/// Pairs with aspect ratios up to `aspect` that overlap by 1 % of the size.
fn scene(aspect: f64) -> Scene {
    let mut random = Random(ChaCha8Rng::seed_from_u64(7));
    let (mut records, mut shapes) = (Vec::new(), Vec::new());
    let mut section = Section::new(0, Partners::Near, 3, 0);
    section.resize(PAIRS);
    for pair in 0..PAIRS {
        let mut half = || Shape::new([0.0; 3].map(|_| random.between(1.0 / aspect, 1.0)), random.unit());
        let two = [half(), half()];
        let normal: [f64; 3] = random.unit();
        let points = two.map(|shape| {
            let tensor = shape_tensor(shape.semi_axes, shape.orientation);
            dem_mpi::force::ellipsoid::support(&tensor, normal).1
        });
        let place = [0, 1, 2].map(|k| points[0][k] + points[1][k] - 0.01 * normal[k]);
        let record = |position| Record { position, radius: 1.0, inverse_mass: 1.0, ..Record::zeroed() };
        records.extend([record([0.0; 3]), record(place)]);
        shapes.extend(two);
        section.set(pair, 2 * pair as u32, 2 * pair as u32 + 1, encode([0; 3]));
    }
    Scene { records, shapes, section }
}

impl Scene {
    fn touches(&self, simd: Simd, motion: &CellMotion, block: usize) -> BlockTouches {
        let surroundings = Surroundings { motion, range: 0.0, simd };
        let mut touches = BlockTouches::zeroed();
        let Self { records, shapes, section, .. } = self;
        let pairs = section.pairs(records);
        BlockSource { surroundings: &surroundings, pairs: &pairs, shapes, section, block, normals: 0 }
            .fill(&mut touches);
        touches
    }

    /// Nanoseconds per contact, the best of some rounds.
    fn time(&self, simd: Simd, motion: &CellMotion) -> f64 {
        let round = || {
            let started = Instant::now();
            for block in 0..PAIRS / BLOCK {
                black_box(self.touches(simd, motion, block));
            }
            started.elapsed().as_secs_f64() * 1e9 / PAIRS as f64
        };
        (0..REPEATS).map(|_| round()).fold(f64::INFINITY, |best, time| if time < best { time } else { best })
    }

    /// Mean and largest number of evaluations.
    fn evaluations(&self) -> (f64, usize) {
        let counts = (0..PAIRS).map(|pair| {
            let tensors = [0, 1].map(|k| {
                let shape = &self.shapes[2 * pair + k];
                shape_tensor(shape.semi_axes, shape.orientation)
            });
            let branch = self.records[2 * pair + 1].position;
            let mut stored = [0.0; 3];
            self.section.read_memory(pair, &mut stored);
            Ellipsoids { tensors, branch }.common_normal(stored, [0.0; 3], 0.0).evaluations
        });
        let counts: Vec<usize> = counts.collect();
        (counts.iter().sum::<usize>() as f64 / PAIRS as f64, counts.into_iter().max().unwrap_or(0))
    }

    /// Keep the normals, then move by about 10⁻⁴ of the size, as a step does.
    fn move_on(&mut self, motion: &CellMotion) {
        let mut random = Random(ChaCha8Rng::seed_from_u64(8));
        for block in 0..PAIRS / BLOCK {
            let touches = self.touches(Simd::Scalar, motion, block);
            for lane in 0..BLOCK {
                let normal = touches.normals().map(|column| column.0[lane]);
                self.section.write_memory(block * BLOCK + lane, &normal);
            }
        }
        for record in &mut self.records {
            record.position = record.position.map(|x| x + random.between(-1e-4, 1e-4));
        }
    }
}

fn main() {
    let motion = CellMotion {
        sides: [10.0; 3],
        shift: ShiftTable::new([10.0; 3]),
        shift_velocity: ShiftTable::new([0.0; 3]),
        gradient: [0.0; 3],
        wall_velocity: [0.0; 3],
        faces_move: false,
    };
    println!("aspect  start  evaluations mean  most   ns per contact");
    for aspect in [1.5, 2.0, 5.0] {
        let mut scene = scene(aspect);
        for start in ["cold", "warm"] {
            if start == "warm" {
                scene.move_on(&motion);
            }
            let (mean, most) = scene.evaluations();
            let mut line = format!("{aspect:>6}  {start:>5}  {mean:>16.2}  {most:>4}  ");
            for simd in [Simd::Scalar, Simd::Avx2, Simd::Avx512].into_iter().filter(|simd| simd.is_available()) {
                line += &format!(" {simd:?} {:.0}", scene.time(simd, &motion));
            }
            println!("{line}");
        }
    }
}
