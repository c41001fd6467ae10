//! Reads cell, packing, time step, output and parallel layout.

use super::alternatives::Chosen;
use super::section::Section;
use super::{
    Boundary, CellConfig, DropAndRollConfig, MAX_THREADS, OutputConfig, PackingConfig, ParallelConfig, Replication,
    SimdConfig, Species, TimeStepConfig,
};
use std::path::{Path, PathBuf};

/// Read `[cell]`.
pub(super) fn read_cell(root: &Section, materials: &[String]) -> Option<CellConfig> {
    let section = root.table("cell")?;
    let sides = section.axes("sides");
    let solid_fraction = section.number("solid_fraction");
    let aspect = if section.given("sides") { Some([1.0; 3]) } else { section.axes("aspect") };
    if section.given("sides") {
        for key in ["solid_fraction", "aspect"].into_iter().filter(|key| section.given(key)) {
            section.problem(key, "given together with `sides`, which settle it", "remove one of the two");
        }
    }
    let words = section.axis_words("boundary");
    let walls = section.axis_words("wall_material");
    let mut faulty = (section.given("sides") && sides.is_none()) || words.iter().any(Option::is_none);
    let boundary = [0, 1, 2].map(|axis| {
        if words[axis].as_deref() != Some("walls") {
            return Boundary::Periodic;
        }
        let Some(name) = &walls[axis] else {
            let message = format!("missing for the walls of the {} axis", ["x", "y", "z"][axis]);
            section.problem("wall_material", message, "name a [[material]], for example wall_material = \"steel\"");
            faulty = true;
            return Boundary::Periodic;
        };
        if let Some(material) = super::particles::find_material(&section, "wall_material", name, materials) {
            Boundary::Walls { material }
        } else {
            faulty = true;
            Boundary::Periodic
        }
    });
    if section.given("wall_material") && !words.iter().flatten().any(|word| word == "walls") {
        section.problem("wall_material", "no axis has walls", "remove it, or set boundary = {z = \"walls\", …}");
    }
    (!faulty).then_some(CellConfig { sides, aspect: aspect?, solid_fraction, boundary })
}

/// Read `[packing]`; paths are relative to `folder`.
pub(super) fn read_packing(
    root: &Section,
    folder: &Path,
    cell: Option<&CellConfig>,
) -> Option<(PackingConfig, Replication)> {
    match root.choose("packing")? {
        Chosen::Table("file", section) => {
            let replication = read_replication(&section, cell);
            let path = folder.join(section.text("path")?);
            if path.is_dir() {
                let message = format!("{} is a folder", path.display());
                section.problem("path", message, "name the particle file in it");
                return None;
            }
            if !path.is_file() {
                let message = format!("there is no file {}", path.display());
                section.problem("path", message, "the path is relative to the folder of this input");
                return None;
            }
            // Absolute, so that the resolved text runs from wherever it is kept.
            let path = std::path::absolute(&path).unwrap_or(path);
            section.record_text("path", &path.to_string_lossy());
            Some((PackingConfig::File { path }, replication?))
        }
        Chosen::Table("relaxation", section) => {
            let (tolerance, max_steps) = (section.number("tolerance"), section.integer("max_steps"));
            let replication = read_replication(&section, cell);
            let packing = PackingConfig::Relaxation { tolerance: tolerance?, max_steps: max_steps? as usize };
            Some((packing, replication?))
        }
        Chosen::Table("drop_and_roll", section) => {
            let (margin, remaining_overlap) = (section.number("margin"), section.number("remaining_overlap"));
            let replication = read_replication(&section, cell);
            let settings = DropAndRollConfig { margin: margin?, remaining_overlap: remaining_overlap? };
            Some((PackingConfig::DropAndRoll(settings), replication?))
        }
        Chosen::Table(_, section) => {
            let contraction_rate = section.number("contraction_rate");
            let max_moves_per_particle = section.number("max_moves_per_particle");
            let replication = read_replication(&section, cell);
            let packing = PackingConfig::RandomClose {
                contraction_rate: contraction_rate?,
                max_moves_per_particle: max_moves_per_particle?,
            };
            Some((packing, replication?))
        }
        Chosen::Value(_) => None,
    }
}

/// Read what both kinds of packings share.
fn read_replication(section: &Section, cell: Option<&CellConfig>) -> Option<Replication> {
    let copies = if section.given("replicate") { section.integers3("replicate") } else { Some([1; 3]) };
    let perturbation = section.number("perturbation");
    let copies = copies?;
    for axis in (0..3).filter(|&axis| copies[axis] > 1) {
        if cell.is_some_and(|cell| cell.boundary[axis] != Boundary::Periodic) {
            let message = format!("{} copies along the {} axis, which has walls", copies[axis], ["x", "y", "z"][axis]);
            section.problem("replicate", message, "give 1 for this axis, or make its boundary periodic");
            return None;
        }
    }
    Some(Replication { copies, perturbation: perturbation? })
}

