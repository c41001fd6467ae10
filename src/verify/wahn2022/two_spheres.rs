//! W Figs. 9, 10 and 12: two PVDF spheres. The two contacts of the periodic cell share the height, so the
//! stress σ_zz = F L_z/V gives the force F = σ_zz L_x L_y.

use super::check::{Check, Unit};
use super::curves::{PVDF, Points, curve, grid, highest, sample, sample_force};
use super::job::{Job, Run, Runs};
use super::{Extent, Judged, Judgement};
use crate::output::plot::{Corner, Ink, Panel, Series, Style};
use crate::verify::viscoelastic::{RATES, RELAXATION, rows};

const RADIUS: f64 = 5e-6;
/// Cross-section of the cell \[m²\].
const AREA: f64 = 4.0 * RADIUS * RADIUS;
/// Overlap per strain \[m\]: two contacts share 4R.
const OVERLAP: f64 = 2.0 * RADIUS;
/// Final strain.
const END: f64 = 0.02;
/// How far the forces may be off.
const SHARE: f64 = 1e-3;

const STIFF: &str = "material.0.young_modulus=1770.5 MPa";
const HERTZ: &str = "contact.normal=hertz";
const RATES_9: [f64; 5] = [100.0, 10.0, 1.0, 0.1, 0.01];
const RATES_12: [f64; 4] = [1.0, 0.1, 0.01, 0.001];
/// So fast that the branch is rigid, so slow that it is gone \[1/s\].
const LIMITS: [f64; 2] = [100.0, 2e-7];
const INKS: [Ink; 5] = [Ink::Purple, Ink::Blue, Ink::Green, Ink::Orange, Ink::Sky];

fn at_rate(rate: f64) -> Vec<String> {
    vec![format!("stage.0.strain_rate.z={rate:e}"), format!("output.history={:e} s", 2e-5 / rate)]
}

fn limit(rate: f64) -> Vec<String> {
    let mut sets = vec![
        format!("stage=[{{strain_rate={{z={rate:e}}}, until_strain={{z={END}}}}}]"),
        format!("output.history={:e} s", 2e-5 / rate),
    ];
    if rate < 1e-3 {
        sets.push("material.0.density_scaling=1e19".to_owned());
    }
    sets
}

fn quasi_static() -> String {
    format!("stage=[{{routine=\"quasi_static\", strain_increment={{z=1e-4}}, until_strain={{z={END}}}}}]")
}

/// Force of one contact \[N\] over strain.
fn force_strain(run: &Run) -> Points {
    curve(&run.rows, |row| row.strain[2], |row| row.stress[2] * AREA)
}

/// Hertz force \[N\] at a strain.
fn hertz(modulus: f64, strain: f64) -> f64 {
    PVDF.hertz(modulus, RADIUS, OVERLAP * strain)
}

/// Curves as they are drawn: % and mN.
fn drawn(points: &[(f64, f64)]) -> Points {
    points.iter().map(|&(x, y)| (100.0 * x, 1e3 * y)).collect()
}

/// The black curves.
fn analytic() -> [Series; 2] {
    let line = |modulus| drawn(&grid(END, 200).into_iter().map(|x| (x, hertz(modulus, x))).collect::<Points>());
    [
        Series::new("Hertz, E_stiff and E_soft", Ink::Black, Style::Solid, line(PVDF.spontaneous())),
        Series::new("", Ink::Black, Style::Solid, line(PVDF.long_term)),
    ]
}

fn force_panel(title: &str, mut curves: Vec<Series>) -> Panel {
    let mut series = analytic().to_vec();
    series.append(&mut curves);
    Panel {
        title: title.to_owned(),
        x_label: "strain / %".to_owned(),
        y_label: "normal contact force / mN".to_owned(),
        x: [0.0, 100.0 * END],
        y: [0.0, 1.05e3 * hertz(PVDF.spontaneous(), END)],
        legend: Corner::UpperLeft,
        series,
    }
}

