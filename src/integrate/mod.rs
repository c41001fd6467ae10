//! Motion: the ordered sum of contact forces on each particle, then the leap-frog step and, of ellipsoids,
//! the rotation.

pub mod displacement;
pub mod gather;
pub mod leap_frog;
pub mod rotation;
pub mod time_step;
mod wrapping;
