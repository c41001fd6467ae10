//! Sum of the contact forces and torques on a particle, in order of (partner id, image shift), so
//! that every rank and thread count gives the same bits.

use crate::contact::list::ContactList;
use crate::force::observe::CONTACT_LEDGER;

/// Force \[N\] and torque \[N m\] on a particle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Load {
    /// Force.
    pub force: [f64; 3],
    /// Torque about the centre.
    pub torque: [f64; 3],
}

/// Output lines of the contact pass.
#[derive(Debug, Clone, Default)]
pub struct Lines {
    /// Numbers per line: 4, 8 or 12.
    pub stride: usize,
    /// The lines.
    pub values: Vec<f64>,
    /// Ledger lines, empty when the ledger is off.
    pub ledger: Vec<f64>,
}

impl Lines {
    /// Make room for the lines of a list; what is there is overwritten by the next pass.
    pub fn fit(&mut self, list: &ContactList, ledger: bool) {
        self.values.clear();
        self.values.resize(list.lines * self.stride, 0.0);
        self.ledger.clear();
        self.ledger.resize(if ledger { list.lines * CONTACT_LEDGER } else { 0 }, 0.0);
    }

    /// Sum over the contacts of one particle.
    #[inline(always)]
    #[must_use]
    pub fn load_on(&self, list: &ContactList, particle: usize) -> Load {
        match self.stride {
            4 => self.sum::<4>(list, particle),
            8 => self.sum::<8>(list, particle),
            _ => self.sum::<12>(list, particle),
        }
    }

    #[inline(always)]
    fn sum<const STRIDE: usize>(&self, list: &ContactList, particle: usize) -> Load {
        let mut force = [0.0; 3];
        let mut torque = [0.0; 3];
        for end in list.ends_of(particle) {
            let start = end.line() * STRIDE;
            let line = &self.values[start..start + STRIDE];
            let sign = if end.is_second() { -1.0 } else { 1.0 };
            for k in 0..3 {
                force[k] += sign * line[k];
            }
            if STRIDE >= 8 {
                let arm = if end.is_second() { line[7] } else { line[3] };
                for k in 0..3 {
                    torque[k] += arm * line[4 + k];
                }
            }
            if STRIDE >= 12 {
                for k in 0..3 {
                    torque[k] += sign * line[8 + k];
                }
            }
        }
        Load { force, torque }
    }

    /// Add what the contacts of which this particle has the lower id put into its ledger.
    #[inline(always)]
    pub fn add_ledger(&self, list: &ContactList, particle: usize, ledger: &mut [f64]) {
        // Contact entries: cell, driven, damping, viscous, friction, plastic; the particle's ledger has
        // the work of body forces between the first two.
        const TO: [usize; CONTACT_LEDGER] = [0, 2, 3, 4, 5, 6];
        for end in list.ends_of(particle).iter().filter(|end| !end.is_second()) {
            let start = end.line() * CONTACT_LEDGER;
            for (value, to) in self.ledger[start..start + CONTACT_LEDGER].iter().zip(TO) {
                ledger[to] += value;
            }
        }
    }
}
