//! The whole law of a pair of materials: a normal, a tangential and a rolling part side by side, and the
//! chain of builders that turns the input's choices into one concrete type.

use super::lane::Lane;
use super::law::{
    Column, ContactLaw, ContactResponse, Energies, LawVisitor, MAX_EARLY, NormalLaw, NormalResponse, RollingLaw,
    TangentialLaw, Touch, VectorResponse,
};
use super::registry::{build_normal, build_rolling, build_tangential};
use super::shear::ShearSprings;
use crate::config::PairConfig;

/// Most memory columns that a composition may have: the size of the pass's local array.
pub const MAX_MEMORY: usize = 48;

/// A normal, a tangential and a rolling law, evaluated in this order; their memory columns follow one
/// another in the same order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Composition<N, T, R> {
    normal: N,
    tangential: T,
    rolling: R,
}

/// No tangential force.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoTangential;

/// No rolling or twisting moment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoRolling;

macro_rules! without_resistance {
    ($law:ident, $role:ident, $evaluate:ident $(, $early:ty)?) => {
        impl $role for $law {
            const MEMORY: usize = 0;
            fn columns(&self) -> Vec<Column> {
                Vec::new()
            }
            fn prepare(&mut self, _time_step: f64) {}
            #[inline(always)]
            fn $evaluate<L: Lane>(
                &self,
                _: &Touch<L>,
                _: &NormalResponse<L>,
                $(_: $early,)?
                _: &mut [L],
            ) -> VectorResponse<L> {
                VectorResponse { value: [L::splat(0.0); 3], energies: Energies::zero() }
            }
        }
    };
}
without_resistance!(NoTangential, TangentialLaw, complete, &[L]);
without_resistance!(NoRolling, RollingLaw, evaluate);

impl<N: NormalLaw, T: TangentialLaw, R: RollingLaw> ContactLaw for Composition<N, T, R> {
    const MEMORY: usize = {
        let memory = N::MEMORY + T::MEMORY + R::MEMORY;
        assert!(memory <= MAX_MEMORY, "a composition of contact laws has more memory columns than the pass holds");
        memory
    };
    const NORMAL_MEMORY: usize = N::MEMORY;
    const TANGENTIAL: bool = T::MEMORY > 0;
    const ROLLING: bool = R::MEMORY > 0;
    const LASTS: bool = N::LASTS;
    const EARLY: usize = {
        assert!(T::EARLY <= MAX_EARLY, "a tangential law hands on more numbers than the pass holds");
        T::EARLY
    };

    fn range(&self) -> f64 {
        self.normal.range()
    }

    fn columns(&self) -> Vec<Column> {
        [self.normal.columns(), self.tangential.columns(), self.rolling.columns()].concat()
    }

    fn prepare(&mut self, time_step: f64) {
        self.normal.prepare(time_step);
        self.tangential.prepare(time_step);
        self.rolling.prepare(time_step);
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
        self.tangential.early(touch, normal, &memory[..T::MEMORY], early);
    }

    #[inline(always)]
    fn complete<L: Lane>(
        &self,
        touch: &Touch<L>,
        normal: &NormalResponse<L>,
        early: &[L],
        memory: &mut [L],
    ) -> ContactResponse<L> {
        let (tangential_memory, rolling_memory) = memory.split_at_mut(T::MEMORY);
        let mut tangential = self.tangential.complete(touch, normal, early, tangential_memory);
        let mut rolling = self.rolling.evaluate(touch, normal, rolling_memory);
        // Written so that NaN counts as joined and is found.
        let joined = L::splat(0.0).not_at_least(normal.contact_radius);
        if N::LASTS {
            // Friction ends with the contact circle, though the normal law's memory goes on.
            tangential = tangential.only(joined);
            rolling = rolling.only(joined);
            for value in tangential_memory.iter_mut().chain(rolling_memory) {
                *value = L::select(joined, *value, L::splat(0.0));
            }
        }
        ContactResponse {
            joined,
            normal_force: normal.force,
            tangential_force: tangential.value,
            moment: rolling.value,
            stiffness: normal.stiffness,
            energies: normal.energies.plus(tangential.energies).plus(rolling.energies),
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

struct FromNormal<'a, V> {
    pair: &'a PairConfig,
    visitor: V,
}

impl<V: LawVisitor> NormalVisitor for FromNormal<'_, V> {
    type Output = V::Output;
    fn visit<N: NormalLaw, const SPRINGS: usize>(self, normal: N, shear: ShearSprings<SPRINGS>) -> V::Output {
        let next = FromTangential { pair: self.pair, normal, visitor: self.visitor };
        match &self.pair.tangential {
            None => next.visit(NoTangential),
            Some(choice) => build_tangential(self.pair, choice, &shear, next),
        }
    }
}

struct FromTangential<'a, N, V> {
    pair: &'a PairConfig,
    normal: N,
    visitor: V,
}

impl<N: NormalLaw, V: LawVisitor> TangentialVisitor for FromTangential<'_, N, V> {
    type Output = V::Output;
    fn visit<T: TangentialLaw>(self, tangential: T) -> V::Output {
        let next = FromRolling { normal: self.normal, tangential, visitor: self.visitor };
        match &self.pair.rolling {
            None => next.visit(NoRolling),
            Some(choice) => build_rolling(self.pair, choice, next),
        }
    }
}

struct FromRolling<N, T, V> {
    normal: N,
    tangential: T,
    visitor: V,
}

impl<N: NormalLaw, T: TangentialLaw, V: LawVisitor> RollingVisitor for FromRolling<N, T, V> {
    type Output = V::Output;
    fn visit<R: RollingLaw>(self, rolling: R) -> V::Output {
        self.visitor.visit(Composition { normal: self.normal, tangential: self.tangential, rolling })
    }
}

#[cfg(test)]
mod tests;
