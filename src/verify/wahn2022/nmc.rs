//! W Fig. 14: 250 NMC spheres; quasi-static and dynamic elastic runs, and Maxwell–Zener ones that are slow.

use super::assembly::{
    Packings, Variant, at_rate, differences, hertz, jobs, magnitudes, packings, quasi_static, ratios, series,
};
use super::check::{Check, Unit};
use super::curves::{NMC, Points, highest};
use super::job::{Job, Runs};
use super::{Extent, Judged, Judgement};
use crate::output::plot::{Corner, Ink, Panel, Style};

const FIGURE: u32 = 14;
/// Final strain.
const END: f64 = 0.01;
/// Strain of the comparison \[%\].
const AT: f64 = 1.0;
/// Loading times of the Maxwell–Zener runs \[s\].
const TIMES: [f64; 3] = [10.0, 50.0, 100.0];
/// Strain rate squared times density scaling \[1/s²\].
const INERTIA: f64 = 1e4;

fn variants() -> Vec<Variant> {
    let elastic = |more: Vec<String>| [vec![hertz("wahn")], more].concat();
    let bc = || vec!["load.kinematics=BC".to_owned()];
    let rate = END / 1.0;
    let mut variants = vec![
        Variant::new("hsd-static", elastic(vec![quasi_static(1e-4, END)])),
        Variant::new("hsd-bct", elastic(at_rate(rate, INERTIA / (rate * rate), END))),
        Variant::new("hsd-bc", elastic([at_rate(rate, INERTIA / (rate * rate), END), bc()].concat())),
        Variant::new("hsd-bct-w", elastic(at_rate(rate, 1e9, END))),
        Variant::new("hsd-bc-w", elastic([at_rate(rate, 1e9, END), bc()].concat())),
    ];
    variants.extend(TIMES.map(|time| {
        let rate = END / time;
        Variant::new(format!("mz-{time}"), at_rate(rate, INERTIA / (rate * rate), END))
    }));
    variants
}

/// Runs of Fig. 14.
pub fn plan(extent: &Extent) -> Vec<Job> {
    jobs(FIGURE, &variants(), extent)
}

/// Fig. 14.
pub fn judge(runs: &Runs, extent: &Extent) -> Judged<Judgement> {
    let all = Packings { figure: FIGURE, runs, seeds: &extent.seeds };
    let fixed = all.stress("hsd-static")?;
    let [bct, bc] = [all.stress("hsd-bct")?, all.stress("hsd-bc")?];
    let [bct_w, bc_w] = [all.stress("hsd-bct-w")?, all.stress("hsd-bc-w")?];
    let mz = TIMES.iter().map(|time| all.stress(&format!("mz-{time}"))).collect::<Judged<Vec<Vec<Points>>>>()?;
    let off = |curves: &[Points]| magnitudes(&differences(curves, &fixed, AT));
    let theory = |time: f64| NMC.stiffening(time);
    let over_theory = |index: usize, time: f64| -> Vec<f64> {
        ratios(&mz[index], &bct, AT).into_iter().map(|ratio| ratio / theory(time)).collect()
    };
    let checks = vec![
        Check::at_most("HSD dynamic BCT off quasi-static at 1 %", 0.05, Unit::Percent, &off(&bct)),
        Check::at_most("HSD dynamic BC off quasi-static at 1 %", 0.05, Unit::Percent, &off(&bc)),
        Check::at_most(
            "HSD, BC off BCT at 1 % (W: about 3 %)",
            0.05,
            Unit::Percent,
            &magnitudes(&differences(&bc, &bct, AT)),
        ),
        Check::at_most("with W's inertia: HSD dynamic BCT off quasi-static at 1 %", 0.05, Unit::Percent, &off(&bct_w)),
        Check::at_most("with W's inertia: HSD dynamic BC off quasi-static at 1 %", 0.05, Unit::Percent, &off(&bc_w)),
        Check::at_most("W: MZ over 10 s off quasi-static HSD at 1 %", 0.05, Unit::Percent, &off(&mz[0])).or_finding(
            "W's claim cannot hold with W's constants: τ = η/E_1 = 5.95 s is as long as the loading, so each contact \
             alone is 15.9 % above its long-term spring after 10 s (next line).",
        ),
        Check::within(
            "MZ over 10 s above quasi-static HSD at 1 %",
            [0.12, 0.20],
            Unit::Percent,
            &differences(&mz[0], &fixed, AT),
        ),
        Check::within(
            "MZ over 10 s over HSD dynamic BCT, over the theory of one contact",
            [0.98, 1.02],
            Unit::Plain,
            &over_theory(0, 10.0),
        ),
        Check::within(
            "MZ over 50 s over HSD dynamic BCT, over the theory of one contact",
            [0.98, 1.02],
            Unit::Plain,
            &over_theory(1, 50.0),
        ),
        Check::at_most("MZ over 50 s off quasi-static HSD at 1 %", 0.06, Unit::Percent, &off(&mz[1])),
        Check::at_most("MZ over 100 s off quasi-static HSD at 1 %", 0.05, Unit::Percent, &off(&mz[2])),
    ];
    let top = highest(mz[0].iter().chain(&fixed).chain(&bc));
    let end = 100.0 * END;
    let panel = Panel {
        title: format!("250 NMC spheres, {} (W Fig. 14)", packings(extent)),
        x_label: "strain / %".to_owned(),
        y_label: "stress σ_zz / MPa".to_owned(),
        x: [0.0, end],
        y: [0.0, 1.05 * top],
        legend: Corner::UpperLeft,
        series: vec![
            series("HSD, quasi-static", Ink::Red, Style::Solid, &fixed, end),
            series("HSD, dynamic BCT, 1 s", Ink::Black, Style::Dashed, &bct, end),
            series("HSD, dynamic BC, 1 s", Ink::Grey, Style::Solid, &bc, end),
            series("MZ, BCT, 10 s", Ink::Green, Style::Dashed, &mz[0], end),
            series("MZ, BCT, 50 s", Ink::Blue, Style::Dashed, &mz[1], end),
            series("MZ, BCT, 100 s", Ink::Sky, Style::Dotted, &mz[2], end),
        ],
    };
    Ok(Judgement { checks, panels: vec![("fig14".to_owned(), panel)] })
}
