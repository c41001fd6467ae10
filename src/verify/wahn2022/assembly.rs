//! What Figs. 13 to 16 share: runs of many packings, and their curves with spread.

use super::curves::{Points, grid, sample, spread, stress_strain};
use super::job::{Job, Run, Runs};
use super::{Extent, Judged};
use crate::output::plot::{Ink, Series, Style};

/// W's PVDF with the spontaneous modulus.
pub const STIFF: &str = "material.0.young_modulus=1770.5 MPa";

/// The figure whose packings are dropped and rolled.
pub const DROPPED: u32 = 13;

/// `--set` argument of an elastic normal law with this damping.
pub fn hertz(damping: &str) -> String {
    format!("contact.normal={{hertz={{damping=\"{damping}\"}}}}")
}

/// `--set` argument of a quasi-static compression along z.
pub fn quasi_static(increment: f64, until: f64) -> String {
    format!("stage=[{{routine=\"quasi_static\", strain_increment={{z={increment}}}, until_strain={{z={until}}}}}]")
}

/// `--set` arguments of a strain rate \[1/s\], its density scaling, and 200 rows until the strain `until`.
pub fn at_rate(rate: f64, scaling: f64, until: f64) -> Vec<String> {
    vec![
        format!("stage.0.strain_rate.z={rate:e}"),
        format!("material.0.density_scaling={scaling:e}"),
        format!("output.history={:e} s", until / rate / 200.0),
    ]
}

/// One curve of a figure: the same changes for every packing.
#[derive(Debug, Clone)]
pub struct Variant {
    /// Name; the run is `NAME-SEED`.
    pub name: String,
    /// `--set` arguments.
    pub sets: Vec<String>,
}

impl Variant {
    /// A variant with these changes.
    pub fn new(name: impl Into<String>, sets: Vec<String>) -> Self {
        Self { name: name.into(), sets }
    }
}

/// Runs of all variants for all packings.
pub fn jobs(figure: u32, variants: &[Variant], extent: &Extent) -> Vec<Job> {
    let job = |variant: &Variant, seed: u32| {
        let mut sets = vec![format!("seed={seed}")];
        if extent.quick {
            sets.push("species.0.count=120".to_owned());
            if figure != DROPPED {
                // Fewer spheres end looser; this makes them bear load early enough again.
                sets.push("packing.random_close.contraction_rate=3e-4".to_owned());
            }
        }
        sets.extend(variant.sets.iter().cloned());
        Job::new(figure, format!("{}-{seed}", variant.name), sets)
    };
    extent.seeds.iter().flat_map(|&seed| variants.iter().map(move |variant| job(variant, seed))).collect()
}

/// The runs of a figure, by variant.
pub struct Packings<'a> {
    /// Number of the figure.
    pub figure: u32,
    /// All runs.
    pub runs: &'a Runs,
    /// Seeds.
    pub seeds: &'a [u32],
}

impl<'a> Packings<'a> {
    /// The runs of a variant, one per packing.
    ///
    /// # Errors
    /// One of them failed.
    pub fn of(&self, variant: &str) -> Judged<Vec<&'a Run>> {
        self.seeds.iter().map(|seed| self.runs.get(self.figure, &format!("{variant}-{seed}"))).collect()
    }

    /// Stress over strain of a variant (MPa, %), one curve per packing.
    ///
    /// # Errors
    /// One of the runs failed.
    pub fn stress(&self, variant: &str) -> Judged<Vec<Points>> {
        Ok(self.of(variant)?.into_iter().map(|run| stress_strain(&run.rows)).collect())
    }
}

/// A curve per packing as one series: mean and band, at 100 places up to the strain `end` \[%\].
pub fn series(label: impl Into<String>, ink: Ink, style: Style, curves: &[Points], end: f64) -> Series {
    let spread = spread(curves, &grid(end, 100));
    Series { label: label.into(), points: spread.mean, band: spread.band, ink, style }
}

/// y of each curve over y of its companion at `x`.
pub fn ratios(curves: &[Points], companions: &[Points], x: f64) -> Vec<f64> {
    curves.iter().zip(companions).map(|(a, b)| sample(a, x) / sample(b, x)).collect()
}

/// As [`ratios`], minus one.
pub fn differences(curves: &[Points], companions: &[Points], x: f64) -> Vec<f64> {
    ratios(curves, companions, x).into_iter().map(|ratio| ratio - 1.0).collect()
}

/// Magnitudes.
pub fn magnitudes(values: &[f64]) -> Vec<f64> {
    values.iter().map(|value| value.abs()).collect()
}

/// "seeds 1 to 3".
pub fn packings(extent: &Extent) -> String {
    match extent.seeds.as_slice() {
        [one] => format!("seed {one}"),
        seeds => format!("mean and range of {} packings", seeds.len()),
    }
}
