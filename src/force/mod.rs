//! Contact laws: pure functions of one touch and that contact's own memory, and the loop around them.

pub mod becker_kamlah;
pub mod cautions;
pub mod composition;
pub mod dashpot;
mod documentation;
pub mod ellipsoid;
pub mod geometry;
pub mod hertz;
pub mod lane;
pub mod law;
pub mod maxwell_zener;
pub mod mindlin;
pub mod observe;
pub mod pass;
pub mod plastic;
pub mod registry;
pub mod rolling;
pub mod shear;
pub mod simd;
pub mod slider;
pub mod stability;
#[cfg(test)]
mod testing;
pub mod thornton;
pub mod thornton_ning;
pub mod touches;
