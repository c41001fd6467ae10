//! Studies of strong and weak scaling: table on the terminal and as CSV, pictures as PNG.

use super::launch::{Folder, Layout, Measurement, Series, available_cores, measure};
use super::{BenchOptions, Plan, base_packing};
use crate::error::{Error, Result};
use crate::output::files::write_atomically;
use crate::output::plot::{Curve, draw_curves};
use std::fmt::Write;
use std::path::Path;

/// Particles of a study, and per core of a weak one, if none are given.
const PARTICLES: [usize; 2] = [100_000, 50_000];

/// One line of the table.
#[derive(Debug, Clone)]
struct Row {
    layout: Layout,
    median: Measurement,
    range: [f64; 2],
    /// Rate over that of the first layout.
    speed_up: f64,
    /// Rate per core over that of the first layout.
    efficiency: f64,
}

/// Run the study and write `scaling.csv`, `speed_up.png` and `efficiency.png`.
///
/// # Errors
/// A case fails or a file cannot be written.
pub fn study(options: &BenchOptions) -> Result<()> {
    let (name, default) = if options.weak { ("weak", PARTICLES[1]) } else { ("strong", PARTICLES[0]) };
    let particles = match options.particles[..] {
        [] => default,
        [particles] => particles,
        _ => return Err(Error::Input(format!("--{name} takes one number of --particles"))),
    };
    let layouts = if options.layouts.is_empty() { growing(available_cores()) } else { options.layouts.clone() };
    let default_folder = format!("bench-{name}");
    let folder = Folder::new(Some(options.output.as_deref().unwrap_or(Path::new(&default_folder))))?;
    let plan = Plan::new(particles, None);
    let file = base_packing(folder.path(), plan, options)?;
    let mut series = vec![Series::default(); layouts.len()];
    for repeat in 0..options.repeats {
        for (layout, series) in layouts.iter().zip(&mut series) {
            let sized = if options.weak { plan.times(layout.cores()) } else { plan };
            let one = measure(&file, sized.copies, *layout, options)?;
            eprintln!("repeat {} of {}: {layout} {:.4e} particle-steps/s", repeat + 1, options.repeats, one.rate);
            series.add(one);
        }
    }
    let rows = rows(&layouts, &series);
    let csv = csv(&rows);
    print(&rows);
    let path = |file: &str| folder.path().join(file);
    write_atomically(&path("scaling.csv"), csv.as_bytes())?;
    let title = if options.weak {
        format!("Weak scaling, {} particles per core", plan.particles())
    } else {
        format!("Strong scaling, {} particles", plan.particles())
    };
    let most = rows.iter().map(|row| row.layout.cores()).max().unwrap_or(1) as f64;
    let first = rows.first().map_or(1.0, |row| row.layout.cores() as f64);
    let ideal = |end: f64| Curve { label: "ideal".into(), points: vec![(first, 1.0), (most, end)] };
    let with = |ideal: Curve, value: fn(&Row) -> f64| [vec![ideal], curves(&rows, value)].concat();
    let speed_up = with(ideal(most / first), |row| row.speed_up);
    let efficiency = with(ideal(1.0), |row| row.efficiency);
    draw_curves(&path("speed_up.png"), &title, "cores", "speed-up", &speed_up)?;
    draw_curves(&path("efficiency.png"), &title, "cores", "parallel efficiency", &efficiency)?;
    say!("\ntable and pictures in {}", folder.path().display());
    Ok(())
}

/// Powers of two up to the number of cores, as ranks and as threads.
fn growing(cores: usize) -> Vec<Layout> {
    let powers = || (0..usize::BITS).map(|k| 1_usize << k).take_while(|n| *n <= cores);
    let ranks = powers().map(|ranks| Layout { ranks, threads: 1 });
    ranks.chain(powers().skip(1).map(|threads| Layout { ranks: 1, threads })).collect()
}

fn rows(layouts: &[Layout], series: &[Series]) -> Vec<Row> {
    let reference = series.first().map_or(1.0, |series| series.median().rate);
    let first = layouts.first().map_or(1, |layout| layout.cores()) as f64;
    let row = |(layout, series): (&Layout, &Series)| {
        let median = series.median();
        let speed_up = median.rate / reference;
        let efficiency = speed_up * first / layout.cores() as f64;
        Row { layout: *layout, median, range: series.range(), speed_up, efficiency }
    };
    layouts.iter().zip(series).map(row).collect()
}