/// Largest relative difference to the Hertz force of a modulus, from 0.1 % strain on.
fn off_hertz(points: &[(f64, f64)], modulus: f64) -> f64 {
    let far = |&x: &f64| (sample_force(points, x) / hertz(modulus, x) - 1.0).abs();
    worst(grid(END, 20)[1..].iter().map(far))
}

/// NaN if any is.
fn worst(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |most, value| if value <= most { most } else { value })
}

/// Largest relative difference to the independent integration at `rate`.
fn off_reference(points: &[(f64, f64)], rate: f64) -> Judged<f64> {
    let table = rows(RATES).map_err(|error| error.to_string())?;
    let wanted: Vec<_> = table.iter().filter(|row| row[0] == rate).collect();
    if wanted.is_empty() {
        return Err(format!("the reference has no strain rate {rate}"));
    }
    Ok(worst(wanted.into_iter().map(|row| (sample_force(points, row[1]) / row[3] - 1.0).abs())))
}

/// How far a curve leaves the range between the Hertz curves, over the force, from 0.1 % strain on.
fn outside(points: &[(f64, f64)]) -> f64 {
    worst(grid(END, 20)[1..].iter().map(|&x| {
        let force = sample_force(points, x);
        let (below, above) = (hertz(PVDF.long_term, x) - force, force - hertz(PVDF.spontaneous(), x));
        if below > above { below / force } else { above / force }
    }))
}

/// Pairs of neighbouring rates (fast first) whose forces at the end are out of order.
fn disordered(curves: &[Points]) -> f64 {
    let ends: Vec<f64> = curves.iter().map(|points| sample_force(points, END)).collect();
    let wrong = |pair: &&[f64]| pair[0].partial_cmp(&pair[1]) != Some(std::cmp::Ordering::Greater);
    ends.windows(2).filter(wrong).count() as f64
}

/// Runs of Fig. 9.
pub fn plan_rates(_: &Extent) -> Vec<Job> {
    let mut jobs: Vec<Job> = RATES_9.map(|rate| Job::new(9, format!("mz-{rate}"), at_rate(rate))).to_vec();
    jobs.push(Job::new(9, "hsd-soft", [HERTZ.to_owned(), quasi_static()]));
    jobs.push(Job::new(9, "hsd-stiff", [HERTZ.to_owned(), STIFF.to_owned(), quasi_static()]));
    jobs
}

/// Fig. 9: strain rates between the two Hertz curves.
pub fn judge_rates(runs: &Runs, _: &Extent) -> Judged<Judgement> {
    let force = |name: &str| runs.get(9, name).map(force_strain);
    let curves = RATES_9.iter().map(|rate| force(&format!("mz-{rate}"))).collect::<Judged<Vec<Points>>>()?;
    let [soft, stiff] = [force("hsd-soft")?, force("hsd-stiff")?];
    let errors = curves.iter().zip(RATES_9).map(|(c, rate)| off_reference(c, rate)).collect::<Judged<Vec<f64>>>()?;
    let hsd = [off_hertz(&soft, PVDF.long_term), off_hertz(&stiff, PVDF.spontaneous())];
    let checks = vec![
        Check::at_most("quasi-static HSD off the Hertz curves of E_soft and E_stiff", SHARE, Unit::Percent, &hsd),
        Check::at_most("MZ off the independent integration of the law, per rate", SHARE, Unit::Percent, &errors),
        Check::at_most(
            "MZ outside the range between the Hertz curves, over the force",
            SHARE,
            Unit::Percent,
            &curves.iter().map(|points| outside(points)).collect::<Vec<_>>(),
        ),
        Check::within("pairs of rates out of order at 2 %", [0.0, 0.0], Unit::Plain, &[disordered(&curves)]),
    ];
    let mut series = vec![
        Series::new("HSD, quasi-static", Ink::Red, Style::Dashed, drawn(&stiff)),
        Series::new("", Ink::Red, Style::Dashed, drawn(&soft)),
    ];
    for ((points, rate), ink) in curves.iter().zip(RATES_9).zip(INKS) {
        series.push(Series::new(format!("MZ, {rate} 1/s"), ink, Style::Dashed, drawn(points)));
    }
    let panel = force_panel("Two PVDF spheres: strain rates (W Fig. 9)", series);
    Ok(Judgement { checks, panels: vec![("fig09".to_owned(), panel)] })
}