/// Spheres that fill more than this cannot be packed (the densest packing of equal spheres).
const DENSEST: f64 = 0.7405;
/// The densest packing known of ellipsoids (Donev et al. 2004, doi:10.1103/PhysRevLett.92.255506).
const DENSEST_OF_ELLIPSOIDS: f64 = 0.7708;

/// Longest side of a cell over the smallest diameter: beyond, positions do not resolve the overlaps of contacts any more.
pub const MOST_DIAMETERS: f64 = 1e9;

/// Solid fraction assumed where a random packing finds its own.
pub(super) const RANDOM_CLOSE: f64 = 0.635;

/// Whether cell, packing and particles fit together.
pub(super) fn check_cell(root: &Section, cell: &CellConfig, packing: &PackingConfig, species: &[Species]) {
    let Some(section) = root.reopened("cell") else { return };
    if let PackingConfig::File { path } = packing {
        if cell.sides.is_none() && is_table(path) {
            section.problem(
                "sides",
                "missing: packing.file with a table needs a cell of given sides",
                "add sides = [\"…\", \"…\", \"…\"]",
            );
        }
        return;
    }
    let spherical = species.iter().all(Species::is_spherical);
    if matches!(packing, PackingConfig::RandomClose { .. } | PackingConfig::DropAndRoll(_)) && !spherical {
        let remedy = "use [packing.relaxation], which packs ellipsoids too";
        root.problem("packing", "this packing holds spheres only, and a species has ellipsoids", remedy);
    }
    if matches!(packing, PackingConfig::Relaxation { .. }) && cell.boundary.iter().any(|b| *b != Boundary::Periodic) {
        let remedy = "make the boundary periodic, or use [packing.random_close] (spheres) or [packing.file]";
        root.problem("packing", "relaxation has no walls, and the cell has some", remedy);
    }
    if let PackingConfig::DropAndRoll(_) = packing {
        check_floor(&section, cell);
    }
    let smallest = 2.0 * species.iter().map(Species::smallest_semi_axis).fold(f64::INFINITY, f64::min);
    let longest = cell.sides.map_or(0.0, |sides| sides.into_iter().fold(0.0, f64::max));
    if longest > MOST_DIAMETERS * smallest {
        let message =
            format!("the longest side, {longest:e} m, is {:.1e} times the smallest diameter", longest / smallest);
        let remedy =
            format!("at most {MOST_DIAMETERS:e} times, or positions cannot tell what touches; look at the units");
        section.problem("sides", message, remedy);
        return;
    }
    let volume: f64 = species.iter().map(|s| s.count as f64 * s.radius.mean_volume()).sum();
    let (key, fraction) = match (cell.sides, cell.solid_fraction) {
        (Some(sides), _) => ("sides", volume / (sides[0] * sides[1] * sides[2])),
        (None, Some(fraction)) => ("solid_fraction", fraction),
        (None, None) => ("aspect", RANDOM_CLOSE),
    };
    if fraction > if spherical { DENSEST } else { DENSEST_OF_ELLIPSOIDS } {
        let message = format!("the particles would fill {fraction:.3} of the cell");
        let remedy = "spheres cannot fill more than 0.74, random ones about 0.64: use a larger cell or fewer particles";
        section.problem(key, message, remedy);
    }
    // Drop and roll knows its floor when it has drawn its particles, and one particle alone has its own images as neighbours.
    let alone = species.iter().map(|species| species.count).sum::<usize>() == 1;
    if cell.sides.is_none() && (alone || matches!(packing, PackingConfig::DropAndRoll(_))) {
        return;
    }
    let largest = 2.0 * species.iter().map(Species::largest_semi_axis).fold(0.0, f64::max);
    let (key, remedy) = if cell.sides.is_some() {
        ("sides", "make every side at least one diameter")
    } else {
        ("aspect", "use more particles, proportions nearer to 1, or a lower `solid_fraction`")
    };
    let sides = cell.sides.unwrap_or_else(|| cell.sides_at(volume / fraction));
    let mut thin = sides.into_iter().zip(["x", "y", "z"]).filter(|(side, _)| *side < largest);
    if cell.sides.is_none() && !section.given("aspect") {
        if let Some((side, _)) = thin.next() {
            let message =
                format!("the cell has sides of about {side:.3e} m, the largest particle {largest:e} m across");
            let remedy =
                "use more particles, a narrower distribution of sizes or shapes, or a lower cell.solid_fraction";
            root.problem("species", message, remedy);
        }
        return;
    }
    for (side, axis) in thin {
        let side = if cell.sides.is_some() { format!("{side:e}") } else { format!("about {side:.3e}") };
        let message = format!("side {axis} is {side} m, the largest particle {largest:e} m across");
        section.problem(key, message, remedy);
    }
}