fn csv(rows: &[Row]) -> String {
    let mut text = "particles,ranks,threads,particle_steps_per_s,slowest_repeat_per_s,fastest_repeat_per_s,speed_up,\
                    efficiency,halo_share,reduce_share,imbalance,coordination,bytes_per_particle,\
                    peak_bytes_per_particle\n"
        .to_owned();
    for Row { layout, median, range: [low, high], speed_up, efficiency } in rows {
        let Measurement { particles, rate, halo, reduce, imbalance, coordination, bytes, peak_bytes, .. } = median;
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{particles},{},{},{rate},{low},{high},{speed_up:.4},{efficiency:.4},{halo:.4},{reduce:.4},{imbalance},\
             {coordination},{bytes},{peak_bytes}",
            layout.ranks, layout.threads
        );
    }
    text
}

fn print(rows: &[Row]) {
    say!(
        "{:>10} {:>7} {:>16} {:>9} {:>10} {:>7} {:>7} {:>9} {:>11}",
        "particles",
        "layout",
        "particle-steps/s",
        "speed-up",
        "efficiency",
        "halo",
        "reduce",
        "imbalance",
        "B/particle"
    );
    for Row { layout, median, speed_up, efficiency, .. } in rows {
        say!(
            "{:>10} {:>7} {:>16.4e} {speed_up:>9.3} {efficiency:>10.3} {:>6.1}% {:>6.1}% {:>9.3} {:>11.0}",
            median.particles,
            layout.to_string(),
            median.rate,
            100.0 * median.halo,
            100.0 * median.reduce,
            median.imbalance,
            median.bytes
        );
    }
}

/// A curve over cores for ranks alone, one for threads alone, one for each number of threads between.
fn curves(rows: &[Row], value: fn(&Row) -> f64) -> Vec<Curve> {
    let curve = |label: String, belongs: &dyn Fn(Layout) -> bool| {
        let points: Vec<(f64, f64)> =
            rows.iter().filter(|row| belongs(row.layout)).map(|row| (row.layout.cores() as f64, value(row))).collect();
        Curve { label, points }
    };
    let mut all = vec![
        curve("ranks of one thread".into(), &|layout| layout.threads == 1),
        curve("threads of one rank".into(), &|layout| layout.ranks == 1),
    ];
    let mut between: Vec<usize> =
        rows.iter().map(|row| row.layout).filter(|l| l.ranks > 1 && l.threads > 1).map(|l| l.threads).collect();
    between.sort_unstable();
    between.dedup();
    all.extend(between.into_iter().map(|threads| {
        curve(format!("ranks of {threads} threads"), &|layout| layout.ranks > 1 && layout.threads == threads)
    }));
    // One case alone on an axis is on the other's curve already.
    all.retain(|curve| curve.points.len() > 1 || curve.label.starts_with("ranks of"));
    all.retain(|curve| !curve.points.is_empty());
    for curve in &mut all {
        curve.points.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(layouts: &[Layout], rates: &[f64]) -> Vec<Row> {
        let series = rates.iter().map(|rate| {
            let mut series = Series::default();
            series.add(Measurement { rate: *rate, particles: 8.0, ..Measurement::default() });
            series
        });
        rows(layouts, &series.collect::<Vec<_>>())
    }

    #[test]
    fn speed_up_and_efficiency_are_relative_to_the_first_layout() {
        let layouts = ["2x1", "4x1", "1x2", "2x4"].map(|text| text.parse::<Layout>().expect("layout"));
        let rows = measured(&layouts, &[10.0, 15.0, 8.0, 30.0]);
        assert_eq!(rows.iter().map(|row| row.speed_up).collect::<Vec<_>>(), [1.0, 1.5, 0.8, 3.0]);
        assert_eq!(rows.iter().map(|row| row.efficiency).collect::<Vec<_>>(), [1.0, 0.75, 0.8, 0.75]);
        let curves = curves(&rows, |row| row.speed_up);
        assert_eq!(curves.len(), 2, "{curves:?}");
        assert_eq!(curves[0].points, [(2.0, 1.0), (4.0, 1.5)]);
        assert_eq!(curves[1].points, [(8.0, 3.0)]);
        let text = csv(&rows);
        let columns = |line: &str| line.split(',').count();
        assert!(text.lines().count() == 5 && text.lines().all(|line| columns(line) == 14), "{text}");
    }

    #[test]
    fn layouts_grow_by_powers_of_two() {
        let texts: Vec<String> = growing(5).iter().map(Layout::to_string).collect();
        assert_eq!(texts, ["1x1", "2x1", "4x1", "1x2", "1x4"]);
    }
}
