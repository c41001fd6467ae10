//! Wall time per stage of the step.

use std::time::{Duration, Instant};

/// A stage whose time is shown at the end of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(usize)]
pub enum Stage {
    /// Verlet list, contact list, migration.
    Neighbours,
    /// Contacts whose forces are kept: across periodic faces, strips and ranks, and with walls.
    Contacts,
    /// The other contacts with sum and motion, chunk by chunk.
    Step,
    /// Looks at the state: time step, load, reports.
    Observe,
    /// Halo exchange (waiting and packing).
    Halo,
    /// Agreement and global sums.
    Reduce,
    /// History, snapshots, checkpoints.
    Output,
}

/// Stages in the order of the table.
pub const STAGES: [(Stage, &str); 7] = [
    (Stage::Neighbours, "neighbours"),
    (Stage::Contacts, "border contacts"),
    (Stage::Step, "contacts, motion"),
    (Stage::Observe, "observation"),
    (Stage::Halo, "halo"),
    (Stage::Reduce, "reduce"),
    (Stage::Output, "output"),
];

/// A stop watch with one hand per stage.
#[derive(Debug, Clone, Default)]
pub struct Timers {
    spent: [Duration; STAGES.len()],
    running: Option<(Stage, Instant)>,
    /// Rebuilds of the Verlet list.
    pub verlet_rebuilds: u64,
    /// Rebuilds of the contact list alone.
    pub contact_rebuilds: u64,
}

impl Timers {
    /// Give the time since the last call to the stage that ran, and start this one.
    pub fn start(&mut self, stage: Stage) {
        let now = Instant::now();
        self.book(now);
        self.running = Some((stage, now));
    }

    /// Stop the running stage.
    pub fn stop(&mut self) {
        self.book(Instant::now());
        self.running = None;
    }

    fn book(&mut self, now: Instant) {
        if let Some((stage, since)) = self.running {
            self.spent[stage as usize] += now - since;
        }
    }

    /// Seconds per stage.
    #[must_use]
    pub fn seconds(&self) -> [f64; STAGES.len()] {
        self.spent.map(|d| d.as_secs_f64())
    }
}
