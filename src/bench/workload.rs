//! The workload as an input text: stiff grains of 5 µm, Hertz + Mindlin with damping, compressed in z at
//! 0.2 /s with a fixed step. The inputs in benches/peers/ hold the same for other codes.

use crate::config::Config;
use crate::error::Result;
use std::fmt::Write;
use std::path::Path;

/// Time step \[s\].
pub const TIME_STEP: f64 = 5e-7;
/// Density in motion \[kg/m³\].
pub const DENSITY: f64 = 5e9;
/// Radius, the smallest one of unequal spheres \[µm\].
const RADIUS: f64 = 5.0;
/// Young's modulus of a fast load \[GPa\].
const YOUNG_MODULUS: f64 = 142.0;
/// Radii of unequal spheres: so many, evenly from the smallest to the largest.
const CLASSES: usize = 32;

/// Normal law of the timed steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum Law {
    /// Hertz with damping.
    Hertz,
    /// One Maxwell branch with half of the modulus: a fast load meets the stiffness of `hertz`.
    MaxwellZener,
}

impl Law {
    /// Name as on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Hertz => "hertz",
            Self::MaxwellZener => "maxwell_zener",
        }
    }
}

/// Between these two the ratios b/a and c/a of ellipsoids are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aspects(pub [f64; 2]);

impl std::str::FromStr for Aspects {
    type Err = String;
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let numbers: Vec<f64> = text.split(':').filter_map(|part| part.parse().ok()).collect();
        match numbers[..] {
            [low, high] if text.matches(':').count() == 1 && 0.1 <= low && low <= high && high <= 10.0 => {
                Ok(Self([low, high]))
            }
            _ => {
                Err("give the least and the largest ratio of the semi-axes, from 0.1 to 10, for example 0.7:1.3".into())
            }
        }
    }
}

/// Where the particles come from.
#[derive(Debug, Clone)]
pub enum Particles<'a> {
    /// Random close packing of so many spheres with radii 1:ratio, or of ellipsoids of one size.
    Made {
        /// Number of particles.
        count: usize,
        /// Largest over smallest radius.
        ratio: f64,
        /// Ellipsoids: b/a and c/a are drawn between these two.
        aspects: Option<Aspects>,
    },
    /// A particle file.
    File {
        /// The file.
        path: &'a Path,
        /// Names of its species.
        species: &'a [String],
        /// Sides of the cell \[m\] where the file does not have them.
        sides: Option<[f64; 3]>,
    },
}

/// One leg of the load: isotropic or along z.
#[derive(Debug, Clone, Copy)]
pub enum Leg {
    /// The same strain rate \[1/s\] on all axes.
    Isotropic(f64),
    /// Strain rate \[1/s\] along z.
    AlongZ(f64),
}

/// Everything that varies between benches.
#[derive(Debug, Clone)]
pub struct Workload<'a> {
    /// The particles.
    pub particles: Particles<'a>,
    /// Normal law.
    pub law: Law,
    /// Legs with their numbers of steps.
    pub legs: Vec<(Leg, u64)>,
    /// Threads per rank.
    pub threads: usize,
}

impl Workload<'_> {
    /// The checked input.
    ///
    /// # Errors
    /// A number of the command line that no input may have.
    pub fn config(&self) -> Result<Config> {
        Config::parse(&self.text(), Path::new("bench"), &[], None, Some(self.threads))
    }

    fn text(&self) -> String {
        let (modulus, branch, law) = match self.law {
            Law::Hertz => (YOUNG_MODULUS, "", "hertz"),
            Law::MaxwellZener => (
                0.5 * YOUNG_MODULUS,
                "[[material.maxwell]]\nmodulus = \"71 GPa\"\nrelaxation_time = \"1 ms\"\n",
                "maxwell_zener",
            ),
        };
        let mut text = format!(
            r#"
seed = 1
[[material]]
name = "grain"
density = {DENSITY:e}
young_modulus = "{modulus} GPa"
poisson_ratio = 0.25
restitution = 0.5
friction = 0.3
{branch}
[contact.normal.{law}]
[contact.tangential.mindlin]
factor = 1.0
[time_step]
fixed = {TIME_STEP:e}
[parallel]
min_particles_per_rank = 1
skin = 0.1
"#
        );
        // Writing to a string cannot fail.
        let _ = match &self.particles {
            Particles::Made { count, ratio, aspects } => {
                let packing = match aspects {
                    Some(_) => "[packing.relaxation]",
                    None => "[packing.random_close]\ncontraction_rate = 1e-3",
                };
                let shapes = aspects.map_or(String::new(), |Aspects([low, high])| {
                    format!("aspect_ratios = {{ b_to_a = [{low}, {high}], c_to_a = [{low}, {high}] }}\n")
                });
                write!(
                    text,
                    "{packing}\n[[species]]\nname = \"1\"\nmaterial = \"grain\"\ncount = {count}\n{shapes}{}",
                    radii(*ratio)
                )
            }
            Particles::File { path, species, sides } => {
                for name in *species {
                    let _ =
                        write!(text, "[[species]]\nname = {name:?}\nmaterial = \"grain\"\nradius = \"{RADIUS} um\"\n");
                }
                if let Some(sides) = sides {
                    let _ = writeln!(text, "[cell]\nsides = {sides:?}");
                }
                writeln!(text, "[packing.file]\npath = {:?}", path.to_string_lossy())
            }
        };
        for (leg, steps) in &self.legs {
            let rate = match leg {
                Leg::Isotropic(rate) => format!("{rate:e}"),
                Leg::AlongZ(rate) => format!("{{ z = {rate:e} }}"),
            };
            let _ = writeln!(text, "[[stage]]\nstrain_rate = {rate}\nsteps = {steps}");
        }
        text
    }
}

/// The radii of a species; with a ratio above 1 every class has the same number of spheres.
fn radii(ratio: f64) -> String {
    if ratio == 1.0 {
        return format!("radius = \"{RADIUS} um\"\n");
    }
    let one = |k: usize| format!("\"{} um\"", RADIUS * (1.0 + (ratio - 1.0) * k as f64 / (CLASSES - 1) as f64));
    let list: Vec<String> = (0..CLASSES).map(one).collect();
    let weights = vec!["1"; CLASSES].join(", ");
    format!("[species.radius.tabulated]\nradius = [{}]\nweight = [{weights}]\n", list.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fast_load_meets_the_same_modulus_under_both_laws() {
        let moduli = [Law::Hertz, Law::MaxwellZener].map(|law| {
            let particles = Particles::Made { count: 10, ratio: 3.0, aspects: None };
            let config = Workload { particles, law, legs: vec![(Leg::AlongZ(0.2), 5)], threads: 1 }.config();
            let config = config.expect("the workload is a valid input");
            assert_eq!(config.pairs[0].normal.law.name, law.name());
            let radius = &config.species[0].radius;
            assert!((radius.max() / radius.min() - 3.0).abs() < 1e-12);
            let material = &config.materials[0];
            material.young_modulus + material.maxwell.iter().map(|branch| branch.modulus).sum::<f64>()
        });
        assert_eq!(moduli, [142e9; 2]);
    }
}
