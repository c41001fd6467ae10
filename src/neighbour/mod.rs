//! Which pairs can touch before the next rebuild: linked cells and the Verlet list. Knows positions
//! and radii only.

pub mod cells;
pub mod verlet;
