//! Lanes give the scalar bits for every law and every choice; the chain builds what the input names.

use super::*;
use crate::config::MaxwellBranch;
use crate::force::lane::portable::Portable;
use crate::force::registry::{LawChoice, PairProperties, ParameterKind, ParameterValue, Role, laws};
use crate::force::testing::{choice, pair, properties};
use proptest::prelude::*;

type Portable8 = Portable<8>;

const STEPS: usize = 4;

fn branches(count: usize) -> PairProperties {
    let branches =
        (0..count).map(|k| MaxwellBranch { modulus: 1e8 * (1 + k) as f64, relaxation_time: 1e-3 * (1 + k) as f64 });
    PairProperties { yield_stress: [Some(1e6); 2], ..properties(1e9, 0.3, branches.collect()) }
}

fn with_branches(count: usize) -> PairConfig {
    let name = if count == 0 { "hertz" } else { "maxwell_zener" };
    pair(branches(count), choice(Role::Normal, name, &[]))
}

/// Every normal law with a pair that it accepts: without Maxwell branches, or with each number of them.
fn every_normal() -> impl Iterator<Item = PairConfig> {
    laws().iter().filter(|law| law.role == Role::Normal).flat_map(|law| {
        let counts = if (law.check)(&branches(0)).is_ok() { 0..=0 } else { 1..=8 };
        counts.map(move |count| pair(branches(count), law.with_defaults()))
    })
}

/// Every combination of a law's choices and flags, and each number alone at its least value.
fn variants(law: LawChoice) -> Vec<LawChoice> {
    let numbers = law.law.parameters.iter().enumerate().filter_map(|(k, spec)| {
        let ParameterKind::Number { min, .. } = spec.kind else { return None };
        let mut law = law.clone();
        law.values[k] = ParameterValue::Number(min);
        Some(law)
    });
    let numbers: Vec<LawChoice> = numbers.collect();
    let mut all = vec![law];
    for (k, spec) in all[0].law.parameters.iter().enumerate() {
        let values: Vec<ParameterValue> = match spec.kind {
            ParameterKind::Choice(words) => (0..words.len()).map(ParameterValue::Choice).collect(),
            ParameterKind::Flag => [true, false].map(ParameterValue::Flag).to_vec(),
            ParameterKind::Number { .. } => vec![spec.default],
        };
        all = all
            .iter()
            .flat_map(|law| {
                values.iter().map(move |&value| {
                    let mut law = law.clone();
                    law.values[k] = value;
                    law
                })
            })
            .collect();
    }
    all.extend(numbers);
    all
}

/// Every law of a role with every combination of its choices.
fn choices(role: Role) -> Vec<LawChoice> {
    laws().iter().filter(|law| law.role == role).flat_map(|law| variants(law.with_defaults())).collect()
}

/// Every composition that the registry can build: normal laws and branch counts × choices × tangential parts.
fn every_pair() -> Vec<PairConfig> {
    let tangential: Vec<_> = std::iter::once(None).chain(choices(Role::Tangential).into_iter().map(Some)).collect();
    let mut pairs = Vec::new();
    for base in every_normal() {
        for normal in variants(base.normal.clone()) {
            for tangential in tangential.clone() {
                pairs.push(PairConfig { normal: normal.clone(), tangential, ..base.clone() });
            }
        }
    }
    pairs
}

/// A pair with every choice of a rolling law.
fn every_rolling() -> impl Iterator<Item = PairConfig> {
    choices(Role::Rolling).into_iter().map(|rolling| PairConfig { rolling: Some(rolling), ..with_branches(0) })
}

/// Eight touches, several steps each: overlap, rate, and the vectors in units of their own.
type Numbers = Vec<[f64; 15]>;

