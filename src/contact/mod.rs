//! Which contacts exist and their memory: lists, order of summation, image shifts. Knows nothing of
//! forces beyond the width of the memory.

pub mod build;
pub mod ends;
pub mod list;
pub mod section;
pub mod shift;
