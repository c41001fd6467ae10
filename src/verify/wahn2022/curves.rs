//! Curves from history tables, their spread over seeds, and the theory of one contact.

use crate::output::history::HistoryRow;

/// A curve; x does not decrease.
pub type Points = Vec<(f64, f64)>;

/// W Table 1 (with the errata of the configurations), PVDF: E_soft, E_1 \[Pa\], τ \[s\].
pub const PVDF: Material =
    Material { long_term: 1365.9e6, branch: 404.6e6, relaxation_time: 1.8, poisson_ratio: 0.4314 };

/// As [`PVDF`]: W's NMC; τ = η/E_1.
pub const NMC: Material =
    Material { long_term: 142e9, branch: 42e9, relaxation_time: 250.0 / 42.0, poisson_ratio: 0.25 };

/// Constants of a Maxwell–Zener material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// E_2 \[Pa\].
    pub long_term: f64,
    /// E_1 \[Pa\].
    pub branch: f64,
    /// τ = η/E_1 \[s\].
    pub relaxation_time: f64,
    /// ν.
    pub poisson_ratio: f64,
}

impl Material {
    /// Force of one contact over that of the long-term spring, after loading from zero overlap at a constant
    /// rate during `time` \[s\]: `1 + (E_1/E_2) (3/2) ∫₀¹ e^{−(1−u) time/τ} √u du`, W (3.11). 1 + E_1/E_2 for a
    /// time of zero.
    pub fn stiffening(&self, time: f64) -> f64 {
        let x = time / self.relaxation_time;
        // With u = w² the integrand is smooth: Simpson's rule on 3 w² e^{−(1−w²) x}.
        const PANELS: u32 = 4000;
        let width = 1.0 / f64::from(PANELS);
        let value = |index: u32| {
            let w = f64::from(index) * width;
            3.0 * w * w * libm::exp(-(1.0 - w * w) * x)
        };
        let inner: f64 = (1..PANELS).map(|index| if index % 2 == 1 { 4.0 } else { 2.0 } * value(index)).sum();
        1.0 + self.branch / self.long_term * (value(0) + inner + value(PANELS)) * width / 3.0
    }

    /// Hertz force of two spheres of `radius` \[m\] with the modulus `modulus` \[Pa\], W (3.1) \[N\].
    pub fn hertz(&self, modulus: f64, radius: f64, overlap: f64) -> f64 {
        let effective = modulus / (2.0 * (1.0 - self.poisson_ratio * self.poisson_ratio));
        4.0 / 3.0 * effective * (0.5 * radius * overlap).sqrt() * overlap
    }

    /// E_stiff = E_1 + E_2 \[Pa\].
    pub fn spontaneous(&self) -> f64 {
        self.long_term + self.branch
    }
}

/// A curve from the rows of a table.
pub fn curve(rows: &[HistoryRow], x: impl Fn(&HistoryRow) -> f64, y: impl Fn(&HistoryRow) -> f64) -> Points {
    rows.iter().map(|row| (x(row), y(row))).collect()
}

/// Stress σ_zz \[MPa\] over nominal strain \[%\].
pub fn stress_strain(rows: &[HistoryRow]) -> Points {
    curve(rows, |row| 100.0 * row.strain[2], |row| 1e-6 * row.stress[2])
}

/// The value at `x`, linear between points; NaN outside (a hair of rounding is inside).
pub fn sample(points: &[(f64, f64)], x: f64) -> f64 {
    let after = points.partition_point(|point| point.0 < x);
    match (after.checked_sub(1).map(|before| points[before]), points.get(after)) {
        (_, Some(&(px, py))) if px == x => py,
        (Some((x0, y0)), Some(&(x1, y1))) => y0 + (y1 - y0) * (x - x0) / (x1 - x0),
        (Some((x0, y0)), None) if x - x0 <= 1e-9 * x.abs() => y0,
        (None, Some(&(x1, y1))) if x1 - x <= 1e-9 * x1.abs() => y1,
        _ => f64::NAN,
    }
}

