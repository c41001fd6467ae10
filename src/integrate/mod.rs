//! Motion: the ordered sum of contact forces on each particle, then the leap-frog step.

pub mod gather;
pub mod leap_frog;
pub mod time_step;
