//! W Fig. 13: 226 PVDF spheres dropped and rolled; a loose packing bears nothing until it is dense enough.

use super::assembly::{DROPPED, Packings, Variant, jobs, packings, series};
use super::check::{Check, Unit};
use super::curves::{Points, curve, highest, sample, stress_strain};
use super::job::{Job, Run, Runs};
use super::{Extent, Judged, Judgement};
use crate::output::history::HistoryRow;
use crate::output::plot::{Corner, Ink, Panel, Style};

const FIGURE: u32 = DROPPED;
/// Final strain \[%\].
const END: f64 = 10.0;
/// Strain at which the dynamic part begins and ends \[%\].
const DYNAMIC: [f64; 2] = [7.0, 8.0];
/// Share of the final stress that counts as stress.
const ONSET: f64 = 0.01;
/// Friction of the further curves.
const OTHER_FRICTION: [f64; 2] = [0.0, 0.1];

fn variants() -> Vec<Variant> {
    let two_stages = "stage=[{routine=\"quasi_static\", strain_increment={z=1e-3}, until_strain={z=0.07}}, \
                      {routine=\"dynamic\", strain_rate={z=0.003}, until_strain={z=0.08}}]";
    let mut variants = vec![Variant::new("static", Vec::new()), Variant::new("dynamic", vec![two_stages.to_owned()])];
    variants.extend(
        OTHER_FRICTION.map(|mu| Variant::new(format!("friction-{mu}"), vec![format!("material.0.friction={mu}")])),
    );
    variants
}

/// Runs of Fig. 13.
pub fn plan(extent: &Extent) -> Vec<Job> {
    jobs(FIGURE, &variants(), extent)
}

/// The first row from which on the stress is more than [`ONSET`] of the last one's.
fn onset(run: &Run) -> Judged<&HistoryRow> {
    let level = ONSET * run.rows.last().map_or(f64::NAN, |row| row.stress[2]);
    let below = run.rows.iter().rposition(|row| row.stress[2] <= level);
    let first = below.and_then(|index| run.rows.get(index + 1));
    first.ok_or_else(|| "a packing that bears load from the start, or never".to_owned())
}

/// The coordination number 1 % of strain before `onset`.
fn coordination_before(run: &Run, onset: &HistoryRow) -> f64 {
    sample(&curve(&run.rows, |row| row.strain[2], |row| row.coordination), onset.strain[2] - 0.01)
}

