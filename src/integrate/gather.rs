//! Sum of the contact forces and torques on a particle, in order of (partner id, image shift), so
//! that every rank and thread count gives the same bits.

use crate::contact::list::End;
use crate::force::observe::CONTACT_LEDGER;

/// Force \[N\] and torque \[N m\] on a particle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Load {
    /// Force.
    pub force: [f64; 3],
    /// Torque about the centre.
    pub torque: [f64; 3],
}

/// Output lines of the contact passes as the particles of one strip see them.
#[derive(Debug, Clone, Copy)]
pub struct Lines<'a> {
    /// Numbers per line that hold forces, torques and moments: 4, 8 or 12.
    pub width: usize,
    /// Numbers per line, with the ledger's.
    pub stride: usize,
    /// Lines kept for the step, from number 0 on.
    pub kept: &'a [f64],
    /// The strip's ring.
    pub ring: &'a [f64],
    /// Number of the ring's first line.
    pub first: usize,
    /// Capacity of the ring less one.
    pub mask: usize,
}

impl Lines<'_> {
    /// Numbers `offset .. offset + N` of a line.
    #[inline(always)]
    fn part<const N: usize>(&self, number: usize, offset: usize) -> &[f64; N] {
        let kept = number * self.stride < self.kept.len();
        let place = if kept { number } else { (number - self.first) & self.mask };
        let values = if kept { self.kept } else { self.ring };
        let start = place * self.stride + offset;
        values[start..start + N].try_into().expect("a slice of N numbers")
    }

    /// Sum over the contacts of one particle, given its ends.
    #[inline(always)]
    #[must_use]
    pub fn load(&self, ends: &[End]) -> Load {
        match self.width {
            4 => self.forces(ends),
            8 => self.forces_and_torques(ends),
            _ => self.with_moments(ends),
        }
    }

    #[inline(always)]
    fn forces(&self, ends: &[End]) -> Load {
        let mut sum = [0.0; 4];
        for end in ends {
            let line = self.part::<4>(end.line(), 0);
            let sign = if end.is_second() { -1.0 } else { 1.0 };
            for k in 0..4 {
                sum[k] += sign * line[k];
            }
        }
        Load { force: [sum[0], sum[1], sum[2]], torque: [0.0; 3] }
    }

    #[inline(always)]
    fn forces_and_torques(&self, ends: &[End]) -> Load {
        let mut sum = [0.0; 8];
        for end in ends {
            let line = self.part::<8>(end.line(), 0);
            let (sign, arm) = if end.is_second() { (-1.0, line[7]) } else { (1.0, line[3]) };
            let factor = [sign, sign, sign, sign, arm, arm, arm, arm];
            for k in 0..8 {
                sum[k] += factor[k] * line[k];
            }
        }
        Load { force: [sum[0], sum[1], sum[2]], torque: [sum[4], sum[5], sum[6]] }
    }

    #[inline(always)]
    fn with_moments(&self, ends: &[End]) -> Load {
        let Load { force, .. } = self.forces(ends);
        let mut torque = [0.0; 3];
        for end in ends {
            let line = self.part::<12>(end.line(), 0);
            let (sign, arm) = if end.is_second() { (-1.0, line[7]) } else { (1.0, line[3]) };
            for k in 0..3 {
                torque[k] += arm * line[4 + k];
                torque[k] += sign * line[8 + k];
            }
        }
        Load { force, torque }
    }

    /// Add what the contacts of which this particle has the lower id put into its ledger.
    #[inline(always)]
    pub fn add_ledger(&self, ends: &[End], ledger: &mut [f64]) {
        // Contact entries: cell, driven, damping, viscous, friction, plastic; the particle's ledger has
        // the work of body forces between the first two.
        const TO: [usize; CONTACT_LEDGER] = [0, 2, 3, 4, 5, 6];
        for end in ends.iter().filter(|end| !end.is_second()) {
            let entries = self.part::<CONTACT_LEDGER>(end.line(), self.width);
            for (value, to) in entries.iter().zip(TO) {
                ledger[to] += value;
            }
        }
    }
}
