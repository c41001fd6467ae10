//! What an observing contact pass collects: exact sums for stress and energies, maxima, samples of
//! single contacts. Sums are exact, so that no order of ranks, threads or lists shows in them.

use super::lane::{dot, scale};
use super::law::Energies;
use super::touches::BlockTouches;
use crate::contact::section::BLOCK;
use crate::exchange::exact_sum::ExactSum;

/// Names the places in [`Observation::sums`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(usize)]
pub enum Sum {
    /// Σ F⊗d, six components from here: xx, yy, zz, xy, xz, yz \[N m\].
    Virial = 0,
    /// Σ n⊗n, six components from here.
    Fabric = 6,
    /// Σ |F| over contacts \[N\].
    ForceMagnitude = 12,
    /// Energy in springs \[J\].
    Elastic = 13,
    /// Energy in Maxwell branches \[J\].
    Viscoelastic = 14,
    /// Number of touching contacts between particles.
    Contacts = 15,
    /// Number of touching contacts with walls.
    WallContacts = 16,
    /// Normal force on each of the six walls \[N\], from here.
    WallForce = 17,
    /// The contacts' shares of the ledger in the step that led here, in the order of [`CONTACT_LEDGER`] \[J\]; zero
    /// without a ledger. The particles' ledgers get them when the next step evaluates the contacts.
    LastStep = 23,
}

/// Number of exact sums.
pub const SUMS: usize = 23 + CONTACT_LEDGER.len();

/// Entries of a particle's ledger ([`crate::state::LEDGER`]) into which its contacts write, in their order: work of the
/// cell, work of driven partners and walls, damping, viscous, friction, plastic \[J\].
pub const CONTACT_LEDGER: [usize; 6] = [0, 2, 3, 4, 5, 6];

/// One touching contact as observed.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// Output line.
    pub line: usize,
    /// Branch vector d from first to second \[m\].
    pub branch: [f64; 3],
    /// Unit normal.
    pub normal: [f64; 3],
    /// Overlap δ \[m\].
    pub overlap: f64,
    /// Overlap over the smaller radius.
    pub overlap_ratio: f64,
    /// Force on the second \[N\].
    pub force: [f64; 3],
    /// Normal force \[N\].
    pub normal_force: f64,
    /// `−r·F` of both bodies, r from the centre to the contact point, F the force on the body \[N m\] (between spheres
    /// its normal part).
    pub virials: [f64; 2],
    /// Counted here: the lower id is owned by this rank.
    pub counted: bool,
    /// The second is this wall.
    pub wall: Option<usize>,
}

/// What to collect.
#[derive(Debug, Clone, Copy, Default)]
pub struct Wanted {
    /// Exact sums.
    pub sums: bool,
    /// Every touching contact.
    pub samples: bool,
}

/// Collected by one pass over some contacts.
#[derive(Debug, Clone, Default)]
pub struct Observation {
    /// See [`Sum`]; empty unless wanted.
    pub sums: Vec<ExactSum>,
    /// Largest tangent stiffness \[N/m\].
    pub max_stiffness: f64,
    /// Largest overlap over smaller radius.
    pub max_overlap_ratio: f64,
    /// Touching contacts; empty unless wanted.
    pub samples: Vec<Sample>,
}

impl Observation {
    /// Ready to collect.
    #[must_use]
    pub fn new(wanted: Wanted) -> Self {
        Self { sums: if wanted.sums { vec![ExactSum::new(); SUMS] } else { Vec::new() }, ..Self::default() }
    }

    /// Take in maxima.
    fn raise(&mut self, stiffness: f64, overlap_ratio: f64) {
        self.max_stiffness = self.max_stiffness.max(stiffness);
        self.max_overlap_ratio = self.max_overlap_ratio.max(overlap_ratio);
    }

    fn add_to_sums(&mut self, sample: &Sample, energies: &Energies<f64>) {
        let (f, d, n) = (sample.force, sample.branch, sample.normal);
        let symmetric = |a: [f64; 3], b: [f64; 3]| {
            [
                a[0] * b[0],
                a[1] * b[1],
                a[2] * b[2],
                0.5 * (a[0] * b[1] + a[1] * b[0]),
                0.5 * (a[0] * b[2] + a[2] * b[0]),
                0.5 * (a[1] * b[2] + a[2] * b[1]),
            ]
        };
        for (k, value) in symmetric(f, d).into_iter().enumerate() {
            self.sums[Sum::Virial as usize + k].add(value);
        }
        self.sums[Sum::Elastic as usize].add(energies.elastic);
        self.sums[Sum::Viscoelastic as usize].add(energies.viscoelastic);
        self.sums[Sum::ForceMagnitude as usize].add((f[0] * f[0] + f[1] * f[1] + f[2] * f[2]).sqrt());
        if let Some(wall) = sample.wall {
            self.sums[Sum::WallContacts as usize].add(1.0);
            self.sums[Sum::WallForce as usize + wall].add(sample.normal_force);
            return;
        }
        self.sums[Sum::Contacts as usize].add(1.0);
        for (k, value) in symmetric(n, n).into_iter().enumerate() {
            self.sums[Sum::Fabric as usize + k].add(value);
        }
    }