impl CellConfig {
    /// Sides of a box of this volume in the proportions `aspect` \[m\].
    pub(super) fn sides_at(&self, volume: f64) -> [f64; 3] {
        let unit = libm::cbrt(volume / self.aspect.iter().product::<f64>());
        self.aspect.map(|proportion| proportion * unit)
    }
}

/// Whether drop and roll can fill the cell: periodic beside the bed, and as high as the bed becomes.
fn check_floor(section: &Section, cell: &CellConfig) {
    if let Some(axis) = (0..2).find(|axis| cell.boundary[*axis] != Boundary::Periodic) {
        let message = format!("packing.drop_and_roll cannot pack between walls of the {} axis", ["x", "y"][axis]);
        section.problem("boundary", message, "make x and y periodic, or use packing.random_close");
    }
    let height = "packing.drop_and_roll finds the height of the cell by itself";
    if cell.solid_fraction.is_some() {
        let remedy = "remove it (equal spheres attain about 0.58), or use packing.random_close";
        section.problem("solid_fraction", height, remedy);
    }
    if cell.sides.is_some() && cell.boundary[2] == Boundary::Periodic {
        section.problem("sides", height, "give `aspect` instead, or walls in z, or use packing.random_close");
    }
}

/// CSV and HDF5 tables hold no cell; the other formats do.
fn is_table(path: &Path) -> bool {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    matches!(extension.as_deref(), Some("csv" | "h5" | "hdf5"))
}

/// Read `[time_step]`.
pub(super) fn read_time_step(root: &Section) -> Option<TimeStepConfig> {
    match root.choose("time_step")? {
        Chosen::Value(value) => value.map(TimeStepConfig::Fixed),
        Chosen::Table(_, section) => {
            let (safety, reference_overlap) = (section.number("safety"), section.number("reference_overlap"));
            Some(TimeStepConfig::Automatic { safety: safety?, reference_overlap: reference_overlap? })
        }
    }
}

/// Read `[output]`; `stem` names the default directory.
pub(super) fn read_output(root: &Section, stem: &str) -> Option<OutputConfig> {
    let section = root.table("output")?;
    let directory = section.text_or("directory", &format!("runs/{stem}"));
    if directory.as_deref() == Some("") {
        section.problem("directory", "is empty", "name a folder, for example \"runs/first\"");
    }
    let history = section.interval("history");
    let snapshots = section.interval("snapshots");
    let snapshot_contacts = section.flag("snapshot_contacts");
    if snapshot_contacts == Some(true) && !section.given("snapshots") {
        section.problem("snapshot_contacts", "has no effect without snapshots", "add snapshots = \"1 s\" or remove it");
    }
    let dump = section.flag("dump");
    if dump == Some(true) && !section.given("snapshots") {
        section.problem("dump", "has no effect without snapshots", "add snapshots = \"1 s\" or remove it");
    }
    let checkpoint_steps = section.integer("checkpoint_steps");
    let checkpoint_wall_time = section.number("checkpoint_wall_time");
    let checkpoints_kept = section.integer("checkpoints_kept");
    let energy_ledger = section.flag("energy_ledger");
    let orientations = section.flag("orientations");
    let plots = section.flag("plots");
    Some(OutputConfig {
        directory: PathBuf::from(directory?),
        history: history?,
        snapshots,
        snapshot_contacts: snapshot_contacts?,
        dump: dump?,
        checkpoint_steps: checkpoint_steps?,
        checkpoint_wall_time,
        checkpoints_kept: usize::try_from(checkpoints_kept?).ok()?,
        energy_ledger: energy_ledger?,
        orientations: orientations?,
        plots: plots?,
    })
}

/// What the words of `simd` mean, in their order.
const SIMD_LEVELS: [SimdConfig; 4] = [SimdConfig::Auto, SimdConfig::Scalar, SimdConfig::Avx2, SimdConfig::Avx512];

/// Read `[parallel]`.
pub(super) fn read_parallel(root: &Section) -> Option<ParallelConfig> {
    let section = root.table("parallel")?;
    let grid = section.integers3("grid");
    let threads = section.integer("threads");
    if let Some(count) = threads.filter(|count| *count > u64::from(MAX_THREADS)) {
        section.problem("threads", format!("{count} threads per rank"), format!("allowed: 1 to {MAX_THREADS}"));
    }
    let skin = section.number("skin");
    let min_particles_per_rank = section.integer("min_particles_per_rank");
    let simd = section.choice("simd").map(|index| SIMD_LEVELS[index]);
    Some(ParallelConfig {
        grid,
        threads: threads.and_then(|count| usize::try_from(count).ok()),
        skin: skin?,
        min_particles_per_rank: usize::try_from(min_particles_per_rank?).ok()?,
        simd: simd?,
    })
}
