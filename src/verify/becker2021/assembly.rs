//! A periodic assembly of ellipsoids, compressed and unloaded: how many contacts are in which regime.

use super::{Figure, run};
use crate::error::Result;
use crate::force::observe::Wanted;
use crate::force::plastic::Regime;
use crate::output::plot::{Corner, Ink, Panel, Series, Style};
use crate::output::snapshot::SnapshotContacts;
use crate::verify::wahn2022::check::{Check, Unit};
use std::path::Path;

/// Steps between looks.
const INTERVAL: u64 = 200;

/// A look at the assembly.
struct Look {
    /// Volumetric strain, compression positive.
    strain: f64,
    /// Mean stress \[Pa\].
    pressure: f64,
    /// Share of the touching contacts that is elastic, elastic–plastic, fully plastic, unloading.
    shares: [f64; 4],
}

const REGIMES: [(Regime, &str, Ink); 4] = [
    (Regime::Elastic, "elastic", Ink::Sky),
    (Regime::ElasticPlastic, "elastic–plastic", Ink::Orange),
    (Regime::Plastic, "fully plastic", Ink::Red),
    (Regime::Unloading, "unloading", Ink::Black),
];

fn shares(contacts: &SnapshotContacts) -> [f64; 4] {
    let column = contacts.columns.iter().flatten().position(|column| column.name == "regime");
    let regimes: Vec<f64> = match column {
        Some(column) => contacts.memory.iter().skip(column).step_by(contacts.width).copied().collect(),
        None => Vec::new(),
    };
    REGIMES.map(|(regime, ..)| {
        regimes.iter().filter(|found| **found == regime.number()).count() as f64 / regimes.len() as f64
    })
}

/// Compress and unload; the shares over the strain.
pub fn regimes(output: &Path) -> Result<Figure> {
    let mut looks: Vec<Look> = Vec::new();
    run(
        output,
        "assembly",
        &[],
        |global| {
            let due = global.step.is_multiple_of(INTERVAL);
            Wanted { sums: due, samples: due }
        },
        |simulation, report| {
            let global = simulation.global();
            let volume = |sides: [f64; 3]| sides[0] * sides[1] * sides[2];
            looks.push(Look {
                strain: 1.0 - volume(global.sides) / volume(global.initial_sides),
                pressure: (report.row.stress[0] + report.row.stress[1] + report.row.stress[2]) / 3.0,
                shares: shares(&simulation.snapshot_contacts(&report.samples)),
            });
            Ok(())
        },
    )?;
    let turn = looks.windows(2).position(|pair| pair[1].strain < pair[0].strain).unwrap_or(looks.len() - 1);
    // Between the last two looks before the turn lie steps of unloading.
    let (loaded, unloaded) = (&looks[turn.saturating_sub(1)], &looks[looks.len() - 1]);
    let largest_pressure = looks.iter().map(|look| look.pressure).fold(0.0, f64::max);
    let yielded = |look: &Look| look.shares[1] + look.shares[2];
    let sum_off = looks.iter().skip(1).map(|look| (look.shares.iter().sum::<f64>() - 1.0).abs());
    let checks = vec![
        // The memory tells the regime of the last step: contacts that touch for the first time have none yet.
        Check::at_most(
            "largest share of contacts too new for a regime",
            0.01,
            Unit::Percent,
            &[sum_off.fold(0.0, f64::max)],
        ),
        Check::within("share beyond yield at the start", [0.0, 0.0], Unit::Percent, &[yielded(&looks[1])]),
        Check::within(
            "share on the loading curve beyond yield, at the largest strain",
            [0.2, 1.0],
            Unit::Percent,
            &[yielded(loaded)],
        ),
        Check::within(
            "share that has yielded, at the largest strain",
            [0.5, 1.0],
            Unit::Percent,
            &[yielded(loaded) + loaded.shares[3]],
        ),
        Check::within("share unloading after unloading", [0.2, 1.0], Unit::Percent, &[unloaded.shares[3]]),
        Check::within(
            "mean stress after unloading over the largest",
            [0.0, 0.6],
            Unit::Plain,
            &[unloaded.pressure / largest_pressure],
        ),
    ];
    let highest = looks.iter().map(|look| look.strain).fold(0.0, f64::max);
    let of = |part: &[Look], k: usize| part.iter().skip(1).map(|l| (100.0 * l.strain, 100.0 * l.shares[k])).collect();
    let mut series = Vec::new();
    for (k, (_, label, ink)) in REGIMES.into_iter().enumerate() {
        series.push(Series::new(label, ink, Style::Solid, of(&looks[..=turn], k)));
        series.push(Series::new("", ink, Style::Dashed, of(&looks[turn..], k)));
    }
    let x_label = "volumetric strain / %".to_owned();
    let shares = Panel {
        title: "Contacts by regime (solid: loading, dashed: unloading)".to_owned(),
        x_label: x_label.clone(),
        y_label: "share of touching contacts / %".to_owned(),
        x: [0.0, 102.0 * highest],
        y: [0.0, 105.0],
        legend: Corner::MiddleRight,
        series,
    };
    let stress: Vec<(f64, f64)> = looks.iter().map(|look| (100.0 * look.strain, 1e-6 * look.pressure)).collect();
    let top = stress.iter().map(|point| point.1).fold(0.0, f64::max);
    let stress = Panel {
        title: "Mean stress, loading and unloading".to_owned(),
        x_label,
        y_label: "mean stress / MPa".to_owned(),
        x: [0.0, 102.0 * highest],
        y: [0.0, 1.05 * top],
        legend: Corner::UpperLeft,
        series: vec![Series::new("3000 NMC ellipsoids", Ink::Blue, Style::Solid, stress)],
    };
    Ok(Figure {
        title: "An assembly of 3000 ellipsoids: contacts by regime",
        checks,
        panels: vec![("assembly_regimes", shares), ("assembly_stress", stress)],
    })
}
