//! W Fig. 15: 250 PVDF spheres at several strain rates; with little inertia, and with W's own.

use super::assembly::{
    Packings, STIFF, Variant, at_rate, differences, hertz, jobs, magnitudes, packings, quasi_static, ratios, series,
};
use super::check::{Check, Unit};
use super::curves::{PVDF, Points, grid, highest, sample, spread};
use super::job::{Job, Runs};
use super::{Extent, Judged, Judgement, density};
use crate::output::plot::{Corner, Ink, Panel, Series, Style};

const FIGURE: u32 = 15;
/// Final strain.
const END: f64 = 0.005;
/// Strain of the comparison \[%\].
const AT: f64 = 0.5;
/// Strain at which inertia shows \[%\].
const EARLY: f64 = 0.1;
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

const OWN_INKS: [Ink; 7] = [Ink::Purple, Ink::Blue, Ink::Sky, Ink::Green, Ink::Orange, Ink::Brown, Ink::Black];

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
    [jobs(FIGURE, &variants(), extent), density::plan(FIGURE, extent)].concat()
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

/// The curves of the figure: per variant one per packing.
struct Curves {
    /// Quasi-static with E_soft and E_stiff.
    fixed: [Vec<Points>; 2],
    /// Dynamic elastic with E_soft and E_stiff.
    soft: Vec<Points>,
    stiff: Vec<Points>,
    /// Maxwell–Zener, by [`RATES`].
    mz: Vec<Vec<Points>>,
    /// With W's inertia, by [`WITH_INERTIA`]: Maxwell–Zener, and elastic with E_soft.
    own: Vec<Vec<Points>>,
    own_soft: Vec<Vec<Points>>,
}

impl Curves {
    fn of(all: &Packings) -> Judged<Self> {
        let with_inertia = |kind: &str| {
            let named = |&(rate, scaling): &(f64, f64)| all.stress(&format!("w-{kind}-{}", own_name(rate, scaling)));
            WITH_INERTIA.iter().map(named).collect::<Judged<Vec<Vec<Points>>>>()
        };
        Ok(Self {
            fixed: [all.stress("static-soft")?, all.stress("static-stiff")?],
            soft: all.stress("soft")?,
            stiff: all.stress("stiff")?,
            mz: RATES.iter().map(|rate| all.stress(&format!("mz-{rate}"))).collect::<Judged<Vec<_>>>()?,
            own: with_inertia("mz")?,
            own_soft: with_inertia("soft")?,
        })
    }
}

/// Fig. 15.
pub fn judge(runs: &Runs, extent: &Extent) -> Judged<Judgement> {
    let curves = Curves::of(&Packings { figure: FIGURE, runs, seeds: &extent.seeds })?;
    let mut checks = [little_inertia(&curves), own_inertia(&curves)].concat();
    let mut panels = panels(&curves, extent);
    if !extent.quick {
        let (of_density, panel) = density::judge(FIGURE, runs, "mz-1", extent)?;
        checks.extend(of_density);
        panels.push(("fig15density".to_owned(), panel));
    }
    Ok(Judgement { checks, panels })
}

/// MZ over its elastic companions, over the theory of one contact, at the end.
fn over_theory(curves: &[Points], soft: &[Points], rate: f64) -> Vec<f64> {
    ratios(curves, soft, AT).into_iter().map(|ratio| ratio / PVDF.stiffening(END / rate)).collect()
}

