//! The contact passes of one step over the sections of the list.

use crate::contact::list::Section;
use crate::force::geometry::CellMotion;
use crate::force::observe::{CONTACT_LEDGER, Observation, Wanted};
use crate::force::pass::{PairPass, PassInput, PassOutput};
use crate::integrate::gather::Lines;
use crate::state::particles::Particles;

/// What all passes of a step share.
pub struct ContactPhase<'a> {
    /// One pass per pair of materials.
    pub passes: &'a [Box<dyn PairPass>],
    /// Cell.
    pub motion: &'a CellMotion,
    /// Number of owned particles.
    pub owned: usize,
    /// Largest overlap over the smaller radius.
    pub max_overlap_fraction: f64,
    /// Time since the last evaluation \[s\].
    pub time_step: f64,
    /// What to observe.
    pub wanted: Option<Wanted>,
    /// Use the threads of the current pool.
    pub parallel: bool,
}

/// A contact that cannot be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassFault {
    /// Section.
    pub section: usize,
    /// Place in it.
    pub place: usize,
    /// Overlap over the smaller radius.
    pub overlap_ratio: f64,
}

/// What the passes of a step bring back.
#[derive(Debug, Default)]
pub struct Passed {
    /// Observation, if wanted.
    pub observation: Option<Observation>,
    /// First fault.
    pub fault: Option<PassFault>,
}

impl Passed {
    /// Join with what other sections brought.
    pub fn absorb(&mut self, other: Self) {
        match (&mut self.observation, other.observation) {
            (Some(mine), Some(theirs)) => mine.merge(theirs),
            (mine @ None, theirs) => *mine = theirs,
            _ => {}
        }
        self.fault = self.fault.or(other.fault);
    }
}

impl ContactPhase<'_> {
    /// Evaluate the contacts of some sections, the first of which has this number in the list.
    pub fn run(&self, particles: &Particles, sections: &mut [Section], number: usize, lines: &mut Lines) -> Passed {
        let input = PassInput {
            records: &particles.record,
            owned: self.owned,
            motion: self.motion,
            stride: lines.stride,
            max_overlap_fraction: self.max_overlap_fraction,
            time_step: self.time_step,
            wanted: self.wanted,
            parallel: self.parallel,
        };
        let mut passed = Passed::default();
        for (offset, section) in sections.iter_mut().enumerate().filter(|(_, s)| s.count > 0) {
            let (from, to) = (section.base, section.base + section.first.len());
            let ledger: &mut [f64] = if lines.ledger.is_empty() {
                &mut []
            } else {
                &mut lines.ledger[from * CONTACT_LEDGER..to * CONTACT_LEDGER]
            };
            let output = PassOutput { lines: &mut lines.values[from * lines.stride..to * lines.stride], ledger };
            let result = self.passes[section.pair].run(&input, section, output);
            let fault =
                result.fault.map(|(place, overlap_ratio)| PassFault { section: number + offset, place, overlap_ratio });
            passed.absorb(Passed { observation: result.observation, fault });
        }
        passed
    }
}
