//! What the elastic–plastic normal laws share: where yielding begins, elastic unloading from the largest
//! overlap, and the memory that a dent is. Knows no law's loading curve.

use super::dashpot::{Dashpot, force_floor};
use super::lane::Lane;
use super::law::{Column, Energies, NormalResponse, Touch};
use super::registry::{LawChoice, PairProperties, ParameterKind, ParameterSpec, ParameterValue};
use crate::config::PairConfig;

/// The parameter `yield_factor`.
pub const YIELD_FACTOR: ParameterSpec = ParameterSpec {
    name: "yield_factor",
    kind: ParameterKind::Number { min: 0.1, max: 10.0 },
    default: ParameterValue::Number(1.6),
    doc: "contact pressure at which yielding begins over the lower yield stress of the pair",
};

/// The parameter `memory_range`.
pub const MEMORY_RANGE: ParameterSpec = ParameterSpec {
    name: "memory_range",
    kind: ParameterKind::Number { min: 0.0, max: 0.5 },
    default: ParameterValue::Number(0.01),
    doc: "gap over R_eff up to which a dent is remembered; a touch after a wider gap begins anew",
};

/// Memory columns of an elastic–plastic law.
pub const MEMORY: usize = 4;

/// Largest overlap, plastic (residual) overlap, regime ([`Regime`]), plastic work.
#[must_use]
pub fn columns() -> Vec<Column> {
    [("largest_overlap", "m"), ("plastic_overlap", "m"), ("regime", "1"), ("plastic_work", "J")]
        .map(|(name, unit)| Column { name: name.to_owned(), unit })
        .into()
}

/// What the memory column `regime` says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Regime {
    /// A dent that is not reached.
    Apart = 0,
    /// Hertzian.
    Elastic = 1,
    /// First loading beyond yield, the contact pressure still growing.
    ElasticPlastic = 2,
    /// First loading at the full contact pressure.
    Plastic = 3,
    /// Unloading from the largest overlap and loading up to it again.
    Unloading = 4,
}

impl Regime {
    /// As the memory holds it.
    #[must_use]
    pub fn number(self) -> f64 {
        f64::from(self as u8)
    }
}

/// Refuses a pair of which no material yields.
///
/// # Errors
/// Neither material has a yield stress.
pub fn check(properties: &PairProperties) -> Result<(), String> {
    if properties.yield_stress.iter().all(Option::is_none) {
        let [first, second] = &properties.names;
        return Err(format!(
            "an elastic-plastic law needs a yield stress, and neither {first} nor {second} has one; give yield_stress = \
             \"… MPa\" to the material that yields, or choose hertz"
        ));
    }
    Ok(())
}

/// Lower yield stress of a pair \[Pa\], infinite where nothing yields.
#[must_use]
pub fn lower_yield_stress(properties: &PairProperties) -> f64 {
    let given = properties.yield_stress.iter().flatten();
    given.fold(f64::INFINITY, |least, y| if *y < least { *y } else { least })
}

/// Where the contact of a touch begins to yield.
#[derive(Debug, Clone, Copy)]
pub struct Yield<L> {
    /// δ_Y \[m\].
    pub overlap: L,
    /// F_Y \[N\].
    pub force: L,
    /// c_Y², of the equivalent contact radius \[m²\].
    pub radius_squared: L,
}

/// A law's curve of first loading.
pub trait LoadingCurve {
    /// Where it stands at an overlap \[m\].
    fn loading<L: Lane>(&self, touch: &Touch<L>, overlap: L) -> Peak<L>;
}

/// Where the loading curve stands at an overlap.
#[derive(Debug, Clone, Copy)]
pub struct Peak<L: Lane> {
    /// At the full contact pressure.
    pub fully_plastic: L::Mask,
    /// F \[N\].
    pub force: L,
    /// Force that this contact radius has at the pressure of first yield \[N\]; it sets the recovery.
    pub force_at_first_yield_pressure: L,
    /// Equivalent contact radius \[m\].
    pub contact_radius: L,
    /// Work done from δ = 0 up to here, ∫ F dδ \[J\].
    pub work: L,
}

/// Constants of an elastic–plastic pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plastic {
    /// E_eff \[Pa\].
    pub effective_modulus: f64,
    /// Lower yield stress Y of the pair \[Pa\].
    pub yield_stress: f64,
    /// p_Y = `yield_factor` · Y \[Pa\].
    pub pressure: f64,
    range: f64,
    dashpot: Dashpot,
    floor: f64,
    time_step: f64,
}

impl Plastic {
    /// From the pair's constants and the normal law's parameters.
    #[must_use]
    pub fn new(pair: &PairConfig) -> Self {
        let effective_modulus = pair.properties.effective_young_modulus();
        let yield_stress = lower_yield_stress(&pair.properties);
        let choice: &LawChoice = &pair.normal;
        Self {
            effective_modulus,
            yield_stress,
            pressure: choice.number(YIELD_FACTOR.name) * yield_stress,
            range: choice.number(MEMORY_RANGE.name),
            dashpot: Dashpot::new(choice, effective_modulus, pair.properties.restitution),
            floor: force_floor(choice),
            time_step: 0.0,
        }
    }

    /// Time step \[s\].
    pub fn prepare(&mut self, time_step: f64) {
        self.time_step = time_step;
    }

