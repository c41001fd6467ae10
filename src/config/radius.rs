//! Moments and limits of radius distributions, for checks and for the pre-run sheet.

use super::RadiusDistribution;
use std::f64::consts::PI;

impl RadiusDistribution {
    /// Smallest radius \[m\].
    #[must_use]
    pub fn min(&self) -> f64 {
        match self {
            Self::Fixed(radius) => *radius,
            Self::Normal { min, .. } | Self::Lognormal { min, .. } => *min,
            Self::Tabulated { radius, weight } => drawn(radius, weight).fold(f64::INFINITY, |a, (r, _)| a.min(r)),
        }
    }

    /// Largest radius \[m\].
    #[must_use]
    pub fn max(&self) -> f64 {
        match self {
            Self::Fixed(radius) => *radius,
            Self::Normal { max, .. } | Self::Lognormal { max, .. } => *max,
            Self::Tabulated { radius, weight } => drawn(radius, weight).fold(0.0, |a: f64, (r, _)| a.max(r)),
        }
    }

    /// Expected radius \[m\].
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.expectation(|radius| radius)
    }

    /// Expected volume of a sphere \[m³\].
    #[must_use]
    pub fn mean_volume(&self) -> f64 {
        self.expectation(|radius| 4.0 / 3.0 * PI * radius * radius * radius)
    }

    /// Expectation of `f(R)`; continuous distributions by the midpoint rule over the cut range, as far as it matters.
    fn expectation(&self, f: impl Fn(f64) -> f64) -> f64 {
        match self {
            Self::Fixed(radius) => f(*radius),
            Self::Tabulated { radius, weight } => weighted(drawn(radius, weight), f),
            Self::Normal { mean, deviation, min, max } => {
                let density = |r: f64| bell((r - mean) / deviation);
                let (low, high) = (min.max(mean - TAIL * deviation), max.min(mean + TAIL * deviation));
                weighted(midpoints(low, high).map(|r| (r, density(r))), f)
            }
            Self::Lognormal { median, sigma, min, max } => {
                let deviations = |radius: f64| libm::log(radius / median) / sigma;
                // Large radii are rare, but weigh by their volume: that shifts the middle by 3σ.
                let (low, high) = (deviations(*min).max(-TAIL), deviations(*max).min(TAIL + 3.0 * sigma));
                let radius = |deviations: f64| median * libm::exp(sigma * deviations);
                if radius(high) > WIDE * radius(low) {
                    return weighted(midpoints(low, high).map(|u| (radius(u), bell(u))), f);
                }
                let density = |r: f64| bell(deviations(r)) / r;
                let (low, high) = (min.max(radius(low)), max.min(radius(high)));
                weighted(midpoints(low, high).map(|r| (r, density(r))), f)
            }
        }
    }
}

/// So many deviations from the middle nothing is left of a normal distribution.
const TAIL: f64 = 8.0;
/// Where the largest radius exceeds the smallest so often, steps of equal ratio take the place of equal steps, which would
/// pass over the small radii.
const WIDE: f64 = 30.0;

fn bell(x: f64) -> f64 {
    libm::exp(-0.5 * x * x)
}

fn midpoints(min: f64, max: f64) -> impl Iterator<Item = f64> {
    (0..1000).map(move |k| min + (max - min) * (f64::from(k) + 0.5) / 1000.0)
}

fn drawn<'a>(radius: &'a [f64], weight: &'a [f64]) -> impl Iterator<Item = (f64, f64)> + 'a {
    radius.iter().copied().zip(weight.iter().copied()).filter(|(_, w)| *w > 0.0)
}

fn weighted(pairs: impl Iterator<Item = (f64, f64)>, f: impl Fn(f64) -> f64) -> f64 {
    let (sum, weights) = pairs.fold((0.0, 0.0), |(sum, weights), (r, w)| (sum + w * f(r), weights + w));
    sum / weights
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wide_cut_gives_the_moments_of_the_whole_distribution() {
        let lognormal = RadiusDistribution::Lognormal { median: 2.0, sigma: 0.2, min: 0.5, max: 8.0 };
        assert!((lognormal.mean() / (2.0 * libm::exp(0.02)) - 1.0).abs() < 1e-4);
        let volume = 4.0 / 3.0 * PI * 8.0 * libm::exp(4.5 * 0.04);
        assert!((lognormal.mean_volume() / volume - 1.0).abs() < 1e-4);
        let normal = RadiusDistribution::Normal { mean: 3.0, deviation: 0.3, min: 1.5, max: 4.5 };
        assert!((normal.mean() / 3.0 - 1.0).abs() < 1e-6);
    }

    #[test]
    fn moments_of_narrow_and_of_very_wide_distributions_are_numbers() {
        let narrow = RadiusDistribution::Normal { mean: 3.0, deviation: 1e-6, min: 1e-3, max: 1e3 };
        assert!((narrow.mean() / 3.0 - 1.0).abs() < 1e-6);
        let narrow = RadiusDistribution::Lognormal { median: 3.0, sigma: 1e-6, min: 1e-3, max: 1e3 };
        assert!((narrow.mean() / 3.0 - 1.0).abs() < 1e-6);
        for sigma in [2.0, 3.0] {
            let wide = RadiusDistribution::Lognormal { median: 2.0, sigma, min: 1e-40, max: 1e40 };
            assert!((wide.mean() / (2.0 * libm::exp(0.5 * sigma * sigma)) - 1.0).abs() < 1e-6, "{}", wide.mean());
            let volume = 4.0 / 3.0 * PI * 8.0 * libm::exp(4.5 * sigma * sigma);
            assert!((wide.mean_volume() / volume - 1.0).abs() < 1e-6);
        }
    }
}
