//! W Fig. 15: 250 PVDF spheres at several strain rates; with little inertia, and with W's own.

use super::assembly::{
    Packings, STIFF, Variant, at_rate, differences, hertz, jobs, magnitudes, packings, quasi_static, ratios, series,
};
use super::check::{Check, Unit};
use super::curves::{PVDF, Points, grid, highest, sample};
use super::job::{Job, Runs};
use super::{Extent, Judged, Judgement};
use crate::output::plot::{Corner, Ink, Panel, Style};

const FIGURE: u32 = 15;
/// Final strain.
const END: f64 = 0.005;
/// Strain of the comparison \[%\].
const AT: f64 = 0.5;
/// Strain rate squared times density scaling \[1/s²\].
const INERTIA: f64 = 1e4;
/// W's strain rates, and slower ones down to the soft limit \[1/s\].
const RATES: [f64; 9] = [10.0, 1.0, 0.5, 0.2, 0.1, 0.02, 1e-3, 1e-4, 1e-5];
/// How many of them are W's.
const OF_W: usize = 6;
/// W's rates \[1/s\] and density scalings, as far as its text and time steps tell.
const WITH_INERTIA: [(f64, f64); 7] =
    [(10.0, 1e6), (1.0, 1e6), (1.0, 1e7), (0.5, 1e7), (0.2, 1e8), (0.1, 1e9), (0.02, 1e10)];
const INKS: [Ink; 9] =
    [Ink::Purple, Ink::Blue, Ink::Sky, Ink::Green, Ink::Orange, Ink::Brown, Ink::Purple, Ink::Blue, Ink::Green];

fn own_name(rate: f64, scaling: f64) -> String {
    format!("{rate}-{scaling:e}")
}

fn variants() -> Vec<Variant> {
    let elastic = |more: Vec<String>| [vec![hertz("tsuji")], more].concat();
    let fixed = || vec![hertz("wahn"), quasi_static(5e-5, END)];
    let mut variants = vec![
        Variant::new("static-soft", fixed()),
        Variant::new("static-stiff", [fixed(), vec![STIFF.to_owned()]].concat()),
        Variant::new("soft", elastic(at_rate(1.0, INERTIA, END))),
        Variant::new("stiff", elastic([at_rate(1.0, INERTIA, END), vec![STIFF.to_owned()]].concat())),
    ];
    variants.extend(RATES.map(|rate| Variant::new(format!("mz-{rate}"), at_rate(rate, INERTIA / (rate * rate), END))));
    for (rate, scaling) in WITH_INERTIA {
        let undamped = "contact.normal.maxwell_zener.damping=none".to_owned();
        let name = own_name(rate, scaling);
        variants.push(Variant::new(format!("w-mz-{name}"), [at_rate(rate, scaling, END), vec![undamped]].concat()));
        variants
            .push(Variant::new(format!("w-soft-{name}"), [vec![hertz("none")], at_rate(rate, scaling, END)].concat()));
    }
    variants
}

/// Runs of Fig. 15.
pub fn plan(extent: &Extent) -> Vec<Job> {
    jobs(FIGURE, &variants(), extent)
}

/// How far MZ leaves the range between its elastic companions, over the lower one, from 0.1 % strain on.
fn outside(curve: &Points, soft: &Points, stiff: &Points) -> f64 {
    grid(AT, 50)[10..].iter().fold(0.0, |most, &x| {
        let [stress, low, high] = [curve, soft, stiff].map(|points| sample(points, x));
        let out = if low - stress > stress - high { (low - stress) / low } else { (stress - high) / low };
        // NaN goes through.
        if out <= most { most } else { out }
    })
}

