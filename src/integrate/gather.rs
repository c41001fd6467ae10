//! Sum of the contact forces and torques on a particle, in order of (partner id, image shift), so
//! that every rank and thread count gives the same bits.

use crate::contact::list::End;
use crate::force::lane::Lane;
use crate::force::observe::CONTACT_LEDGER;

/// Force \[N\] and torque \[N m\] on a particle in the first three of four lanes; the fourth means nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Load<L> {
    /// Force.
    pub force: L,
    /// Torque about the centre.
    pub torque: L,
}

/// Output lines of the contact passes as the particles of one strip see them.
#[derive(Debug, Clone, Copy)]
pub struct Lines<'a> {
    /// Numbers per line that hold forces, torques and moments: 4, 8, 12, or 16 between ellipsoids.
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

    /// Sum over the contacts of one particle, given its ends, in lanes four wide.
    #[inline(always)]
    #[must_use]
    pub fn load<L: Lane>(&self, ends: &[End]) -> Load<L> {
        match self.width {
            4 => self.sum::<L, 4>(ends),
            8 => self.sum::<L, 8>(ends),
            12 => self.sum::<L, 12>(ends),
            _ => self.sum::<L, 16>(ends),
        }
    }

    #[inline(always)]
    fn sum<L: Lane, const WIDTH: usize>(&self, ends: &[End]) -> Load<L> {
        const SIGN: [f64; 2] = [1.0, -1.0];
        let (mut force, mut torque) = (L::splat(0.0), L::splat(0.0));
        for end in ends {
            let line = self.part::<WIDTH>(end.line(), 0);
            let sign = L::splat(SIGN[usize::from(end.is_second())]);
            force = force + sign * L::load(&line[..4]);
            if WIDTH == 16 {
                torque = torque + L::load(&line[4 + 4 * usize::from(end.is_second())..][..4]);
                continue;
            }
            if WIDTH >= 8 {
                let arm = line[3 + 4 * usize::from(end.is_second())];
                torque = torque + L::splat(arm) * L::load(&line[4..8]);
            }
            if WIDTH >= 12 {
                torque = torque + sign * L::load(&line[8..12]);
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
