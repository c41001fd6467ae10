//! Contact laws: pure functions of one touch and that contact's own memory, and the loop around them.

pub mod lane;
pub mod law;
pub mod registry;