fn touch(n: &[f64; 15]) -> Touch<f64> {
    let direction = [n[2] + 0.1, n[3], n[4]];
    let length = (direction[0] * direction[0] + direction[1] * direction[1] + direction[2] * direction[2]).sqrt();
    let normal = direction.map(|c| c / length);
    let slip = [n[5], n[6], n[7]];
    let along = slip[0] * normal[0] + slip[1] * normal[1] + slip[2] * normal[2];
    Touch {
        overlap: 1e-6 * (n[0].abs() + 1e-3),
        overlap_rate: n[1],
        effective_radius: 1e-3 * (n[14].abs() + 0.1),
        radius_factor: 1.0 - 0.1 * n[13].abs(),
        overlap_factor: 1.0 - 0.1 * n[12].abs(),
        size: 4e-3 * (n[14].abs() + 0.1),
        effective_mass: 1e-6 * (n[13].abs() + 0.1),
        normal,
        slip_velocity: std::array::from_fn(|k| slip[k] - along * normal[k]),
        relative_spin: [1e3 * n[8], 1e3 * n[9], 1e3 * n[10]],
        spin_about_normal: 1e3 * n[11],
    }
}

fn gather(touches: &[Touch<f64>]) -> Touch<Portable8> {
    let lanes = |f: &dyn Fn(&Touch<f64>) -> f64| Portable(std::array::from_fn(|k| f(&touches[k])));
    let vector = |f: &dyn Fn(&Touch<f64>) -> [f64; 3]| std::array::from_fn(|c| lanes(&|t| f(t)[c]));
    Touch {
        overlap: lanes(&|t| t.overlap),
        overlap_rate: lanes(&|t| t.overlap_rate),
        effective_radius: lanes(&|t| t.effective_radius),
        radius_factor: lanes(&|t| t.radius_factor),
        overlap_factor: lanes(&|t| t.overlap_factor),
        size: lanes(&|t| t.size),
        effective_mass: lanes(&|t| t.effective_mass),
        normal: vector(&|t| t.normal),
        slip_velocity: vector(&|t| t.slip_velocity),
        relative_spin: vector(&|t| t.relative_spin),
        spin_about_normal: lanes(&|t| t.spin_about_normal),
    }
}

fn energies<L: Lane>(e: &Energies<L>) -> [L; 6] {
    [e.elastic, e.viscoelastic, e.damping, e.viscous, e.friction, e.plastic]
}

/// All numbers of a response, in a fixed order.
fn numbers<L: Lane>(r: &ContactResponse<L>) -> Vec<L> {
    [&[r.normal_force, r.stiffness][..], &r.tangential_force, &energies(&r.energies)].concat()
}

/// Whether some steps of eight touches in lanes give the bits of each of them alone, in answers and memory. `lanes` and
/// `alone` evaluate a law with this number of memory columns.
fn compare(
    numbers: &Numbers,
    memory: usize,
    lanes: impl Fn(&[[f64; 15]], &mut [Portable8]) -> Vec<Portable8>,
    alone: impl Fn(&[f64; 15], &mut [f64]) -> Vec<f64>,
) -> Result<(), String> {
    let mut wide = [Portable8::splat(0.0); MAX_MEMORY];
    let mut narrow = [[0.0; MAX_MEMORY]; 8];
    for step in numbers.chunks(8) {
        let together = lanes(step, &mut wide[..memory]);
        for lane in 0..8 {
            let answer = alone(&step[lane], &mut narrow[lane][..memory]);
            let kept = (0..memory).map(|k| (wide[k].0[lane], narrow[lane][k]));
            for (index, (a, b)) in together.iter().map(|v| v.0[lane]).zip(answer).chain(kept).enumerate() {
                if a.to_bits() != b.to_bits() || !a.is_finite() {
                    return Err(format!("lane {lane}, number {index}: {a:e} and {b:e}"));
                }
            }
        }
    }
    Ok(())
}

fn touches(step: &[[f64; 15]]) -> Touch<Portable8> {
    gather(&step.iter().map(touch).collect::<Vec<_>>())
}

struct CompareLanes<'a>(&'a Numbers);

impl LawVisitor for CompareLanes<'_> {
    type Output = Result<(), String>;
    fn visit<C: ContactLaw>(self, mut law: C) -> Result<(), String> {
        law.prepare(1e-5);
        compare(
            self.0,
            C::MEMORY,
            |step, memory| numbers(&law.evaluate(&touches(step), memory)),
            |one, memory| numbers(&law.evaluate(&touch(one), memory)),
        )
    }
}

impl RollingVisitor for CompareLanes<'_> {
    type Output = Result<(), String>;
    fn visit<R: RollingLaw>(self, mut law: R) -> Result<(), String> {
        law.prepare(1e-5);
        compare(
            self.0,
            R::MEMORY,
            |step, memory| moments(&law.evaluate(&touches(step), &normal_responses(step), memory)),
            |one, memory| moments(&law.evaluate(&touch(one), &normal_response(one), memory)),
        )
    }
}