fn little_inertia(curves: &Curves) -> Vec<Check> {
    let Curves { fixed, soft, stiff, mz, .. } = curves;
    let theory: Vec<f64> = mz.iter().zip(RATES).flat_map(|(mz, rate)| over_theory(mz, soft, rate)).collect();
    let between = |mz: &[Vec<Points>], low: &[Points], high: &[Points]| -> Vec<f64> {
        let of_rate = |mz: &Vec<Points>| {
            mz.iter()
                .zip(low.iter().zip(high))
                .map(|(curve, (low, high))| outside(curve, low, high))
                .collect::<Vec<_>>()
        };
        mz.iter().flat_map(of_rate).collect()
    };
    // From one rate to the next slower one; positive is in order.
    let drops: Vec<f64> = mz.windows(2).flat_map(|pair| differences(&pair[0], &pair[1], AT)).collect();
    let off = |curves: &[Points], fixed: &[Points]| magnitudes(&differences(curves, fixed, AT));
    vec![
        Check::within(
            "drop of the MZ stress from each rate to the next slower one at 0.5 %",
            [0.0, f64::INFINITY],
            Unit::Percent,
            &drops,
        ),
        Check::at_most(
            "MZ outside the range of the dynamic elastic runs, over the stress",
            0.005,
            Unit::Percent,
            &between(mz, soft, stiff),
        ),
        Check::at_most(
            "MZ at W's rates outside the range of the quasi-static curves",
            0.02,
            Unit::Percent,
            &between(&mz[..OF_W], &fixed[0], &fixed[1]),
        ),
        // Contacts that form on the way are younger than the loading: the packing is a little stiffer.
        Check::within(
            "MZ over elastic E_soft at 0.5 %, over the theory of one contact, all rates",
            [0.99, 1.015],
            Unit::Plain,
            &theory,
        ),
        Check::within(
            "MZ at 1e-4 1/s over elastic E_soft at 0.5 %",
            [1.0, 1.03],
            Unit::Plain,
            &ratios(&mz[7], soft, AT),
        ),
        Check::within(
            "MZ at 1e-5 1/s over elastic E_soft at 0.5 %: the soft limit",
            [0.995, 1.005],
            Unit::Plain,
            &ratios(&mz[8], soft, AT),
        ),
        Check::at_most("dynamic elastic off quasi-static at 0.5 %, E_soft", 0.02, Unit::Percent, &off(soft, &fixed[0])),
        Check::at_most(
            "dynamic elastic off quasi-static at 0.5 %, E_stiff",
            0.02,
            Unit::Percent,
            &off(stiff, &fixed[1]),
        ),
    ]
}

fn own_inertia(curves: &Curves) -> Vec<Check> {
    let Curves { own, own_soft, fixed, .. } = curves;
    let last = WITH_INERTIA.len() - 1;
    let [viscous, elastic] = [own, own_soft].map(|curves| ratios(&curves[0], &curves[last], EARLY));
    let alike: Vec<f64> = viscous.iter().zip(&elastic).map(|(a, b)| a / b).collect();
    let theory: Vec<f64> = own
        .iter()
        .zip(own_soft)
        .zip(WITH_INERTIA)
        .flat_map(|((mz, soft), (rate, _))| over_theory(mz, soft, rate))
        .collect();
    let excess: Vec<f64> = own_soft.iter().flat_map(|soft| ratios(soft, &fixed[0], EARLY)).collect();
    vec![
        Check::within(
            "W's inertia: MZ stress at 10 1/s over that at 0.02 1/s, at 0.1 % strain",
            [1.0, 1.02],
            Unit::Plain,
            &viscous,
        )
        .or_finding(
            "The law itself gives 1.003: τ = 1.8 s is long against these loading times, at every one of W's rates the \
             branch is all but rigid. The order that W draws, and the stiffness at the start, are inertia: the elastic \
             runs with the same inertia show both (next lines).",
        ),
        Check::within("the same ratio over that of elastic E_soft", [0.95, 1.05], Unit::Plain, &alike),
        Check::within(
            "W's inertia: elastic E_soft over quasi-static E_soft at 0.1 % strain, all runs",
            [0.98, 1.02],
            Unit::Plain,
            &excess,
        )
        .or_finding("Inertia alone; it fades by 0.3 % (picture). Undamped as in W, the lighter packings go on vibrating and end some per cent softer."),
        Check::within(
            "W's inertia: MZ over elastic E_soft at 0.5 %, over the theory of one contact",
            [0.96, 1.04],
            Unit::Plain,
            &theory,
        ),
    ]
}