    /// Join what two passes collected.
    pub fn merge(&mut self, mut other: Self) {
        if self.sums.is_empty() {
            self.sums = other.sums;
        } else {
            for (sum, more) in self.sums.iter_mut().zip(&other.sums) {
                sum.merge(more);
            }
        }
        self.raise(other.max_stiffness, other.max_overlap_ratio);
        self.samples.append(&mut other.samples);
    }
}

/// Where an observing pass is and what it collects.
#[derive(Debug)]
pub struct Observed<'a> {
    /// What to collect.
    pub wanted: Wanted,
    /// Only samples whose overlap exceeds this share of the smaller radius.
    pub beyond: Option<f64>,
    /// Number of owned particles.
    pub owned: usize,
    /// Number of the present contact's output line.
    pub line: usize,
    /// Collected so far.
    pub observation: Observation,
    /// Per line, from number `first_line` on, the force on the first \[N\] and 1 if the contact touches, else 0;
    /// may be empty.
    pub forces: &'a mut [[f64; 4]],
    /// Number of the first of `forces`.
    pub first_line: usize,
}

impl Observed<'_> {
    /// Single contacts are wanted, not only maxima over them.
    #[must_use]
    pub fn single(&self) -> bool {
        self.wanted.sums || self.wanted.samples || !self.forces.is_empty()
    }

    /// Take in no more than the maxima of some blocks after the normal law.
    pub fn take_maxima(&mut self, touches: &[BlockTouches]) {
        let (mut stiffness, mut ratio) = ([0.0; BLOCK], [0.0; BLOCK]);
        for touches in touches {
            touches.raise(&mut stiffness, &mut ratio);
        }
        for lane in 0..BLOCK {
            self.observation.raise(stiffness[lane], ratio[lane]);
        }
    }

    /// Take in what the present contact puts into the ledger in this step.
    pub fn take_last_step(&mut self, first: usize, entries: [f64; CONTACT_LEDGER.len()]) {
        if self.wanted.sums && first < self.owned {
            for (k, entry) in entries.into_iter().enumerate() {
                self.observation.sums[Sum::LastStep as usize + k].add(entry);
            }
        }
    }

    /// Take in the present contact, in this lane of a block; `first` is the local index of its first particle.
    /// `ellipsoids`: there are some; `lasts`: the normal law's memory outlives the contact.
    pub fn take(
        &mut self,
        touches: &BlockTouches,
        lane: usize,
        first: usize,
        wall: Option<u32>,
        (ellipsoids, lasts): (bool, bool),
    ) {
        let response = touches.response::<f64>(lane);
        if !touches.alive::<f64>(lane) || lasts && !response.joined {
            if let Some(force) = self.forces.get_mut(self.line - self.first_line) {
                *force = [0.0; 4];
            }
            return;
        }
        self.observation.raise(response.stiffness, touches.overlap_ratio(lane));
        let touch = touches.touch::<f64, true>(lane);
        let force = touches.force_on_first(lane);
        if let Some(place) = self.forces.get_mut(self.line - self.first_line) {
            *place = [force[0], force[1], force[2], 1.0];
        }
        let virials = if ellipsoids {
            let [one, other] = touches.arm_vectors(lane);
            [-dot(one, force), dot(other, force)]
        } else {
            touches.arms::<f64>(lane, false).map(|arm| arm * response.normal_force)
        };
        let sample = Sample {
            line: self.line,
            branch: touches.branch(lane),
            normal: touch.normal,
            overlap: touch.overlap,
            overlap_ratio: touches.overlap_ratio(lane),
            force: scale(force, -1.0),
            normal_force: response.normal_force,
            virials,
            counted: first < self.owned,
            wall: wall.map(|wall| wall as usize),
        };
        if self.wanted.sums && sample.counted {
            self.observation.add_to_sums(&sample, &response.energies);
        }
        let within = self.beyond.is_some_and(|limit| sample.overlap_ratio <= limit);
        if self.wanted.samples && !within {
            self.observation.samples.push(sample);
        }
    }
}
