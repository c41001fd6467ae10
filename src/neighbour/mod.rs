//! Which pairs can touch before the next rebuild: linked cells and the Verlet list; and the order of particles in memory.
//! Knows positions and radii only.

pub mod cells;
pub mod tiles;
pub mod verlet;