/// Runs of Fig. 10.
pub fn plan_relaxation(_: &Extent) -> Vec<Job> {
    let mut jobs = vec![Job::new(10, "relaxation", [])];
    jobs.extend(LIMITS.map(|rate| Job::new(10, format!("mz-{rate}"), limit(rate))));
    jobs
}

/// Fig. 10: relaxation, over time and over strain.
pub fn judge_relaxation(runs: &Runs, _: &Extent) -> Judged<Judgement> {
    let run = runs.get(10, "relaxation")?;
    let over_time = curve(&run.rows, |row| row.time, |row| row.stress[2] * AREA);
    let table = rows(RELAXATION).map_err(|error| error.to_string())?;
    let far = |row: &Vec<f64>| {
        let force = if row[0] < 1.0 { sample_force(&over_time, row[0]) } else { sample(&over_time, row[0]) };
        (force / row[1] - 1.0).abs()
    };
    let long_term = hertz(PVDF.long_term, END);
    let excess = |time: f64| sample(&over_time, time) - long_term;
    let relaxation_time = 4.0 / libm::log(excess(1.5) / excess(5.5));
    let limits = LIMITS.iter().map(|rate| runs.get(10, &format!("mz-{rate}")).map(force_strain));
    let limits = limits.collect::<Judged<Vec<Points>>>()?;
    let checks = vec![
        Check::at_most(
            "MZ off the independent integration of the law",
            SHARE,
            Unit::Percent,
            &[worst(table.iter().map(far))],
        ),
        Check::within(
            "force at 20 s over Hertz(E_soft)",
            [1.0 - SHARE, 1.0 + SHARE],
            Unit::Plain,
            &[sample(&over_time, 20.0) / long_term],
        ),
        Check::within(
            "relaxation time from the decay of 1.5 to 5.5 s",
            [1.799, 1.801],
            Unit::Of("s"),
            &[relaxation_time],
        ),
        Check::at_most(
            "MZ at 100 1/s and 2e-7 1/s off Hertz(E_stiff) and Hertz(E_soft)",
            SHARE,
            Unit::Percent,
            &[off_hertz(&limits[0], PVDF.spontaneous()), off_hertz(&limits[1], PVDF.long_term)],
        ),
    ];
    let milli = |points: &[(f64, f64)]| points.iter().map(|&(x, y)| (x, 1e3 * y)).collect::<Points>();
    let top = 1.08e3 * highest([&over_time]);
    let level = |y: f64| vec![(0.0, 1e3 * y), (20.0, 1e3 * y)];
    let time_panel = Panel {
        title: "Two PVDF spheres: relaxation (W Fig. 10a)".to_owned(),
        x_label: "time / s".to_owned(),
        y_label: "normal contact force / mN".to_owned(),
        x: [0.0, 20.0],
        y: [0.0, top],
        legend: Corner::LowerRight,
        series: vec![
            Series::new("MZ, 2 % in 1 s, then held", Ink::Red, Style::Solid, milli(&over_time)),
            Series::new("Hertz, E_soft", Ink::Black, Style::Dashed, level(long_term)),
            Series::new("τ = 1.8 s after the end of loading", Ink::Blue, Style::Dotted, vec![(2.8, 0.0), (2.8, top)]),
        ],
    };
    let strain_panel = force_panel(
        "Two PVDF spheres: relaxation (W Fig. 10b)",
        vec![
            Series::new("MZ, 100 1/s (spontaneous)", Ink::Blue, Style::Dashed, drawn(&limits[0])),
            Series::new("MZ, 2e-7 1/s (long-term)", Ink::Green, Style::Dashed, drawn(&limits[1])),
            Series::new("MZ, 2 % in 1 s, then held", Ink::Red, Style::Solid, drawn(&force_strain(run))),
        ],
    );
    Ok(Judgement { checks, panels: vec![("fig10a".to_owned(), time_panel), ("fig10b".to_owned(), strain_panel)] })
}