/// Fig. 15.
pub fn judge(runs: &Runs, extent: &Extent) -> Judged<Judgement> {
    let all = Packings { figure: FIGURE, runs, seeds: &extent.seeds };
    let [static_soft, static_stiff] = [all.stress("static-soft")?, all.stress("static-stiff")?];
    let [soft, stiff] = [all.stress("soft")?, all.stress("stiff")?];
    let mz = RATES.iter().map(|rate| all.stress(&format!("mz-{rate}"))).collect::<Judged<Vec<Vec<Points>>>>()?;
    let companions = |kind: &str| {
        let named = |&(rate, scaling): &(f64, f64)| all.stress(&format!("w-{kind}-{}", own_name(rate, scaling)));
        WITH_INERTIA.iter().map(named).collect::<Judged<Vec<Vec<Points>>>>()
    };
    let [own, own_soft] = [companions("mz")?, companions("soft")?];

    let over_theory: Vec<f64> = mz
        .iter()
        .zip(RATES)
        .flat_map(|(curves, rate)| {
            ratios(curves, &soft, AT).into_iter().map(move |ratio| ratio / PVDF.stiffening(END / rate))
        })
        .collect();
    let range: Vec<f64> = mz
        .iter()
        .flat_map(|curves| curves.iter().zip(soft.iter().zip(&stiff)).map(|(c, (low, high))| outside(c, low, high)))
        .collect();
    // From one rate to the next slower one; positive is in order.
    let drops: Vec<f64> = mz.windows(2).flat_map(|pair| differences(&pair[0], &pair[1], AT)).collect();
    let between = |curves: &[Points]| -> Vec<f64> {
        curves.iter().zip(static_soft.iter().zip(&static_stiff)).map(|(c, (low, high))| outside(c, low, high)).collect()
    };
    let outside_static: Vec<f64> = mz[..OF_W].iter().flat_map(|curves| between(curves)).collect();
    let own_over_companion: Vec<f64> = own
        .iter()
        .zip(&own_soft)
        .zip(WITH_INERTIA)
        .flat_map(|((curves, soft), (rate, _))| {
            ratios(curves, soft, AT).into_iter().map(move |ratio| ratio / PVDF.stiffening(END / rate))
        })
        .collect();
    let last = WITH_INERTIA.len() - 1;
    let checks = vec![
        Check::within(
            "MZ over elastic E_soft at 0.5 %, over the theory of one contact, all rates",
            [0.99, 1.01],
            Unit::Plain,
            &over_theory,
        ),
        Check::at_most(
            "MZ outside the range of the dynamic elastic runs, over the stress",
            0.01,
            Unit::Percent,
            &range,
        ),
        Check::within(
            "drop of the stress from each rate to the next slower one at 0.5 %",
            [-0.002, f64::INFINITY],
            Unit::Percent,
            &drops,
        ),
        Check::within(
            "MZ at 1e-4 1/s over elastic E_soft at 0.5 %",
            [1.0, 1.03],
            Unit::Plain,
            &ratios(&mz[7], &soft, AT),
        ),
        Check::within(
            "MZ at 1e-5 1/s over elastic E_soft at 0.5 %: the soft limit",
            [0.99, 1.01],
            Unit::Plain,
            &ratios(&mz[8], &soft, AT),
        ),
        Check::at_most(
            "dynamic elastic off quasi-static at 0.5 %, E_soft",
            0.05,
            Unit::Percent,
            &magnitudes(&differences(&soft, &static_soft, AT)),
        ),
        Check::at_most(
            "dynamic elastic off quasi-static at 0.5 %, E_stiff",
            0.05,
            Unit::Percent,
            &magnitudes(&differences(&stiff, &static_stiff, AT)),
        ),
        Check::at_most(
            "MZ at W's rates outside the range of the quasi-static curves",
            0.03,
            Unit::Percent,
            &outside_static,
        ),
        Check::within(
            "W: stress at 10 1/s over that at 0.02 1/s, with W's inertia, at 0.1 %",
            [1.0, 1.02],
            Unit::Plain,
            &ratios(&own[0], &own[last], 0.1),
        )
        .or_finding(
            "The law itself gives 1.003 (τ = 1.8 s is long against these loading times), so the order that W draws is \
             inertia: the elastic runs with the same inertia have it too (next line).",
        ),
        Check::within(
            "elastic E_soft at 10 1/s over that at 0.02 1/s, with W's inertia, at 0.1 %",
            [1.0, f64::INFINITY],
            Unit::Plain,
            &ratios(&own_soft[0], &own_soft[last], 0.1),
        ),
        Check::within(
            "MZ over elastic E_soft with W's inertia, over the theory of one contact, at 0.5 %",
            [0.9, 1.1],
            Unit::Plain,
            &own_over_companion,
        ),
    ];

    let end = 100.0 * END;
    let mut curves = vec![
        series("HSD, quasi-static, E_stiff and E_soft", Ink::Red, Style::Solid, &static_stiff, end),
        series("", Ink::Red, Style::Solid, &static_soft, end),
        series("HSD, dynamic, E_stiff and E_soft", Ink::Black, Style::Dotted, &stiff, end),
        series("", Ink::Black, Style::Dotted, &soft, end),
    ];
    for (index, (points, rate)) in mz.iter().zip(RATES).enumerate() {
        let style = if index < OF_W { Style::Dashed } else { Style::Solid };
        let mut line = series(format!("MZ, {rate} 1/s"), INKS[index], style, points, end);
        // Nine bands on top of each other hide the curves.
        line.band.clear();
        curves.push(line);
    }
    let top = 1.05 * highest(stiff.iter().chain(&static_stiff));
    let panel = |title: &str, top: f64, series| Panel {
        title: format!("250 PVDF spheres, {title}, {} (W Fig. 15)", packings(extent)),
        x_label: "strain / %".to_owned(),
        y_label: "stress σ_zz / MPa".to_owned(),
        x: [0.0, end],
        y: [0.0, top],
        legend: Corner::UpperLeft,
        series,
    };
    let mut own_curves = vec![
        series("HSD, quasi-static, E_stiff and E_soft", Ink::Red, Style::Solid, &static_stiff, end),
        series("", Ink::Red, Style::Solid, &static_soft, end),
    ];
    for (index, (rate, scaling)) in WITH_INERTIA.iter().enumerate() {
        let label = format!("MZ, {rate} 1/s, density × {scaling:e}");
        let mut line = series(label, INKS[index], Style::Dashed, &own[index], end);
        line.band.clear();
        own_curves.push(line);
        let mut line = series("", INKS[index], Style::Dotted, &own_soft[index], end);
        line.band.clear();
        own_curves.push(line);
    }
    let own_top = 1.05 * highest(own.iter().flatten());
    Ok(Judgement {
        checks,
        panels: vec![
            ("fig15".to_owned(), panel("little inertia", top, curves)),
            ("fig15w".to_owned(), panel("W's inertia (dotted: elastic E_soft with the same)", own_top, own_curves)),
        ],
    })
}
