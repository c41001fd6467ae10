//! The dashpot beside a Hertzian spring: its coefficient from the restitution coefficient. Shared by the
//! normal laws; knows nothing of their springs but the modulus.

use super::lane::Lane;
use super::registry::{LawChoice, ParameterKind, ParameterSpec, ParameterValue};

/// Words of the parameter `damping`, in the order of the defaults below.
const WORDS: &[&str] = &["none", "tsuji", "wahn"];

/// The parameter `damping` with `tsuji` as default: restitution comes out as put in.
pub const DAMPING_TSUJI: ParameterSpec = ParameterSpec {
    name: "damping",
    kind: ParameterKind::Choice(WORDS),
    default: ParameterValue::Choice(1),
    doc: "dashpot: tsuji (restitution out = in without clipping), wahn (HSD of W 3.3), none",
};

/// The parameter `damping` with `none` as default, for laws that dissipate by themselves.
pub const DAMPING_NONE: ParameterSpec = ParameterSpec {
    default: ParameterValue::Choice(0),
    doc: "dashpot beside the branches: none, tsuji, wahn (from the restitution coefficient)",
    ..DAMPING_TSUJI
};

/// The parameter `clip`.
pub const CLIP: ParameterSpec = ParameterSpec {
    name: "clip",
    kind: ParameterKind::Flag,
    default: ParameterValue::Flag(true),
    doc: "the total normal force is never tensile (raises the effective restitution)",
};

/// Smallest total normal force \[N\] under the parameter `clip`: 0, or −∞ when clipping is off.
#[must_use]
pub fn force_floor(choice: &LawChoice) -> f64 {
    if choice.flag(CLIP.name) { 0.0 } else { f64::NEG_INFINITY }
}

/// A viscous dashpot `c δ̇` beside a Hertzian spring: `c = q √(E_eff a m_eff)`, a the contact radius.
///
/// With `b = −ln e/√(ln²e + π²)`: `tsuji` has `c = 2 √(5/6) b √(2 E_eff a m_eff)`, `wahn` has
/// `c = 2 b √(4/3 E_eff a m_eff)`.
///
/// # Source
/// W (3.3) for `wahn`; Tsuji, Tanaka, Ishida 1992 (doi:10.1016/0032-5910(92)88030-L) for `tsuji`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dashpot {
    factor: f64,
    /// The factor is not 0.
    damps: bool,
}

impl Dashpot {
    /// From the law's parameter `damping`, the effective modulus \[Pa\] of the spring beside it and the
    /// restitution coefficient.
    #[must_use]
    pub fn new(choice: &LawChoice, effective_modulus: f64, restitution: f64) -> Self {
        let b = damping_ratio(restitution);
        let factor = match choice.word(DAMPING_TSUJI.name) {
            "tsuji" => 2.0 * (5.0_f64 / 6.0).sqrt() * b * (2.0 * effective_modulus).sqrt(),
            "wahn" => 2.0 * b * (4.0 / 3.0 * effective_modulus).sqrt(),
            _ => 0.0,
        };
        Self { factor, damps: factor != 0.0 }
    }

    /// Coefficient c \[N s/m\] at contact radius a \[m\] and effective mass \[kg\].
    #[inline(always)]
    #[must_use]
    pub fn coefficient<L: Lane>(&self, contact_radius: L, effective_mass: L) -> L {
        if self.damps { L::splat(self.factor) * (contact_radius * effective_mass).sqrt() } else { L::splat(0.0) }
    }
}

/// `b = −ln e/√(ln²e + π²)`, 0 for e = 1, 1 in the limit e → 0.
#[must_use]
pub fn damping_ratio(restitution: f64) -> f64 {
    if restitution <= 0.0 {
        return 1.0;
    }
    let log = libm::log(restitution);
    -log / (log * log + std::f64::consts::PI * std::f64::consts::PI).sqrt()
}