/// The value at `x` of a contact force: its power 2/3 is nearly linear in the overlap.
pub fn sample_force(points: &[(f64, f64)], x: f64) -> f64 {
    let after = points.partition_point(|point| point.0 < x);
    let near = &points[after.saturating_sub(1)..(after + 1).min(points.len())];
    let linear: Points = near.iter().map(|&(x, y)| (x, libm::pow(y, 2.0 / 3.0))).collect();
    libm::pow(sample(&linear, x), 1.5)
}

/// `count` + 1 equal steps from 0 to `end`.
pub fn grid(end: f64, count: u32) -> Vec<f64> {
    (0..=count).map(|index| end * f64::from(index) / f64::from(count)).collect()
}

/// Mean, least and most of several curves at common x.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Spread {
    /// Mean over the curves.
    pub mean: Points,
    /// x, least, most.
    pub band: Vec<(f64, f64, f64)>,
}

/// The spread of curves at the places `at`; places that one of them does not reach are left out.
pub fn spread(curves: &[Points], at: &[f64]) -> Spread {
    let mut spread = Spread::default();
    for &x in at {
        let values: Vec<f64> = curves.iter().map(|points| sample(points, x)).collect();
        if values.is_empty() || values.iter().any(|value| !value.is_finite()) {
            continue;
        }
        let (low, high) =
            values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)));
        spread.mean.push((x, values.iter().sum::<f64>() / values.len() as f64));
        spread.band.push((x, low, high));
    }
    spread
}

/// The largest y of curves.
pub fn highest<'a>(curves: impl IntoIterator<Item = &'a Points>) -> f64 {
    curves.into_iter().flatten().map(|point| point.1).filter(|y| y.is_finite()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stiffening_has_its_limits_and_its_first_orders() {
        let full = PVDF.branch / PVDF.long_term;
        assert!((PVDF.stiffening(0.0) - 1.0 - full).abs() < 1e-9);
        // Fast: the mean age of an increment is (1 − 3/5) of the time.
        let fast = 1.0 + full * (1.0 - 0.4 * 1e-3);
        assert!((PVDF.stiffening(1.8e-3) - fast).abs() < 1e-6, "{} {fast}", PVDF.stiffening(1.8e-3));
        // Slow: (3/2) τ/time of the branch is left.
        let slow = 1.0 + full * 1.5e-2;
        assert!((PVDF.stiffening(180.0) / slow - 1.0).abs() < 1e-4, "{} {slow}", PVDF.stiffening(180.0));
        // Midpoint sum over u with 2·10⁵ terms, NMC over 10 s.
        assert!((NMC.stiffening(10.0) - 1.1654).abs() < 1e-4, "{}", NMC.stiffening(10.0));
    }

    #[test]
    fn samples_interpolate_and_end_where_the_curve_ends() {
        let points = vec![(0.0, 0.0), (1.0, 2.0), (2.0, 2.0)];
        assert_eq!([0.0, 0.5, 1.0, 1.5, 2.0].map(|x| sample(&points, x)), [0.0, 1.0, 2.0, 2.0, 2.0]);
        assert!(sample(&points, -0.1).is_nan() && sample(&points, 2.1).is_nan() && sample(&[], 0.0).is_nan());
        let hertz: Points = grid(1.0, 10).into_iter().map(|x| (x, libm::pow(x, 1.5))).collect();
        assert!((sample_force(&hertz, 0.123) / libm::pow(0.123, 1.5) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_spread_holds_mean_and_extremes_where_all_curves_are() {
        let got = spread(&[vec![(0.0, 0.0), (2.0, 2.0)], vec![(0.0, 2.0), (1.0, 3.0)]], &[0.0, 1.0, 2.0]);
        assert_eq!(got.mean, [(0.0, 1.0), (1.0, 2.0)]);
        assert_eq!(got.band, [(0.0, 0.0, 2.0), (1.0, 1.0, 3.0)]);
    }
}
