//! The traits of contact laws. A law sees one touch and its own memory and writes nowhere else;
//! it must not know of lists, ranks or particles. docs/adding_a_law.md adds one step by step.
//!
//! `evaluate` is generic over [`Lane`]: no branch on a lane (choose by `L::select`), no function but those of
//! [`Lane`]. Lanes that do not touch may hold anything, for example δ < 0; what comes out is thrown away.
//!
//! Sign convention (PHYSICS.md section 1): contact (i, j), i the lower global id, normal n from i to
//! j, overlap δ > 0 in contact. The force on i is `−F_n n + F_t`, on j the opposite; the moment on i
//! beside the one of `F_t`'s arm is `+M`, on j `−M`.

use super::lane::{Lane, Vector};

/// Most numbers that a law may hand on, see [`TangentialLaw::early`].
pub const MAX_EARLY: usize = 18;

/// Geometry and relative motion of one touch, at the full step, but for velocities as [`Velocities`](crate::config::Velocities) says.
#[derive(Debug, Clone, Copy)]
pub struct Touch<L> {
    /// Overlap δ \[m\], > 0 (lanes that do not touch are blended away by the caller).
    pub overlap: L,
    /// δ̇ = −v_rel·n \[m/s\], positive while approaching.
    pub overlap_rate: L,
    /// Effective radius, 1/R_eff = 1/R_i + 1/R_j; of an elliptical contact R_e of B (3) \[m\].
    pub effective_radius: L,
    /// Factor f_1 of an elliptical contact on its equivalent contact radius, 1 for spheres; B (4).
    pub radius_factor: L,
    /// Factor f_2 of an elliptical contact on the overlap, 1 for spheres; B (4).
    pub overlap_factor: L,
    /// Sum of the mean radii of both particles (spheres: R_i + R_j; before a wall: twice the radius) \[m\].
    pub size: L,
    /// Effective mass, 1/m_eff = 1/m_i + 1/m_j \[kg\].
    pub effective_mass: L,
    /// Unit normal n from i to j.
    pub normal: Vector<L>,
    /// Tangential part of the velocity of j relative to i at the contact point \[m/s\].
    pub slip_velocity: Vector<L>,
    /// Angular velocity of j relative to i, ω_j − ω_i \[rad/s\].
    pub relative_spin: Vector<L>,
    /// Mean angular velocity about the normal, n·(ω_i + ω_j)/2 \[rad/s\].
    pub spin_about_normal: L,
}

/// Energies of one touch, for the ledger and for a look at the state (a pass that does not want them leaves them to the
/// optimiser to delete). What is held is given as it is now, what is dissipated as this step's share.
#[derive(Debug, Clone, Copy)]
pub struct Energies<L> {
    /// Energy held by springs now \[J\].
    pub elastic: L,
    /// Energy held by Maxwell branches now \[J\].
    pub viscoelastic: L,
    /// Dissipated in this step by dashpots (with the part that clipping takes out) \[J\].
    pub damping: L,
    /// Dissipated in this step by Maxwell branches \[J\].
    pub viscous: L,
    /// Dissipated in this step by sliding, rolling and twisting slip \[J\].
    pub friction: L,
    /// Dissipated in this step by plastic deformation \[J\].
    pub plastic: L,
}

impl<L: Lane> Energies<L> {
    /// All zero.
    #[inline(always)]
    #[must_use]
    pub fn zero() -> Self {
        let z = L::splat(0.0);
        Self { elastic: z, viscoelastic: z, damping: z, viscous: z, friction: z, plastic: z }
    }
    /// Sum, entry by entry.
    #[inline(always)]
    #[must_use]
    pub fn plus(self, o: Self) -> Self {
        Self {
            elastic: self.elastic + o.elastic,
            viscoelastic: self.viscoelastic + o.viscoelastic,
            damping: self.damping + o.damping,
            viscous: self.viscous + o.viscous,
            friction: self.friction + o.friction,
            plastic: self.plastic + o.plastic,
        }
    }
}

