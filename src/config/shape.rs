//! The shape of a species: how its semi-axes follow from the radius.

use super::section::Section;
use super::{RadiusDistribution, Species};

/// Semi-axes of the particles of a species. The radius is that of the sphere of equal volume,
/// `R = (a b c)^(1/3)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ShapeConfig {
    /// All equal to the radius.
    Sphere,
    /// These \[m\].
    SemiAxes([f64; 3]),
    /// `a = R (b/a · c/a)^(−1/3)`, each ratio uniform between two bounds.
    AspectRatios {
        /// Smallest and largest b/a.
        b_to_a: [f64; 2],
        /// Smallest and largest c/a.
        c_to_a: [f64; 2],
    },
}

impl ShapeConfig {
    /// Semi-axes \[m\] of a particle with this radius \[m\]; `uniform` gives numbers in [0, 1).
    pub fn semi_axes(&self, radius: f64, mut uniform: impl FnMut() -> f64) -> [f64; 3] {
        match *self {
            Self::Sphere => [radius; 3],
            Self::SemiAxes(semi_axes) => semi_axes,
            Self::AspectRatios { b_to_a, c_to_a } => {
                let [b, c] = [b_to_a, c_to_a].map(|[low, high]| low + (high - low) * uniform());
                with_ratios(radius, b, c)
            }
        }
    }
}

fn with_ratios(radius: f64, b_to_a: f64, c_to_a: f64) -> [f64; 3] {
    let a = radius / libm::cbrt(b_to_a * c_to_a);
    [a, b_to_a * a, c_to_a * a]
}

impl Species {
    /// The largest semi-axis that a particle of the species can have \[m\].
    #[must_use]
    pub fn largest_semi_axis(&self) -> f64 {
        self.extremes(self.radius.max()).fold(0.0, f64::max)
    }

    /// The smallest semi-axis that a particle of the species can have \[m\].
    #[must_use]
    pub fn smallest_semi_axis(&self) -> f64 {
        self.extremes(self.radius.min()).fold(f64::INFINITY, f64::min)
    }

    /// The semi-axes of particles with this radius whose ratios are at their bounds: each is monotonic in each ratio.
    fn extremes(&self, radius: f64) -> impl Iterator<Item = f64> {
        let all = match self.shape {
            ShapeConfig::Sphere => vec![[radius; 3]],
            ShapeConfig::SemiAxes(semi_axes) => vec![semi_axes],
            ShapeConfig::AspectRatios { b_to_a, c_to_a } => {
                b_to_a.into_iter().flat_map(|b| c_to_a.map(|c| with_ratios(radius, b, c))).collect()
            }
        };
        all.into_iter().flatten()
    }

    /// Whether its particles are spheres.
    #[must_use]
    pub fn is_spherical(&self) -> bool {
        self.shape == ShapeConfig::Sphere
    }
}

/// Read what replaces or completes the radius: `semi_axes`, `aspect_ratios`.
pub(super) fn read(section: &Section, radius: Option<RadiusDistribution>) -> Option<(RadiusDistribution, ShapeConfig)> {
    if section.given("semi_axes") {
        for key in ["radius", "aspect_ratios"].into_iter().filter(|key| section.given(key)) {
            section.problem(key, "given together with `semi_axes`, which settle it", "remove one of the two");
        }
        let semi_axes = section.axes("semi_axes")?;
        let [a, b, c] = semi_axes;
        return Some((RadiusDistribution::Fixed(libm::cbrt(a * b * c)), ShapeConfig::SemiAxes(semi_axes)));
    }
    if !section.given("radius") {
        let allowed = section.spec("radius").kind.allowed();
        section.problem("radius", "missing", format!("add `radius` ({allowed}) or, for ellipsoids, `semi_axes`"));
    }
    if !section.given("aspect_ratios") {
        return Some((radius?, ShapeConfig::Sphere));
    }
    let ratios = section.table("aspect_ratios")?;
    let (b_to_a, c_to_a) = (bounds(&ratios, "b_to_a"), bounds(&ratios, "c_to_a"));
    Some((radius?, ShapeConfig::AspectRatios { b_to_a: b_to_a?, c_to_a: c_to_a? }))
}

fn bounds(section: &Section, key: &str) -> Option<[f64; 2]> {
    match section.numbers(key)?[..] {
        [one] => Some([one, one]),
        [low, high] if low <= high => Some([low, high]),
        ref other => {
            let remedy = "give one ratio, or the smallest and the largest one, for example [0.5, 0.8]";
            section.problem(key, format!("{other:?} is no range"), remedy);
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_keep_the_volume() {
        let shape = ShapeConfig::AspectRatios { b_to_a: [0.8, 0.8], c_to_a: [0.5, 0.7] };
        let [a, b, c] = shape.semi_axes(3.0, || 0.5);
        assert!((a * b * c - 27.0).abs() < 1e-12 && (b / a - 0.8).abs() < 1e-15 && (c / a - 0.6).abs() < 1e-15);
    }
}