    /// Gap over R_eff up to which the dent is remembered.
    #[must_use]
    pub fn range(&self) -> f64 {
        self.range
    }

    /// `√(R_e δ/f_2)` \[m\], the equivalent contact radius over f_1, at an overlap.
    #[inline(always)]
    #[must_use]
    pub fn hertz_radius<L: Lane>(touch: &Touch<L>, overlap: L) -> L {
        (touch.effective_radius * overlap / touch.overlap_factor).sqrt()
    }

    /// Hertz force `4/3 E_eff √R_e (δ/f_2)^{3/2}` \[N\] with [`Self::hertz_radius`] at hand.
    #[inline(always)]
    #[must_use]
    pub fn hertz_force<L: Lane>(&self, touch: &Touch<L>, hertz_radius: L, overlap: L) -> L {
        L::splat(4.0 / 3.0 * self.effective_modulus) * hertz_radius * (overlap / touch.overlap_factor)
    }

    /// First yield: `c_Y = p_Y π R_e f_1³/(2 E_eff)`, `δ_Y = c_Y² f_2/(R_e f_1²)`, F_Y the Hertz force there.
    ///
    /// # Source
    /// B (8)–(10), (29), (30); for spheres Thornton 1997.
    #[inline(always)]
    #[must_use]
    pub fn yield_point<L: Lane>(&self, touch: &Touch<L>) -> Yield<L> {
        let f1 = touch.radius_factor;
        let per_radius = L::splat(std::f64::consts::PI * self.pressure / (2.0 * self.effective_modulus)) * f1 * f1;
        let hertz_radius = per_radius * touch.effective_radius;
        let overlap = per_radius * per_radius * touch.effective_radius * touch.overlap_factor;
        let radius = hertz_radius * f1;
        Yield { overlap, force: self.hertz_force(touch, hertz_radius, overlap), radius_squared: radius * radius }
    }

    /// Force, energies and new memory of one touch, given the law's loading curve.
    ///
    /// With δ* the largest overlap, F* and c* force and contact radius there, `δ* − δ_p = δ* F_pY/F_H(δ*)` the
    /// elastic recovery (F_pY: [`Peak::force_at_first_yield_pressure`], F_H Hertz) and
    /// `t² = (δ − δ_p)/(δ* − δ_p)`: `F = F* t³`, `c = c* t`. Both follow from B (44), (34), (46), (47): Hertz with
    /// the radius R_{e,p}, made continuous at δ* by β. Below yield δ_p = 0 and nothing is remembered but δ*.
    ///
    /// Energies: held `2/5 F (δ − δ_p)`; plastic the work of the loading curve up to δ* less what it holds there,
    /// as far as it grew in this step.
    #[inline(always)]
    #[must_use]
    pub fn respond<L: Lane>(&self, touch: &Touch<L>, memory: &mut [L], law: &impl LoadingCurve) -> NormalResponse<L> {
        let zero = L::splat(0.0);
        let overlap = touch.overlap;
        // The memory comes first: a comparison with NaN is false, so a NaN stays visible.
        let largest = memory[0].max(overlap);
        let first_yield = self.yield_point(touch).overlap;
        let yielded = largest.greater(first_yield);
        let top = L::select(yielded, largest, zero.max(overlap));
        let peak = law.loading(touch, top);
        let hertz = self.hertz_force(touch, Self::hertz_radius(touch, top), top);
        let recovery = L::select(yielded, top * (peak.force_at_first_yield_pressure / hertz), top);
        let plastic_overlap = top - recovery;
        let depth = L::select(yielded, overlap - plastic_overlap, overlap);
        let apart = zero.at_least(depth);
        let joined = |value| L::select(apart, zero, value);
        let share = (depth / recovery).sqrt();
        let spring = joined(peak.force * (share * share * share));
        let contact_radius = joined(peak.contact_radius * share);

        let dissipated = peak.work - L::splat(0.4) * peak.force * recovery;
        let plastic_work = dissipated.only(yielded);
        let regime = |regime: Regime| L::splat(regime.number());
        let loads = overlap.at_least(memory[0]);
        let virgin = L::select(peak.fully_plastic, regime(Regime::Plastic), regime(Regime::ElasticPlastic));
        let beyond = L::select(loads, virgin, regime(Regime::Unloading));
        let touching = L::select(yielded, beyond, regime(Regime::Elastic));
        let before = memory[3];
        memory[0] = L::select(yielded, largest, zero.max(largest));
        memory[1] = plastic_overlap.only(yielded);
        memory[2] = L::select(apart, regime(Regime::Apart), touching);
        memory[3] = plastic_work;
        // An elastic touch leaves nothing behind.
        let ended = apart & !yielded;
        memory[0] = L::select(ended, zero, memory[0]);

        let dashpot = self.dashpot.coefficient(contact_radius, touch.effective_mass);
        let force = L::splat(self.floor).max(spring + dashpot * touch.overlap_rate);
        let energies = Energies {
            elastic: L::splat(0.4) * joined(spring * depth),
            damping: (force - spring) * touch.overlap_rate * L::splat(self.time_step),
            plastic: plastic_work - before,
            ..Energies::zero()
        };
        NormalResponse {
            force,
            contact_radius,
            stiffness: joined(L::splat(1.5) * peak.force * share / recovery),
            dashpot,
            energies,
        }
    }
}