/// Curves over those of a companion, from a tenth of the strain on (before, both are next to nothing).
fn relative(label: String, ink: Ink, style: Style, curves: &[Points], companions: &[Points]) -> Series {
    let at = &grid(AT, 100)[10..];
    let ratio = |(a, b): (&Points, &Points)| at.iter().map(|&x| (x, sample(a, x) / sample(b, x))).collect::<Points>();
    let spread = spread(&curves.iter().zip(companions).map(ratio).collect::<Vec<_>>(), at);
    Series { label, points: spread.mean, band: spread.band, ink, style }
}

fn panels(curves: &Curves, extent: &Extent) -> Vec<(String, Panel)> {
    let Curves { fixed, soft, stiff, mz, own, own_soft } = curves;
    let panel = |title: &str, y_label: &str, y: [f64; 2], legend: Corner, series: Vec<Series>| Panel {
        title: format!("{title}, {} (W Fig. 15)", packings(extent)),
        x_label: "strain / %".to_owned(),
        y_label: y_label.to_owned(),
        x: [0.0, AT],
        y,
        legend,
        series,
    };
    let style = |index: usize| if index < OF_W { Style::Dashed } else { Style::Solid };
    let name = |rate: f64| format!("MZ, {rate} 1/s");
    let lines = |series: Series| Series { band: Vec::new(), ..series };

    let mut stress = vec![
        series("HSD, quasi-static, E_stiff and E_soft", Ink::Red, Style::Solid, &fixed[1], AT),
        series("", Ink::Red, Style::Solid, &fixed[0], AT),
        lines(series("HSD, dynamic, E_stiff and E_soft", Ink::Black, Style::Dotted, stiff, AT)),
        lines(series("", Ink::Black, Style::Dotted, soft, AT)),
    ];
    let mut ratio = vec![
        relative("HSD, dynamic, E_stiff".to_owned(), Ink::Black, Style::Dotted, stiff, soft),
        relative("HSD, quasi-static, E_stiff and E_soft".to_owned(), Ink::Red, Style::Solid, &fixed[1], soft),
        relative(String::new(), Ink::Red, Style::Solid, &fixed[0], soft),
    ];
    for (index, (points, rate)) in mz.iter().zip(RATES).enumerate() {
        // Nine bands on top of each other hide the curves.
        stress.push(lines(series(name(rate), INKS[index], style(index), points, AT)));
        ratio.push(relative(name(rate), INKS[index], style(index), points, soft));
    }
    let mut inertia = vec![
        relative("HSD, quasi-static, E_stiff and E_soft".to_owned(), Ink::Red, Style::Solid, &fixed[1], &fixed[0]),
        relative(String::new(), Ink::Red, Style::Solid, &fixed[0], &fixed[0]),
    ];
    for (index, (rate, scaling)) in WITH_INERTIA.iter().enumerate() {
        let label = format!("MZ, {rate} 1/s, density × {scaling:e}");
        inertia.push(lines(relative(label, OWN_INKS[index], Style::Dashed, &own[index], &fixed[0])));
        let label = if index == last_of(&WITH_INERTIA) { "dotted: HSD, E_soft, the same" } else { "" };
        inertia.push(lines(relative(label.to_owned(), OWN_INKS[index], Style::Dotted, &own_soft[index], &fixed[0])));
    }
    let top = 1.05 * highest(stiff.iter().chain(&fixed[1]));
    vec![
        ("fig15".to_owned(), panel("250 PVDF spheres", "stress σ_zz / MPa", [0.0, top], Corner::UpperLeft, stress)),
        (
            "fig15ratio".to_owned(),
            panel("250 PVDF spheres", "stress over HSD, dynamic, E_soft", [0.95, 1.9], Corner::UpperRight, ratio),
        ),
        (
            "fig15inertia".to_owned(),
            panel(
                "250 PVDF spheres, W's inertia",
                "stress over HSD, quasi-static, E_soft",
                [0.8, 2.6],
                Corner::UpperRight,
                inertia,
            ),
        ),
    ]
}

fn last_of<T>(list: &[T]) -> usize {
    list.len().saturating_sub(1)
}