/// What a normal law returns. The tangential and the rolling law get force, contact radius and dashpot; the rest is NaN or
/// without meaning to them.
#[derive(Debug, Clone, Copy)]
pub struct NormalResponse<L> {
    /// Normal force F_n \[N\], compression positive, after clipping.
    pub force: L,
    /// Radius a of the contact circle \[m\].
    pub contact_radius: L,
    /// Tangent stiffness ∂F/∂δ at spontaneous response \[N/m\] (time step).
    pub stiffness: L,
    /// Dashpot coefficient c of c·δ̇ \[N s/m\] (for a tangential dashpot of the same kind).
    pub dashpot: L,
    /// Energies of the normal part.
    pub energies: Energies<L>,
}

impl<L: Lane> NormalResponse<L> {
    /// The bodies press or pull on each other: false over a dent that is no longer reached.
    #[inline(always)]
    #[must_use]
    pub fn joined(&self) -> L::Mask {
        // Written so that NaN counts as joined and is found.
        L::splat(0.0).not_at_least(self.contact_radius)
    }
}

/// What a tangential or rolling law returns.
#[derive(Debug, Clone, Copy)]
pub struct VectorResponse<L> {
    /// Tangential: force F_t on i \[N\]. Rolling and twisting: moment M on i \[N m\].
    pub value: Vector<L>,
    /// Energies of this part.
    pub energies: Energies<L>,
}

impl<L: Lane> VectorResponse<L> {
    /// This response where `mask` holds, nothing elsewhere.
    #[inline(always)]
    #[must_use]
    pub fn only(self, mask: L::Mask) -> Self {
        let kept = |value: L| value.only(mask);
        let e = self.energies;
        Self {
            value: self.value.map(kept),
            energies: Energies {
                elastic: kept(e.elastic),
                viscoelastic: kept(e.viscoelastic),
                damping: kept(e.damping),
                viscous: kept(e.viscous),
                friction: kept(e.friction),
                plastic: kept(e.plastic),
            },
        }
    }
}

/// One memory column of a law.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Name, for example `overlap` or `tangential_force_x`.
    pub name: String,
    /// SI unit, for example `m`.
    pub unit: &'static str,
}

/// A normal force law. Its module also holds `ENTRY` and `build` for [`super::registry`].
pub trait NormalLaw: Copy + Send + Sync + 'static {
    /// Number of memory columns.
    const MEMORY: usize;
    /// The memory outlives the touch (a dent), or the law acts beyond it (an adhesive neck): `evaluate` then sees
    /// overlaps down to `−range · R_eff`, and must return force and contact radius 0 where the bodies are apart.
    const LASTS: bool = false;
    /// Names and units of the memory columns, `MEMORY` of them.
    fn columns(&self) -> Vec<Column>;
    /// Gap over R_eff up to which the memory lasts, for a law that [`Self::LASTS`]; beyond it ends.
    fn range(&self) -> f64 {
        0.0
    }
    /// Recompute what depends on the time step \[s\]; called before the first touch and whenever it changes.
    fn prepare(&mut self, time_step: f64);
    /// After `prepare`: the relaxed limit of a law that depends on rate, for the quasi-static routine, where time has no
    /// meaning and every process is infinitely slow. A rate-independent law has nothing to do.
    fn relax(&mut self) {}
    /// Force of one touch; `memory` has `MEMORY` entries, all zero at first touch.
    fn evaluate<L: Lane>(&self, touch: &Touch<L>, memory: &mut [L]) -> NormalResponse<L>;
}

/// A tangential force law.
pub trait TangentialLaw: Copy + Send + Sync + 'static {
    /// Number of memory columns.
    const MEMORY: usize;
    /// Names and units of the memory columns.
    fn columns(&self) -> Vec<Column>;
    /// Recompute what depends on the time step \[s\].
    fn prepare(&mut self, time_step: f64);
    /// The relaxed limit, see [`NormalLaw::relax`].
    fn relax(&mut self) {}
    /// Numbers that [`Self::early`] hands on.
    const EARLY: usize = 0;
    /// The first part of the evaluation, which the pass runs over several blocks before the rest, if the law has any: a
    /// long chain of operations is then under way for several contacts at a time. Fills the `EARLY` numbers.
    fn early<L: Lane>(&self, _touch: &Touch<L>, _normal: &NormalResponse<L>, _memory: &[L], _early: &mut [L]) {}
    /// Force of one touch; `early` are the numbers of [`Self::early`].
    fn complete<L: Lane>(
        &self,
        touch: &Touch<L>,
        normal: &NormalResponse<L>,
        early: &[L],
        memory: &mut [L],
    ) -> VectorResponse<L>;
    /// Both parts.
    #[inline(always)]
    fn evaluate<L: Lane>(&self, touch: &Touch<L>, normal: &NormalResponse<L>, memory: &mut [L]) -> VectorResponse<L> {
        let mut early = [L::splat(0.0); MAX_EARLY];
        self.early(touch, normal, memory, &mut early[..Self::EARLY]);
        self.complete(touch, normal, &early[..Self::EARLY], memory)
    }
}

