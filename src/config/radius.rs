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

    /// Expectation of `f(R)`; continuous distributions by the midpoint rule over the cut range.
    fn expectation(&self, f: impl Fn(f64) -> f64) -> f64 {
        match self {
            Self::Fixed(radius) => f(*radius),
            Self::Tabulated { radius, weight } => weighted(drawn(radius, weight), f),
            Self::Normal { mean, deviation, min, max } => {
                let density = |r: f64| bell((r - mean) / deviation);
                weighted(midpoints(*min, *max).map(|r| (r, density(r))), f)
            }
            Self::Lognormal { median, sigma, min, max } => {
                let density = |r: f64| bell(libm::log(r / median) / sigma) / r;
                weighted(midpoints(*min, *max).map(|r| (r, density(r))), f)
            }
        }
    }
}

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
}
