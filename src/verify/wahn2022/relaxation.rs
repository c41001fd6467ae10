//! W Fig. 16: 250 PVDF spheres, compressed and held.

use super::assembly::{
    Packings, STIFF, Variant, differences, hertz, jobs, magnitudes, packings, quasi_static, ratios, series,
};
use super::check::{Check, Unit};
use super::curves::{PVDF, Points, curve, grid, highest, sample, spread};
use super::job::{Job, Runs};
use super::{Extent, Judged, Judgement};
use crate::output::plot::{Corner, Ink, Panel, Series, Style};

const FIGURE: u32 = 16;
/// Final strain.
const END: f64 = 0.003;
/// The same \[%\].
const AT: f64 = 0.3;
/// Times of the end of loading and of the run \[s\].
const TIMES: [f64; 2] = [1.0, 10.0];

fn variants() -> Vec<Variant> {
    let fixed = || vec![hertz("wahn"), quasi_static(5e-5, END)];
    vec![
        Variant::new("mz", Vec::new()),
        Variant::new("soft", vec![hertz("tsuji")]),
        Variant::new("static-soft", fixed()),
        Variant::new("static-stiff", [fixed(), vec![STIFF.to_owned()]].concat()),
    ]
}

/// Runs of Fig. 16.
pub fn plan(extent: &Extent) -> Vec<Job> {
    let mut variants = variants();
    if extent.quick {
        for variant in &mut variants[..2] {
            variant.sets.push("material.0.density_scaling=1e10".to_owned());
        }
    }
    jobs(FIGURE, &variants, extent)
}

/// Fig. 16.
pub fn judge(runs: &Runs, extent: &Extent) -> Judged<Judgement> {
    let all = Packings { figure: FIGURE, runs, seeds: &extent.seeds };
    let over_time = |variant: &str| -> Judged<Vec<Points>> {
        let mega = |run: &&super::job::Run| curve(&run.rows, |row| row.time, |row| 1e-6 * row.stress[2]);
        Ok(all.of(variant)?.iter().map(mega).collect())
    };
    let [mz, soft] = [over_time("mz")?, over_time("soft")?];
    let [static_soft, static_stiff] = [all.stress("static-soft")?, all.stress("static-stiff")?];
    let [loaded, held] = TIMES;
    let ends: Vec<Points> = static_soft.iter().map(|points| vec![(held, sample(points, AT))]).collect();
    let decay: Vec<f64> = mz
        .iter()
        .zip(&soft)
        .map(|(mz, soft)| {
            let excess = |time: f64| sample(mz, time) - sample(soft, time);
            2.0 / libm::log(excess(1.5) / excess(3.5))
        })
        .collect();
    let peak: Vec<f64> = ratios(&mz, &soft, loaded).into_iter().map(|ratio| ratio / PVDF.stiffening(loaded)).collect();
    let checks = vec![
        Check::within("quasi-static E_soft at 0.3 % (W: 0.0127 MPa; sets the friction)", [0.010, 0.016], Unit::Of("MPa"), &ends.iter().map(|end| end[0].1).collect::<Vec<_>>()),
        Check::within("MZ over elastic E_soft at 1 s, over the theory of one contact", [0.99, 1.01], Unit::Plain, &peak),
        Check::within("MZ over elastic E_soft of the same kinematics at 10 s", [0.99, 1.01], Unit::Plain, &ratios(&mz, &soft, held)),
        Check::within("relaxation time from the decay of 1.5 to 3.5 s", [1.7, 1.9], Unit::Of("s"), &decay),
        Check::at_most("W: MZ at 10 s off quasi-static E_soft (W: 3 %)", 0.03, Unit::Percent, &magnitudes(&differences(&mz, &ends, held)))
            .or_finding("The quasi-static and the dynamic path of a packing part near jamming; the elastic run of the same kinematics parts alike."),
        Check::within("MZ at 10 s over quasi-static E_soft: the difference of the paths", [0.9, 1.1], Unit::Plain, &ratios(&mz, &ends, held)),
    ];
    let strain_end = 1.06 * AT;
    let strain_panel = Panel {
        title: format!("250 PVDF spheres, relaxation, {} (W Fig. 16a)", packings(extent)),
        x_label: "strain / %".to_owned(),
        y_label: "stress σ_zz / MPa".to_owned(),
        x: [0.0, strain_end],
        y: [0.0, 1.08 * highest(mz.iter().chain(&static_stiff))],
        legend: Corner::UpperLeft,
        series: vec![
            series("HSD, quasi-static, E_stiff and E_soft", Ink::Red, Style::Solid, &static_stiff, AT),
            series("", Ink::Red, Style::Solid, &static_soft, AT),
            hold(&all, &mz)?,
        ],
    };
    let times = [grid(loaded, 50), grid(held - loaded, 150)[1..].iter().map(|t| loaded + t).collect()].concat();
    let timed = |label: &str, ink, style, curves: &[Points]| {
        let spread = spread(curves, &times);
        Series { label: label.to_owned(), points: spread.mean, band: spread.band, ink, style }
    };
    let mean = |curves: &[Points], x: f64| spread(curves, &[x]).mean.first().map_or(f64::NAN, |point| point.1);
    let level = |y: f64| vec![(0.0, y), (held, y)];
    let time_panel = Panel {
        title: format!("250 PVDF spheres, relaxation, {} (W Fig. 16b)", packings(extent)),
        x_label: "time / s".to_owned(),
        y_label: "stress σ_zz / MPa".to_owned(),
        x: [0.0, held],
        y: [0.0, 1.15 * highest(&mz)],
        legend: Corner::LowerRight,
        series: vec![
            timed("MZ, 0.3 % in 1 s, then held", Ink::Black, Style::Dashed, &mz),
            timed("HSD, dynamic, E_soft, the same", Ink::Green, Style::Dotted, &soft),
            Series::new("HSD, quasi-static, E_soft, at 0.3 %", Ink::Blue, Style::Solid, level(mean(&ends, held))),
            Series::new("MZ at 10 s", Ink::Grey, Style::Solid, level(mean(&mz, held))),
        ],
    };
    Ok(Judgement { checks, panels: vec![("fig16a".to_owned(), strain_panel), ("fig16b".to_owned(), time_panel)] })
}

/// MZ over strain, with the drop at the end.
fn hold(all: &Packings, mz: &[Points]) -> Judged<Series> {
    let mut line = series("MZ, 0.3 % in 1 s, then held", Ink::Black, Style::Dashed, &all.stress("mz")?, AT);
    let [loaded, held] = TIMES.map(|time| spread(mz, &[time]));
    line.points.retain(|point| point.0 < 0.999 * AT);
    line.band.retain(|point| point.0 < 0.999 * AT);
    line.points.extend([&loaded, &held].iter().filter_map(|end| end.mean.first()).map(|point| (AT, point.1)));
    Ok(line)
}