/// A rolling and twisting resistance law.
pub trait RollingLaw: Copy + Send + Sync + 'static {
    /// Number of memory columns.
    const MEMORY: usize;
    /// Names and units of the memory columns.
    fn columns(&self) -> Vec<Column>;
    /// Recompute what depends on the time step \[s\].
    fn prepare(&mut self, time_step: f64);
    /// Moment of one touch.
    fn evaluate<L: Lane>(&self, touch: &Touch<L>, normal: &NormalResponse<L>, memory: &mut [L]) -> VectorResponse<L>;
}

/// What the normal and the tangential law of a contact return together.
#[derive(Debug, Clone, Copy)]
pub struct ContactResponse<L: Lane> {
    /// See [`NormalResponse::joined`].
    pub joined: L::Mask,
    /// Normal force F_n \[N\], compression positive.
    pub normal_force: L,
    /// Tangential force on i \[N\].
    pub tangential_force: Vector<L>,
    /// Tangent stiffness \[N/m\].
    pub stiffness: L,
    /// Sum of the parts' energies.
    pub energies: Energies<L>,
}

/// Normal and tangential law of a pair of materials, as the pass sees them. Implemented once, by
/// [`super::composition::Composition`].
pub trait ContactLaw: Copy + Send + Sync + 'static {
    /// Number of memory columns.
    const MEMORY: usize;
    /// How many of them, from the first on, are the normal law's.
    const NORMAL_MEMORY: usize;
    /// Has a tangential force (torques from the arm, spins needed).
    const TANGENTIAL: bool;
    /// See [`NormalLaw::LASTS`].
    const LASTS: bool;
    /// See [`TangentialLaw::EARLY`].
    const EARLY: usize;
    /// See [`NormalLaw::range`].
    fn range(&self) -> f64;
    /// Names and units of the memory columns.
    fn columns(&self) -> Vec<Column>;
    /// Recompute what depends on the time step \[s\].
    fn prepare(&mut self, time_step: f64);
    /// The relaxed limit, see [`NormalLaw::relax`].
    fn relax(&mut self) {}
    /// The normal law's part; `memory` has `NORMAL_MEMORY` entries.
    fn normal<L: Lane>(&self, touch: &Touch<L>, memory: &mut [L]) -> NormalResponse<L>;
    /// See [`TangentialLaw::early`]; `memory` has the remaining entries.
    fn early<L: Lane>(&self, touch: &Touch<L>, normal: &NormalResponse<L>, memory: &[L], early: &mut [L]);
    /// The rest of the tangential law and the whole response; `memory` has the remaining entries.
    fn complete<L: Lane>(
        &self,
        touch: &Touch<L>,
        normal: &NormalResponse<L>,
        early: &[L],
        memory: &mut [L],
    ) -> ContactResponse<L>;
    /// Both laws for one touch; `memory` has `MEMORY` entries.
    #[inline(always)]
    fn evaluate<L: Lane>(&self, touch: &Touch<L>, memory: &mut [L]) -> ContactResponse<L> {
        let (own, rest) = memory.split_at_mut(Self::NORMAL_MEMORY);
        let normal = self.normal(touch, own);
        let mut early = [L::splat(0.0); MAX_EARLY];
        self.early(touch, &normal, rest, &mut early[..Self::EARLY]);
        self.complete(touch, &normal, &early[..Self::EARLY], rest)
    }
}

/// Runs the monomorphised loop for a law chosen at run time: the registry calls `visit` once with the
/// concrete composition.
pub trait LawVisitor {
    /// What the visitor makes of the law.
    type Output;
    /// Called with the concrete composition.
    fn visit<C: ContactLaw>(self, law: C) -> Self::Output;
}
