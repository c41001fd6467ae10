//! The run that W could not afford: its Fig. 15 at the physical density, over scaled ones of the same packing.

use super::assembly::{Variant, at_rate, jobs};
use super::check::{Check, Unit};
use super::curves::{Points, curve, highest, sample, stress_strain};
use super::job::{Job, Run, Runs};
use super::{Extent, Judged};
use crate::output::plot::{Corner, Ink, Panel, Series, Style};

/// Strain rate \[1/s\].
const RATE: f64 = 1.0;
/// Final strain \[%\].
const AT: f64 = 0.5;
/// Density scalings beside the physical density, rising; that of the first run is the figure's own.
const SCALINGS: [f64; 3] = [1e4, 1e6, 1e8];

fn name(scaling: f64) -> String {
    format!("density-{scaling:e}")
}

/// The runs, of the first packing only: the physical density takes ten million steps.
pub fn plan(figure: u32, extent: &Extent) -> Vec<Job> {
    if extent.quick {
        return Vec::new();
    }
    let variants: Vec<Variant> = [1.0, SCALINGS[1], SCALINGS[2]]
        .map(|scaling| Variant::new(name(scaling), at_rate(RATE, scaling, 0.01 * AT)))
        .into();
    jobs(figure, &variants, &Extent { seeds: extent.seeds[..1].to_vec(), ..extent.clone() })
}

/// Checks and the picture; `own` is the figure's run with the first of the scalings.
///
/// # Errors
/// A run failed.
pub fn judge(figure: u32, runs: &Runs, own: &str, extent: &Extent) -> Judged<(Vec<Check>, Panel)> {
    let of = |name: String| runs.get(figure, &format!("{name}-{}", extent.seeds[0]));
    let physical = of(name(1.0))?;
    let scaled: Vec<&Run> = vec![of(own.to_owned())?, of(name(SCALINGS[1]))?, of(name(SCALINGS[2]))?];
    let stress: Vec<Points> = scaled.iter().map(|run| stress_strain(&run.rows)).collect();
    let full = stress_strain(&physical.rows);
    let restless = curve(&physical.rows, |row| 100.0 * row.strain[2], |row| row.unbalanced_ratio);
    let bearing = restless.iter().filter(|(x, y)| *x >= 0.2 * AT && !y.is_nan()).map(|point| point.1);
    let end = |points: &Points| sample(points, 0.9999 * AT);
    let checks = vec![
        Check::within(
            "the physical density: strain that its run reaches",
            [0.9999 * AT * 0.01, 1.0001 * AT * 0.01],
            Unit::Percent,
            &[physical.rows.last().map_or(f64::NAN, |row| row.strain[2])],
        ),
        Check::at_most(
            "the physical density: largest unbalanced force ratio from 0.1 % on (no oscillation)",
            1e-3,
            Unit::Plain,
            &[bearing.fold(0.0, f64::max)],
        ),
        Check::within(
            "stress at 10⁴ times the density over that at the physical one, 0.5 %",
            [0.99, 1.01],
            Unit::Plain,
            &[end(&stress[0]) / end(&full)],
        ),
    ];
    let mut series = vec![Series::new("physical density", Ink::Red, Style::Solid, full.clone())];
    for ((scaling, points), ink) in SCALINGS.iter().zip(&stress).zip([Ink::Black, Ink::Blue, Ink::Orange]) {
        series.push(Series::new(format!("density × {scaling:e}"), ink, Style::Dashed, points.clone()));
    }
    let panel = Panel {
        title: format!("250 PVDF spheres, MZ at 1/s, seed {}: density", extent.seeds[0]),
        x_label: "strain / %".to_owned(),
        y_label: "stress σ_zz / MPa".to_owned(),
        x: [0.0, AT],
        y: [0.0, 1.05 * highest(stress.iter().chain([&full]))],
        legend: Corner::UpperLeft,
        series,
    };
    Ok((checks, panel))
}
