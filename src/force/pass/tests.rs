use super::*;
use crate::contact::shift::{self, ShiftTable};
use crate::force::observe::{Observation, Wanted};
use crate::force::registry::Role;
use crate::force::testing::{choice, nmc, pair, properties, pvdf};

const RADIUS: f64 = 1e-3;
const PAIRS: usize = 45;
const STEPS: usize = 4;

/// A crooked chain: some particles overlap the next one a little, others do not reach it; all move and turn.
fn records() -> Vec<Record> {
    let number = |n: usize, k: usize| ((n * 37 + k * 101) % 89) as f64 / 89.0 - 0.5;
    (0..=PAIRS)
        .map(|n| Record {
            position: [n as f64 * 1.97 * RADIUS, number(n, 1) * 5.5e-4, number(n, 2) * 5.5e-4],
            radius: RADIUS,
            velocity: [0, 1, 2].map(|k| 0.1 * number(n, 3 + k)),
            radius_again: RADIUS,
            spin: [0, 1, 2].map(|k| 50.0 * number(n, 6 + k)),
            inverse_mass: 1e5 * (1.5 + number(n, 9)),
        })
        .collect()
}

/// What some steps leave behind.
#[derive(PartialEq)]
struct Left {
    /// Bits of force and torque on the first of each pair and of its memory.
    bits: Vec<u64>,
    /// Bits of all that the lines hold.
    lines: Vec<u64>,
    /// The largest stiffness from two ways of looking.
    stiffness: [f64; 2],
}

fn run(config: &PairConfig, bodies: Bodies, simd: Simd, ledger: bool) -> Left {
    let mut pass = PairPass::new(config, bodies);
    let time_step = 1e-5;
    pass.prepare(time_step, false);
    let columns = pass.columns().len();
    let mut section = Section::new(0, Partners::Near, columns, 0);
    section.resize(PAIRS);
    for place in 0..PAIRS {
        section.set(place, place as u32, place as u32 + 1, shift::encode([0; 3]));
    }
    let motion = CellMotion {
        sides: [1.0; 3],
        shift: ShiftTable::new([1.0; 3]),
        shift_velocity: ShiftTable::new([0.0; 3]),
        faces_move: false,
        gradient: [0.0, 0.0, -0.5],
        wall_velocity: [0.0; 3],
    };
    let stride = pass.width() + if ledger { LEDGER_STRIDE } else { 0 };
    let input =
        PassInput { motion: &motion, stride, ledger, max_overlap_fraction: 0.5, time_step, work_time: time_step, simd };
    let mut records = records();
    let mut lines = vec![0.0; section.blocks() * BLOCK * stride];
    let mut touches: Box<[BlockTouches; BATCH]> = bytemuck::zeroed_box();
    for _ in 0..STEPS {
        let blocks = 0..section.blocks();
        let lines = LineRing { values: &mut lines, first: 0, mask: usize::MAX };
        let bodies = BodyData { records: &records, shapes: &[] };
        let job = Job { input: &input, bodies, section: &mut section, blocks, lines, touches: &mut touches };
        assert_eq!(pass.run(job), None);
        for record in &mut records {
            for axis in 0..3 {
                record.position[axis] += record.velocity[axis] * time_step;
            }
        }
    }
    let mut bits = Vec::new();
    for (place, line) in lines.chunks(stride).take(PAIRS).enumerate() {
        let mut memory = vec![0.0; columns];
        section.read_memory(place, &mut memory);
        let torque = if pass.width() == 6 { &line[3..6] } else { &line[4..7] };
        bits.extend(line[..3].iter().chain(torque).chain(&memory).map(|value| value.to_bits()));
    }
    let stiffness = [false, true].map(|sums| {
        let wanted = Wanted { sums, samples: false };
        let observation = Observation::new(wanted);
        let mut observed =
            Observed { wanted, beyond: None, owned: PAIRS, line: 0, observation, forces: &mut [], first_line: 0 };
        let room = (&mut *touches, &mut Vec::new());
        let bodies = BodyData { records: &records, shapes: &[] };
        pass.observe(&input, bodies, &section, 0..section.blocks(), room, &mut observed);
        observed.observation.max_stiffness
    });
    Left { bits, lines: lines.iter().map(|value| value.to_bits()).collect(), stiffness }
}

#[test]
fn equal_radii_and_a_ledger_change_no_bits_at_any_width() {
    let mindlin = Some(choice(Role::Tangential, "mindlin", &[]));
    let hertz = pair(properties(5e7, 0.25, Vec::new()), choice(Role::Normal, "hertz", &[]));
    let relaxing = pair(pvdf(), choice(Role::Normal, "maxwell_zener", &[]));
    let rolling = Some(choice(Role::Rolling, "spring_slider", &[]));
    let dented = pair(nmc(), choice(Role::Normal, "thornton", &[]));
    for config in [
        PairConfig { tangential: mindlin.clone(), ..hertz.clone() },
        PairConfig { tangential: mindlin.clone(), rolling: rolling.clone(), ..hertz },
        PairConfig { tangential: mindlin.clone(), rolling, ..dented },
        PairConfig { tangential: mindlin, ..relaxing },
    ] {
        let Left { bits: expected, stiffness, .. } = run(&config, Bodies::Spheres, Simd::Scalar, false);
        assert!(stiffness[0] > 0.0 && stiffness[0] == stiffness[1], "{stiffness:?}");
        let touching = expected.iter().filter(|bits| **bits != 0.0_f64.to_bits()).count();
        assert!(touching > expected.len() / 3 && touching < expected.len(), "{touching} of {}", expected.len());
        for simd in [Simd::Scalar, Simd::Avx2, Simd::Avx512].into_iter().filter(|level| level.is_available()) {
            for bodies in [Bodies::Spheres, Bodies::EqualSpheres] {
                for ledger in [false, true] {
                    let (scalar, lanes) =
                        (run(&config, bodies, Simd::Scalar, ledger), run(&config, bodies, simd, ledger));
                    assert!(lanes == scalar, "{bodies:?} {simd:?}, ledger {ledger}");
                    let same = lanes.bits == expected && lanes.stiffness == stiffness;
                    assert!(same, "{bodies:?} {simd:?}, ledger {ledger}");
                }
            }
        }
    }
}