/// Runs of Fig. 12.
pub fn plan_finite_elements(_: &Extent) -> Vec<Job> {
    let mut jobs: Vec<Job> = RATES_12.map(|rate| Job::new(12, format!("mz-{rate}"), at_rate(rate))).to_vec();
    jobs.extend(LIMITS.map(|rate| Job::new(12, format!("mz-{rate}"), limit(rate))));
    jobs.push(Job::new(12, "hsd-soft", [HERTZ.to_owned()]));
    jobs.push(Job::new(12, "hsd-stiff", [HERTZ.to_owned(), STIFF.to_owned()]));
    jobs
}

/// Fig. 12: the side of the comparison that a discrete element code can make.
pub fn judge_finite_elements(runs: &Runs, _: &Extent) -> Judged<Judgement> {
    let force = |name: &str| runs.get(12, name).map(force_strain);
    let mz = |rate: &f64| force(&format!("mz-{rate}"));
    let curves = RATES_12.iter().map(mz).collect::<Judged<Vec<Points>>>()?;
    let limits = LIMITS.iter().map(mz).collect::<Judged<Vec<Points>>>()?;
    let [soft, stiff] = [force("hsd-soft")?, force("hsd-stiff")?];
    let known =
        curves.iter().zip(RATES_12).take(3).map(|(c, rate)| off_reference(c, rate)).collect::<Judged<Vec<f64>>>()?;
    // The reference table ends at 0.01 1/s; the theory of one contact covers what is slower.
    let slow = sample_force(&curves[3], END) / hertz(PVDF.long_term, END) / PVDF.stiffening(END / RATES_12[3]) - 1.0;
    let checks = vec![
        Check::at_most(
            "dynamic HSD off the Hertz curves of E_soft and E_stiff",
            SHARE,
            Unit::Percent,
            &[off_hertz(&soft, PVDF.long_term), off_hertz(&stiff, PVDF.spontaneous())],
        ),
        Check::at_most(
            "MZ at 100 1/s and 2e-7 1/s off Hertz(E_stiff) and Hertz(E_soft)",
            SHARE,
            Unit::Percent,
            &[off_hertz(&limits[0], PVDF.spontaneous()), off_hertz(&limits[1], PVDF.long_term)],
        ),
        Check::at_most("MZ off the independent integration of the law, 1 to 0.01 1/s", SHARE, Unit::Percent, &known),
        Check::at_most("MZ at 0.001 1/s and 2 % off the theory of one contact", SHARE, Unit::Percent, &[slow.abs()]),
        Check::at_most(
            "MZ outside the range between the HSD curves, over the force",
            SHARE,
            Unit::Percent,
            &curves.iter().map(|points| outside(points)).collect::<Vec<_>>(),
        ),
        Check::within("pairs of rates out of order at 2 %", [0.0, 0.0], Unit::Plain, &[disordered(&curves)]),
    ];
    let mut series = vec![
        Series::new("HSD, dynamic, E_stiff and E_soft", Ink::Red, Style::Solid, drawn(&stiff)),
        Series::new("", Ink::Red, Style::Solid, drawn(&soft)),
        Series::new("MZ, 100 1/s and 2e-7 1/s", Ink::Black, Style::Dotted, drawn(&limits[0])),
        Series::new("", Ink::Black, Style::Dotted, drawn(&limits[1])),
    ];
    for ((points, rate), ink) in curves.iter().zip(RATES_12).zip([Ink::Green, Ink::Orange, Ink::Purple, Ink::Blue]) {
        series.push(Series::new(format!("MZ, {rate} 1/s"), ink, Style::Dashed, drawn(points)));
    }
    let mut panel = force_panel("Two PVDF spheres at the rates of W's finite elements (W Fig. 12)", series);
    panel.series.drain(..2);
    Ok(Judgement { checks, panels: vec![("fig12".to_owned(), panel)] })
}
