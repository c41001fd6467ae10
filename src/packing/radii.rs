//! Radii of all particles, drawn per global id from the size distributions of the species.

use super::random::{Draws, Purpose};
use crate::config::{RadiusDistribution, Species};
use crate::error::{Error, Result};

/// Draws outside the cut are repeated this often before the distribution is declared unusable.
const MAX_REDRAWS: usize = 10_000;

/// One particle before it has a place: what species it is of and how large it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sized {
    /// Index into [`crate::config::Config::species`].
    pub species: u32,
    /// Semi-axes \[m\]; the radius three times for a sphere.
    pub semi_axes: [f64; 3],
}

/// Species and semi-axes \[m\] of every particle; ids run from 0 through the species in input order.
///
/// # Errors
/// [`Error::Packing`] if a distribution gives no usable radius: its cut leaves (almost) nothing of
/// it, or a tabulated one has no positive weight.
pub fn draw_radii(seed: u64, species: &[Species]) -> Result<Vec<Sized>> {
    let mut particles = Vec::with_capacity(species.iter().map(|one| one.count).sum());
    for (index, one) in species.iter().enumerate() {
        for _ in 0..one.count {
            let mut draws = Draws::new(seed, Purpose::Radius, particles.len() as u64);
            let radius = draw(&one.radius, &mut draws)
                .filter(|radius| radius.is_finite() && *radius > 0.0)
                .ok_or_else(|| unusable(&one.name, &one.radius))?;
            let mut ratios = Draws::new(seed, Purpose::Shape, particles.len() as u64);
            let semi_axes = one.shape.semi_axes(radius, || ratios.uniform());
            particles.push(Sized { species: index as u32, semi_axes });
        }
    }
    Ok(particles)
}

/// One radius \[m\]; `None` if the distribution does not yield one.
fn draw(distribution: &RadiusDistribution, draws: &mut Draws) -> Option<f64> {
    match distribution {
        RadiusDistribution::Fixed(radius) => Some(*radius),
        RadiusDistribution::Normal { mean, deviation, min, max } => {
            redraw_until_within(*min, *max, || mean + deviation * draws.normal())
        }
        RadiusDistribution::Lognormal { median, sigma, min, max } => {
            redraw_until_within(*min, *max, || median * libm::exp(sigma * draws.normal()))
        }
        RadiusDistribution::Tabulated { radius, weight } => draw_tabulated(radius, weight, draws.uniform()),
    }
}

fn redraw_until_within(min: f64, max: f64, mut next: impl FnMut() -> f64) -> Option<f64> {
    (0..MAX_REDRAWS).map(|_| next()).find(|radius| (min..=max).contains(radius))
}

/// The radius at `uniform` × total weight along the cumulated weights.
fn draw_tabulated(radius: &[f64], weight: &[f64], uniform: f64) -> Option<f64> {
    let target = uniform * weight.iter().sum::<f64>();
    let mut cumulated = 0.0;
    let mut last = None;
    for (radius, weight) in radius.iter().zip(weight).filter(|(_, weight)| **weight > 0.0) {
        cumulated += weight;
        last = Some(*radius);
        if target < cumulated {
            break;
        }
    }
    last
}

fn unusable(name: &str, distribution: &RadiusDistribution) -> Error {
    Error::Packing(format!(
        "species \"{name}\": the size distribution {distribution:?} gives no positive radius within its limits in \
         {MAX_REDRAWS} draws; widen min and max, or correct its values"
    ))
}

#[cfg(test)]
mod tests {
    use super::super::test_input::species;
    use super::*;
    use crate::config::ShapeConfig;

    fn radii(distribution: RadiusDistribution, count: usize) -> Vec<f64> {
        let drawn = draw_radii(3, &[species("a", count, distribution)]).unwrap();
        drawn.iter().map(|one| one.semi_axes[0]).collect()
    }

    #[test]
    fn ids_run_through_the_species_in_input_order() {
        let list = [
            species("small", 3, RadiusDistribution::Fixed(1.0)),
            species("none", 0, RadiusDistribution::Fixed(5.0)),
            species("large", 2, RadiusDistribution::Fixed(2.0)),
        ];
        let drawn: Vec<_> = draw_radii(0, &list).unwrap().iter().map(|one| (one.species, one.semi_axes[0])).collect();
        assert_eq!(drawn, [(0, 1.0), (0, 1.0), (0, 1.0), (2, 2.0), (2, 2.0)]);
    }

    #[test]
    fn a_radius_depends_on_the_id_alone() {
        let normal = RadiusDistribution::Normal { mean: 1.0, deviation: 0.2, min: 0.5, max: 1.5 };
        assert_eq!(radii(normal.clone(), 10), radii(normal, 100)[..10]);
    }

    #[test]
    fn ratios_are_drawn_per_particle_and_keep_the_volume() {
        let mut given = species("a", 5000, RadiusDistribution::Fixed(2.0));
        given.shape = ShapeConfig::AspectRatios { b_to_a: [0.5, 1.0], c_to_a: [0.4, 0.4] };
        let drawn = draw_radii(3, &[given]).unwrap();
        let mut mean = 0.0;
        for one in &drawn {
            let [a, b, c] = one.semi_axes;
            assert!((a * b * c - 8.0).abs() < 1e-12 && (0.5..1.0).contains(&(b / a)) && (c / a - 0.4).abs() < 1e-12);
            mean += b / a / 5000.0;
        }
        assert!((mean - 0.75).abs() < 0.01, "{mean}");
    }

    #[test]
    fn cut_distributions_stay_within_their_limits_and_keep_their_centre() {
        let normal = radii(RadiusDistribution::Normal { mean: 2.0, deviation: 0.5, min: 1.0, max: 3.0 }, 20_000);
        assert!(normal.iter().all(|radius| (1.0..=3.0).contains(radius)));
        let mean = normal.iter().sum::<f64>() / 20_000.0;
        assert!((mean - 2.0).abs() < 0.02, "{mean}");

        let lognormal = RadiusDistribution::Lognormal { median: 2.0, sigma: 0.4, min: 0.5, max: 8.0 };
        let lognormal = radii(lognormal, 20_000);
        assert!(lognormal.iter().all(|radius| (0.5..=8.0).contains(radius)));
        let below = lognormal.iter().filter(|radius| **radius < 2.0).count();
        assert!((9_700..10_300).contains(&below), "{below}");
    }

    #[test]
    fn tabulated_weights_are_number_fractions() {
        let table = RadiusDistribution::Tabulated { radius: vec![1.0, 2.0, 3.0], weight: vec![1.0, 0.0, 3.0] };
        let drawn = radii(table, 20_000);
        let count = |value: f64| drawn.iter().filter(|radius| **radius == value).count();
        assert_eq!(count(2.0), 0);
        assert!((4_750..5_250).contains(&count(1.0)), "{}", count(1.0));
    }

    #[test]
    fn a_cut_that_leaves_nothing_is_an_error_that_names_the_species() {
        let hopeless = RadiusDistribution::Normal { mean: 1.0, deviation: 0.01, min: 9.0, max: 10.0 };
        let message = draw_radii(0, &[species("binder", 1, hopeless)]).unwrap_err().to_string();
        assert!(message.contains("\"binder\"") && message.contains("widen"), "{message}");
    }
}
