//! What the sheet says of particles and cell.

use super::{COORDINATION, Estimate, Table, quantity};
use crate::config::{Config, PackingConfig};

/// Memory of a particle with its contacts and lists \[bytes\], as measured on dense packings.
const BYTES_PER_PARTICLE: f64 = 450.0;
/// The same while a checkpoint is written.
const BYTES_WHILE_WRITING: f64 = 2000.0;
/// Memory of a rank without particles \[bytes\]: the program with its libraries.
const BYTES_PER_RANK: f64 = 25e6;

/// What the particles of a run are, copies included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Found {
    /// Number of particles.
    pub particles: u64,
    /// Sides of the cell \[m\], if they are known before the packing is made.
    pub sides: Option<[f64; 3]>,
    /// Volume of all particles \[m³\].
    pub solid_volume: f64,
    /// Mass of all particles, without and with `density_scaling` \[kg\].
    pub mass: [f64; 2],
}

impl Found {
    /// As the input counts them; `None` if a file does that is not read yet.
    pub(super) fn counted(config: &Config) -> Option<Self> {
        if config.species.iter().all(|species| species.count == 0) {
            return None;
        }
        let copies = config.replication.number();
        let sides = config.cell.sides.map(|sides| config.replication.whole(sides));
        let mut found = Self { particles: 0, sides, solid_volume: 0.0, mass: [0.0; 2] };
        for species in &config.species {
            let material = &config.materials[species.material];
            let volume = copies as f64 * species.count as f64 * species.radius.mean_volume();
            found.particles = found.particles.saturating_add(copies.saturating_mul(species.count as u64));
            found.solid_volume += volume;
            found.mass[0] += volume * material.density;
            found.mass[1] += volume * material.density * material.density_scaling;
        }
        Some(found)
    }
}

fn amounts(table: &mut Table, found: &Found) {
    let count = found.particles as f64;
    let [mass, in_motion] = found.mass.map(|mass| quantity(mass, "kg"));
    table.row("mass", format!("{mass} (in motion: {in_motion})"));
    table.row("contacts expected", format!("{:.0} (coordination {COORDINATION})", count * COORDINATION / 2.0));
    let [run, writing] = [BYTES_PER_PARTICLE, BYTES_WHILE_WRITING].map(|bytes| 1e-6 * bytes * count);
    table.row(
        "memory",
        format!(
            "{:.1} MB for each rank and {run:.1} MB for all particles ({writing:.1} MB while a checkpoint is written)",
            1e-6 * BYTES_PER_RANK
        ),
    );
}

/// Rows about particles and cell.
pub(super) fn rows(table: &mut Table, config: &Config, estimate: &Estimate) {
    let file = match &config.packing {
        PackingConfig::File { path } => format!(" from {}", path.display()),
        _ => String::new(),
    };
    if let Some(found) = &estimate.found {
        let base = format!(" of {}", found.particles / config.replication.number().max(1));
        table.row("particles", format!("{}{file}{}", found.particles, copies_of(config, &base)));
        amounts(table, found);
    } else {
        table.row("particles", format!("{}{}", file.trim_start(), copies_of(config, "")));
    }
    for species in &config.species {
        let [mean, min, max] = [species.radius.mean(), species.radius.min(), species.radius.max()];
        let text = if min < max {
            format!("{} on average, {} to {}", quantity(mean, "m"), quantity(min, "m"), quantity(max, "m"))
        } else {
            quantity(mean, "m")
        };
        table.row(format!("radius of {}", species.name), text);
        if !species.is_spherical() {
            table.row(
                format!("semi-axes of {}", species.name),
                format!("up to {}", quantity(species.largest_semi_axis(), "m")),
            );
        }
    }
    let sides = estimate.found.and_then(|found| {
        let copies = config.replication.number() as f64;
        let by_volume = |fraction| config.cell.sides_at(found.solid_volume / copies / fraction);
        found.sides.or_else(|| Some(config.replication.whole(by_volume(estimate.solid_fraction?))))
    });
    if let Some(sides) = sides {
        let text = sides.map(|side| quantity(side, "m")).join(" × ");
        let known = estimate.found.is_some_and(|found| found.sides.is_some());
        table.row("cell", if known { text } else { format!("about {text}") });
    }
    if let Some(fraction) = estimate.solid_fraction {
        table.row("solid fraction", format!("{fraction:.3}"));
    }
}

/// `, 8 copies of 1000`, or nothing.
fn copies_of(config: &Config, base: &str) -> String {
    match config.replication.number() {
        1 => String::new(),
        copies => format!(" ({copies} copies{base})"),
    }
}