/// Fig. 13.
pub fn judge(runs: &Runs, extent: &Extent) -> Judged<Judgement> {
    let all = Packings { figure: FIGURE, runs, seeds: &extent.seeds };
    let fixed = all.of("static")?;
    let onsets = fixed.iter().map(|run| onset(run)).collect::<Judged<Vec<_>>>()?;
    let curves: Vec<Points> = fixed.iter().map(|run| stress_strain(&run.rows)).collect();
    let dynamic: Vec<Points> = all
        .of("dynamic")?
        .into_iter()
        .map(|run| stress_strain(&run.rows).into_iter().filter(|point| point.0 >= 0.9999 * DYNAMIC[0]).collect())
        .collect();
    let others = OTHER_FRICTION.map(|mu| all.of(&format!("friction-{mu}")));
    let others = others.into_iter().collect::<Judged<Vec<Vec<&Run>>>>()?;
    let other_onset =
        |runs: &[&Run]| -> Judged<Vec<f64>> { runs.iter().map(|run| onset(run).map(|row| row.strain[2])).collect() };
    let [smooth, rough] = [other_onset(&others[0])?, other_onset(&others[1])?];
    let before: Vec<f64> = fixed.iter().zip(&onsets).map(|(run, row)| coordination_before(run, row)).collect();
    let first = |value: fn(&HistoryRow) -> f64| onsets.iter().map(|row| value(row)).collect::<Vec<f64>>();
    let early: Vec<f64> = curves.iter().map(|points| sample(points, 4.0) / sample(points, END)).collect();
    let fractions: Vec<f64> = fixed.iter().filter_map(|run| run.rows.first()).map(|row| row.solid_fraction).collect();
    let order: Vec<f64> =
        smooth.iter().zip(first(|row| row.strain[2])).zip(&rough).map(|((a, b), c)| (a - b).min(b - c)).collect();
    let checks = vec![
        Check::within("solid fraction of the packing (W: 0.58)", [0.57, 0.59], Unit::Plain, &fractions),
        Check::at_most("stress at 4 % strain over that at 10 %", 1e-3, Unit::Percent, &early),
        Check::within(
            "strain at which the stress passes 1 % of the last (W: about 7 %; sets the friction)",
            [0.055, 0.085],
            Unit::Percent,
            &first(|row| row.strain[2]),
        ),
        Check::within("solid fraction there (W: 0.62)", [0.61, 0.635], Unit::Plain, &first(|row| row.solid_fraction)),
        Check::within("coordination number 1 % of strain before", [4.0, 4.8], Unit::Plain, &before).or_finding(
            "Where a packing rearranges without bearing load, it holds nearly six contacts well before the onset.",
        ),
        Check::within(
            "W: coordination number there (about 4.8)",
            [4.3, 5.3],
            Unit::Plain,
            &first(|row| row.coordination),
        )
        .or_finding(
            "With so little friction it takes nearly six contacts to bear load; W's value is that of a packing about to \
             bear load (line before).",
        ),
        Check::within(
            "the onset comes sooner with more friction: least distance of 0, 0.01, 0.1",
            [0.0, f64::INFINITY],
            Unit::Percent,
            &order,
        ),
        Check::within("onset without friction", [0.07, 0.10], Unit::Percent, &smooth),
        Check::within("onset with the friction of Figs. 14 to 16, 0.1", [0.06, 0.08], Unit::Percent, &rough).or_finding(
            "Friction that brings the stress of the dense packings to W's lets a loose one bear load too early: with our \
             packings, no one friction gives both.",
        ),
        Check::at_most(
            "dynamic from 7 % on, off quasi-static at 8 % strain, over the stress at 10 %",
            0.05,
            Unit::Percent,
            &apart(&dynamic, &curves),
        )
        .or_finding(
            "At 7 % a packing has hardly begun to bear load, and small differences decide how it rearranges: most packings \
             follow the quasi-static path, single ones find another (picture: the means; spread in the runs).",
        ),
    ];
    let from_seven = series("HSD, dynamic from 7 % on", Ink::Black, Style::Dashed, &dynamic, END);
    let [smooth, rough] =
        [0, 1].map(|index| others[index].iter().map(|run| stress_strain(&run.rows)).collect::<Vec<Points>>());
    let top = highest(&curves);
    let panel = Panel {
        title: format!("226 PVDF spheres, drop and roll, {} (W Fig. 13)", packings(extent)),
        x_label: "strain / %".to_owned(),
        y_label: "stress σ_zz / MPa".to_owned(),
        x: [0.0, END],
        y: [-0.02 * top, 1.05 * top],
        legend: Corner::UpperLeft,
        series: vec![
            series("HSD, quasi-static, friction 0.01", Ink::Red, Style::Solid, &curves, END),
            from_seven,
            series("HSD, quasi-static, no friction", Ink::Sky, Style::Dotted, &smooth, END),
            series("HSD, quasi-static, friction 0.1", Ink::Grey, Style::Dotted, &rough, END),
        ],
    };
    Ok(Judgement { checks, panels: vec![("fig13".to_owned(), panel)] })
}

/// How far the dynamic curves end from the quasi-static ones, over the latter's last stress: at 7 % a packing
/// has hardly begun to bear load.
fn apart(dynamic: &[Points], fixed: &[Points]) -> Vec<f64> {
    let end = 0.99999 * DYNAMIC[1];
    let off = |(a, b): (&Points, &Points)| (sample(a, end) - sample(b, end)).abs() / sample(b, END);
    dynamic.iter().zip(fixed).map(off).collect()
}
