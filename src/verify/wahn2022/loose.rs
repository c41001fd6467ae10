//! W Fig. 13: 226 PVDF spheres dropped and rolled; a loose packing bears nothing until it is dense enough.

use super::assembly::{Packings, Variant, differences, jobs, magnitudes, packings, series};
use super::check::{Check, Unit};
use super::curves::{Points, highest, sample, stress_strain};
use super::job::{Job, Run, Runs};
use super::{Extent, Judged, Judgement};
use crate::output::history::HistoryRow;
use crate::output::plot::{Corner, Ink, Panel, Style};

const FIGURE: u32 = 13;
/// Final strain \[%\].
const END: f64 = 10.0;
/// Strain at which the dynamic part begins and ends \[%\].
const DYNAMIC: [f64; 2] = [7.0, 8.0];
/// Share of the final stress that counts as stress.
const ONSET: f64 = 0.01;

fn variants() -> [Variant; 2] {
    let two_stages = "stage=[{routine=\"quasi_static\", strain_increment={z=1e-3}, until_strain={z=0.07}}, \
                      {routine=\"dynamic\", strain_rate={z=0.003}, until_strain={z=0.08}}]";
    [Variant::new("static", Vec::new()), Variant::new("dynamic", vec![two_stages.to_owned()])]
}

/// Runs of Fig. 13.
pub fn plan(extent: &Extent) -> Vec<Job> {
    jobs(FIGURE, &variants(), extent)
}

/// The first row whose stress is more than [`ONSET`] of the last one's and stays so.
fn onset(run: &Run) -> Judged<&HistoryRow> {
    let level = ONSET * run.rows.last().map_or(f64::NAN, |row| row.stress[2]);
    let below = run.rows.iter().rposition(|row| row.stress[2] <= level);
    run.rows.get(below.map_or(0, |index| index + 1)).ok_or_else(|| "no packing ever bears load".to_owned())
}

/// Fig. 13.
pub fn judge(runs: &Runs, extent: &Extent) -> Judged<Judgement> {
    let all = Packings { figure: FIGURE, runs, seeds: &extent.seeds };
    let fixed = all.of("static")?;
    let onsets = fixed.iter().map(|run| onset(run)).collect::<Judged<Vec<&HistoryRow>>>()?;
    let curves: Vec<Points> = fixed.iter().map(|run| stress_strain(&run.rows)).collect();
    let dynamic: Vec<Points> = all
        .of("dynamic")?
        .into_iter()
        .map(|run| stress_strain(&run.rows).into_iter().filter(|point| point.0 >= 0.9999 * DYNAMIC[0]).collect())
        .collect();
    let at_onset = |value: fn(&HistoryRow) -> f64| onsets.iter().map(|row| value(row)).collect::<Vec<f64>>();
    let final_fraction =
        |x: f64| -> Vec<f64> { curves.iter().map(|points| sample(points, x) / sample(points, END)).collect() };
    let fractions: Vec<f64> = fixed.iter().filter_map(|run| run.rows.first()).map(|row| row.solid_fraction).collect();
    let checks = vec![
        Check::within("solid fraction of the packing (W: 0.58)", [0.56, 0.60], Unit::Plain, &fractions),
        Check::at_most("stress at 3 % over stress at 10 %", 0.01, Unit::Percent, &final_fraction(3.0)),
        Check::within(
            "strain at which the stress passes 1 % of that at 10 % (W: about 7 %)",
            [0.05, 0.09],
            Unit::Percent,
            &at_onset(|row| row.strain[2]),
        ),
        Check::within(
            "solid fraction there (W: 0.62)",
            [0.605, 0.635],
            Unit::Plain,
            &at_onset(|row| row.solid_fraction),
        ),
        Check::within(
            "coordination number there (W: about 4.8)",
            [4.3, 5.3],
            Unit::Plain,
            &at_onset(|row| row.coordination),
        ),
        Check::at_most(
            "dynamic from 7 % on, off quasi-static at 8 %",
            0.05,
            Unit::Percent,
            &magnitudes(&differences(&dynamic, &curves, 0.99999 * DYNAMIC[1])),
        ),
    ];
    let mut from_seven = series("HSD, dynamic from 7 % on", Ink::Black, Style::Dashed, &dynamic, END);
    from_seven.band.clear();
    let panel = Panel {
        title: format!("226 PVDF spheres, drop and roll, {} (W Fig. 13)", packings(extent)),
        x_label: "strain / %".to_owned(),
        y_label: "stress σ_zz / MPa".to_owned(),
        x: [0.0, END],
        y: [-0.02 * highest(&curves), 1.05 * highest(&curves)],
        legend: Corner::UpperLeft,
        series: vec![series("HSD, quasi-static", Ink::Red, Style::Solid, &curves, END), from_seven],
    };
    Ok(Judgement { checks, panels: vec![("fig13".to_owned(), panel)] })
}
