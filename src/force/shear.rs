//! The shear springs that go with a normal law: what a tangential law needs to know of the bulk.

use super::maxwell_zener::split_last_branch;
use super::registry::PairProperties;

/// The shear moduli of a pair, one relaxing set in parallel: `COUNT` springs of which those with a
/// relaxation rate above zero belong to Maxwell branches and the last one is the long-term spring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShearSprings<const COUNT: usize> {
    /// Effective shear moduli G_eff,k \[Pa\].
    pub modulus: [f64; COUNT],
    /// Relaxation rates 1/τ_k \[1/s\], 0 for a spring that does not relax.
    pub rate: [f64; COUNT],
    /// G_eff/E_eff, the same for the long-term and the spontaneous moduli.
    pub shear_to_young: f64,
}

impl ShearSprings<1> {
    /// The one spring of an elastic pair.
    #[must_use]
    pub fn elastic(properties: &PairProperties) -> Self {
        Self {
            modulus: [properties.effective_shear_modulus()],
            rate: [0.0],
            shear_to_young: properties.effective_shear_modulus() / properties.effective_young_modulus(),
        }
    }
}

impl<const COUNT: usize> ShearSprings<COUNT> {
    /// The springs of a pair of equal materials with up to `COUNT − 1` Maxwell branches (the last one split
    /// as in the normal law, [`split_last_branch`]): `G_k = E_k/(4(1+ν)(2−ν))` with the branches' own τ_k, the long-term spring last.
    ///
    /// # Source
    /// W (3.9) with the erratum for G of each modulus.
    #[must_use]
    pub fn relaxing(properties: &PairProperties) -> Self {
        let long_term = properties.effective_shear_modulus();
        let branches = split_last_branch(&properties.maxwell[0], COUNT - 1);
        let per_young = long_term / properties.young_modulus[0];
        Self {
            modulus: std::array::from_fn(|k| branches.get(k).map_or(long_term, |branch| branch.modulus * per_young)),
            rate: std::array::from_fn(|k| branches.get(k).map_or(0.0, |branch| 1.0 / branch.relaxation_time)),
            shear_to_young: long_term / properties.effective_young_modulus(),
        }
    }
}