fn moments<L: Lane>(r: &VectorResponse<L>) -> Vec<L> {
    [&r.value[..], &energies(&r.energies)].concat()
}

fn normal_responses(step: &[[f64; 15]]) -> NormalResponse<Portable8> {
    let normals: Vec<_> = step.iter().map(normal_response).collect();
    let lanes = |f: fn(&NormalResponse<f64>) -> f64| Portable(std::array::from_fn(|k| f(&normals[k])));
    NormalResponse {
        force: lanes(|n| n.force),
        contact_radius: lanes(|n| n.contact_radius),
        stiffness: lanes(|n| n.stiffness),
        dashpot: lanes(|n| n.dashpot),
        energies: Energies::zero(),
    }
}

/// The answer of some normal law.
fn normal_response(n: &[f64; 15]) -> NormalResponse<f64> {
    NormalResponse {
        force: 1e-2 * n[5].abs(),
        contact_radius: 1e-5 * (n[6].abs() + 1e-2),
        stiffness: 1e4 * n[7].abs(),
        dashpot: 1e-2 * n[8].abs(),
        energies: Energies::zero(),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]

    #[test]
    fn eight_lanes_give_the_scalar_bits_for_every_law_and_choice(
        numbers in prop::collection::vec(prop::array::uniform15(-1.0..1.0f64), 8 * STEPS)
    ) {
        for pair in every_pair() {
            let result = visit(&pair, CompareLanes(&numbers));
            prop_assert!(result.is_ok(), "{result:?} for {pair:?}");
        }
        for pair in every_rolling() {
            let result = visit_rolling(&pair, CompareLanes(&numbers));
            prop_assert!(matches!(result, Some(Ok(()))), "{result:?} for {pair:?}");
        }
    }
}

/// Memory columns, TANGENTIAL, and the response to one touch with slip and spin.
struct Describe;

impl RollingVisitor for Describe {
    type Output = (Vec<Column>, usize);
    fn visit<R: RollingLaw>(self, law: R) -> Self::Output {
        (law.columns(), R::MEMORY)
    }
}

impl LawVisitor for Describe {
    type Output = (Vec<Column>, usize, bool, ContactResponse<f64>);
    fn visit<C: ContactLaw>(self, mut law: C) -> Self::Output {
        law.prepare(1e-5);
        let mut memory = [0.0; MAX_MEMORY];
        let numbers = std::array::from_fn(|k| 0.1 + 0.05 * k as f64);
        let response = law.evaluate(&touch(&numbers), &mut memory[..C::MEMORY]);
        (law.columns(), C::MEMORY, C::TANGENTIAL, response)
    }
}

#[test]
fn columns_are_as_many_as_the_memory_and_have_different_names() {
    for pair in every_pair() {
        let (own, memory, tangential, _) = visit(&pair, Describe);
        assert_eq!((own.len(), tangential), (memory, pair.tangential.is_some()));
        for rolling in every_rolling() {
            let (more, memory) = visit_rolling(&rolling, Describe).expect("a rolling law");
            assert_eq!(more.len(), memory);
            let columns = [&own[..], &more].concat();
            let mut names: Vec<&str> = columns.iter().map(|c| c.name.as_str()).collect();
            names.sort_unstable();
            names.dedup();
            assert_eq!(names.len(), columns.len(), "{columns:?}");
        }
    }
}

#[test]
fn a_frictionless_composition_returns_no_tangential_force() {
    for pair in every_pair().iter().filter(|pair| pair.tangential.is_none()) {
        let (.., response) = visit(pair, Describe);
        assert_eq!(response.tangential_force, [0.0; 3]);
        assert!(response.normal_force > 0.0);
    }
}

#[test]
fn a_pair_without_friction_coefficient_returns_no_tangential_force() {
    let mut pair = with_branches(2);
    pair.properties.friction = 0.0;
    pair.tangential = Some(choice(Role::Tangential, "mindlin", &[]));
    let (.., response) = visit(&pair, Describe);
    assert_eq!(response.tangential_force, [0.0; 3]);
}
