//! Normal and tangential law of a pair of materials side by side, and the builders that turn the input's choices into
//! concrete types. A rolling law stands by itself: it needs the normal law's answer and no more.

use super::lane::Lane;
use super::law::{
    Column, ContactLaw, ContactResponse, Energies, LawVisitor, MAX_EARLY, NormalLaw, NormalResponse, RollingLaw,
    TangentialLaw, Touch, VectorResponse,
};
use super::registry::{build_normal, build_rolling, build_tangential};
use super::shear::ShearSprings;
use crate::config::PairConfig;

/// Most memory columns that a composition or a rolling law may have: the size of the loops' local arrays.
pub const MAX_MEMORY: usize = 48;

/// A normal and a tangential law, evaluated in this order; their memory columns follow one another in the same order,
/// and those of the rolling law follow them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Composition<N, T> {
    normal: N,
    tangential: T,
}

/// No tangential force.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoTangential;

impl TangentialLaw for NoTangential {
    const MEMORY: usize = 0;
    fn columns(&self) -> Vec<Column> {
        Vec::new()
    }
    fn prepare(&mut self, _time_step: f64) {}
    #[inline(always)]
    fn complete<L: Lane>(&self, _: &Touch<L>, _: &NormalResponse<L>, _: &[L], _: &mut [L]) -> VectorResponse<L> {
        VectorResponse { value: [L::splat(0.0); 3], energies: Energies::zero() }
    }
}

impl<N: NormalLaw, T: TangentialLaw> ContactLaw for Composition<N, T> {
    const MEMORY: usize = {
        let memory = N::MEMORY + T::MEMORY;
        assert!(memory <= MAX_MEMORY, "a composition of contact laws has more memory columns than the pass holds");
        memory
    };
    const NORMAL_MEMORY: usize = N::MEMORY;
    const TANGENTIAL: bool = T::MEMORY > 0;
    const LASTS: bool = N::LASTS;
    const EARLY: usize = {
        assert!(T::EARLY <= MAX_EARLY, "a tangential law hands on more numbers than the pass holds");
        T::EARLY
    };

    fn range(&self) -> f64 {
        self.normal.range()
    }

    fn columns(&self) -> Vec<Column> {
        [self.normal.columns(), self.tangential.columns()].concat()
    }

    fn prepare(&mut self, time_step: f64) {
        self.normal.prepare(time_step);
        self.tangential.prepare(time_step);
    }

    fn relax(&mut self) {
        self.normal.relax();
        self.tangential.relax();
    }

    #[inline(always)]
    fn normal<L: Lane>(&self, touch: &Touch<L>, memory: &mut [L]) -> NormalResponse<L> {
        self.normal.evaluate(touch, memory)
    }

    #[inline(always)]
    fn early<L: Lane>(&self, touch: &Touch<L>, normal: &NormalResponse<L>, memory: &[L], early: &mut [L]) {
        self.tangential.early(touch, normal, memory, early);
    }

    #[inline(always)]
    fn complete<L: Lane>(
        &self,
        touch: &Touch<L>,
        normal: &NormalResponse<L>,
        early: &[L],
        memory: &mut [L],
    ) -> ContactResponse<L> {
        let mut tangential = self.tangential.complete(touch, normal, early, memory);
        let joined = normal.joined();
        if N::LASTS {
            // Friction ends with the contact circle, though the normal law's memory goes on.
            tangential = tangential.only(joined);
            for value in memory {
                *value = value.only(joined);
            }
        }
        ContactResponse {
            joined,
            normal_force: normal.force,
            tangential_force: tangential.value,
            stiffness: normal.stiffness,
            energies: normal.energies.plus(tangential.energies),
        }
    }
}

/// Receives the concrete normal law from its builder, with the shear springs that go with it.
pub trait NormalVisitor {
    /// What the visitor makes of the law.
    type Output;
    /// Called once.
    fn visit<N: NormalLaw, const SPRINGS: usize>(self, law: N, shear: ShearSprings<SPRINGS>) -> Self::Output;
}

/// Receives the concrete tangential law from its builder.
pub trait TangentialVisitor {
    /// What the visitor makes of the law.
    type Output;
    /// Called once.
    fn visit<T: TangentialLaw>(self, law: T) -> Self::Output;
}

/// Receives the concrete rolling law from its builder.
pub trait RollingVisitor {
    /// What the visitor makes of the law.
    type Output;
    /// Called once.
    fn visit<R: RollingLaw>(self, law: R) -> Self::Output;
}

/// Builds the composition that the pair's choices name and hands it to the visitor.
///
/// The pair must have passed the `check` of each of its laws.
pub fn visit<V: LawVisitor>(pair: &PairConfig, visitor: V) -> V::Output {
    build_normal(pair, FromNormal { pair, visitor })
}

/// Builds the rolling law that the pair's choices name, if any, and hands it to the visitor.
pub fn visit_rolling<V: RollingVisitor>(pair: &PairConfig, visitor: V) -> Option<V::Output> {
    pair.rolling.as_ref().map(|choice| build_rolling(pair, choice, visitor))
}

struct FromNormal<'a, V> {
    pair: &'a PairConfig,
    visitor: V,
}

impl<V: LawVisitor> NormalVisitor for FromNormal<'_, V> {
    type Output = V::Output;
    fn visit<N: NormalLaw, const SPRINGS: usize>(self, normal: N, shear: ShearSprings<SPRINGS>) -> V::Output {
        let next = FromTangential { normal, visitor: self.visitor };
        match &self.pair.tangential {
            None => next.visit(NoTangential),
            Some(choice) => build_tangential(self.pair, choice, &shear, next),
        }
    }
}

struct FromTangential<N, V> {
    normal: N,
    visitor: V,
}

impl<N: NormalLaw, V: LawVisitor> TangentialVisitor for FromTangential<N, V> {
    type Output = V::Output;
    fn visit<T: TangentialLaw>(self, tangential: T) -> V::Output {
        self.visitor.visit(Composition { normal: self.normal, tangential })
    }
}

#[cfg(test)]
mod tests;
