//! Which instructions the passes use: asked of the processor at run time, the same bits with each.

use crate::config::SimdConfig;
use crate::error::{Error, Result};

/// Level of vector instructions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Simd {
    /// One contact at a time: the reference.
    Scalar,
    /// Four contacts at a time.
    Avx2,
    /// Eight contacts at a time.
    Avx512,
}

impl Simd {
    /// The widest level of this processor.
    #[must_use]
    pub fn best() -> Self {
        [Self::Avx512, Self::Avx2].into_iter().find(|level| level.is_available()).unwrap_or(Self::Scalar)
    }

    /// The level that the input asks for.
    ///
    /// # Errors
    /// [`Error::Input`] if this processor does not have it.
    pub fn choose(wanted: SimdConfig) -> Result<Self> {
        let level = match wanted {
            SimdConfig::Auto => return Ok(Self::best()),
            SimdConfig::Scalar => Self::Scalar,
            SimdConfig::Avx2 => Self::Avx2,
            SimdConfig::Avx512 => Self::Avx512,
        };
        if level.is_available() {
            return Ok(level);
        }
        Err(Error::Input(format!(
            "parallel.simd = \"{}\": this processor lacks these instructions; use \"auto\" or \"{}\"",
            level.name(),
            Self::best().name()
        )))
    }

    /// Whether this processor has it.
    #[must_use]
    pub fn is_available(self) -> bool {
        match self {
            Self::Scalar => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vl"),
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }

    /// Name as in the input.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }
}
