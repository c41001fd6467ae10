//! From the checked input to a simulation ready to step: model, decomposition, packing or checkpoint.

mod begun;
mod overlap;
mod trial;

pub use trial::trial;

use crate::config::{
    Boundary, Config, Kinematics, Motion, PackingConfig, ParallelConfig, Replication, Routine, TimeStepConfig,
};
use crate::contact::build::BuildContext;
use crate::error::{Error, Result};
use crate::exchange::{
    Communicator, Decomposition, ExactSum, MigrationSetting, agree, distribute, exact_sum, redistribute,
};
use crate::force::cautions::{self, Sizes};
use crate::force::pass::{Bodies, PairPass};
use crate::force::simd::Simd;
use crate::force::slider::AT_STEP;
use crate::integrate::time_step::TimeStepControl;
use crate::load::LoadProgramme;
use crate::output::checkpoint::{self, Checkpoint};
use crate::packing::{self, Packing, Worst};
use crate::simulation::affine::affine_energy;
use crate::simulation::{FreeParticles, LeastScale, Model, Simulation};
use crate::state::particles::SpeciesConstants;
use crate::state::shape::{ellipsoid_mass, is_sphere, smallest_semi_axis};
use crate::state::{ContactMemory, GlobalState, ParticleState};
use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

/// Particles spread over the ranks in any way, with what belongs to them.
pub struct Initial {
    /// Global state, the same on every rank.
    pub global: GlobalState,
    /// Particles that this rank holds for now.
    pub particles: Vec<ParticleState>,
    /// Contact memory that this rank holds for now.
    pub memory: ContactMemory,
    /// Name and unit of each memory column of each pair of materials; empty where there is no memory yet.
    pub columns: Vec<Vec<[String; 2]>>,
}

/// What all ranks must know of all particles.
#[derive(Debug, Clone)]
struct Extremes {
    max_radius: f64,
    min_mass: f64,
    max_mass: f64,
    max_spin: f64,
    ellipsoids: bool,
    solid_volume: f64,
    sizes: Sizes,
    /// By species.
    free: Vec<FreeParticles>,
}

/// The packing as initial state. A packing that is neither replicated nor perturbed lies on rank 0, the
/// others hold nothing yet; else rank 0 makes one copy, all ranks get it, and each makes its block of ids.
///
/// # Errors
/// The packing cannot be made; the same error on every rank.
pub fn from_packing(comm: &Communicator, config: &Config) -> Result<Initial> {
    let built = if comm.rank() == 0 { packing::build(config).map(Some) } else { Ok(None) };
    let built = agree(comm, built)?;
    let mut header = Vec::new();
    let mut particles = Vec::new();
    if let Some(packing) = built {
        header.extend_from_slice(bytemuck::bytes_of(&packing.sides));
        header.extend_from_slice(&(packing.particles.len() as u64).to_le_bytes());
        particles = packing.particles;
    }
    comm.broadcast(0, &mut header);
    let mut sides: [f64; 3] = bytemuck::pod_read_unaligned(&header[..24]);
    let mut count: u64 = bytemuck::pod_read_unaligned(&header[24..32]);
    if config.replication != Replication::NONE {
        let base = Packing { sides, particles: broadcast_states(comm, &particles) };
        count = packing::replicate::total(config, base.particles.len())?;
        particles = packing::replicate::share(config, &base, own_block(comm, count));
        sides = config.replication.whole(sides);
    }
    let global = beginning(config, sides, count);
    begin_ledgers(config, &global, &mut particles);
    Ok(Initial { global, particles, memory: ContactMemory::new(0), columns: Vec::new() })
}

/// The global state at time 0, the first stage entered.
fn beginning(config: &Config, sides: [f64; 3], count: u64) -> GlobalState {
    let mut global = GlobalState {
        step: 0,
        time: 0.0,
        time_step: 0.0,
        previous_time_step: 0.0,
        initial_sides: sides,
        sides,
        strain: [0.0; 3],
        strain_rate: [0.0; 3],
        stage: 0,
        stage_start_time: 0.0,
        stage_start_strain: [0.0; 3],
        stage_start_step: 0,
        stage_start_stress: [0.0; 3],
        history_rows: 0,
        snapshots: 0,
        measured_stress: [0.0; 3],
        particles: count,
        quasi_static: None,
        previous_time: None,
        previous_stage: None,
    };
    programme(config).enter(&mut global);
    global
}

/// Where velocities are absolute, ledgers begin with the energy of the cell's motion.
fn begin_ledgers(config: &Config, global: &GlobalState, particles: &mut [ParticleState]) {
    if !config.output.energy_ledger || config.kinematics != Kinematics::Bc {
        return;
    }
    let (rate, species) = (LoadProgramme::side_rate(global), species_constants(config));
    let gradient = [0, 1, 2].map(|k| rate[k] / global.sides[k]);
    for particle in particles {
        let mass = ellipsoid_mass(particle.semi_axes, species[particle.species as usize].density);
        particle.ledger[0] += affine_energy(mass, particle.full_velocity, particle.position, gradient);
    }
}

/// The particles of rank 0 on every rank.
fn broadcast_states(comm: &Communicator, states: &[ParticleState]) -> Vec<ParticleState> {
    let mut bytes = bytemuck::cast_slice(states).to_vec();
    comm.broadcast(0, &mut bytes);
    bytemuck::pod_collect_to_vec(&bytes)
}

/// The ids that this rank begins with.
fn own_block(comm: &Communicator, total: u64) -> Range<u64> {
    let start = |rank| redistribute::block_start(rank, total, comm.size());
    start(comm.rank())..start(comm.rank() + 1)
}

/// Whether a checkpoint leads to the ends of stages that the input names.
pub enum Ends {
    /// It does.
    Kept,
    /// Older checkpoints of its run may: the present state lies beyond a new end, or an old one has cut its last step or increment;
    /// what has changed.
    PutOff(String),
    /// It does not: the end of a stage that is over has changed; which.
    Changed(String),
}

/// Compare the ends of stages that were over at a checkpoint with those of the input. Where the last stage of a complete run
/// now ends later, and a run without stop would have come by this state too, the checkpoint is taken back into that stage.
///
/// # Errors
/// An input that the checkpoint holds cannot be read.
pub fn compare_ends(config: &Config, checkpoint: &mut Checkpoint) -> Result<Ends> {
    let global = &mut checkpoint.global;
    let passed = begun::passed_ends(&checkpoint.config_resolved, &config.resolved, global)?;
    if passed.changes.is_empty() {
        return Ok(Ends::Kept);
    }
    let changes = passed.changes.join(", ");
    if passed.too_late {
        return Ok(Ends::PutOff(changes));
    }
    let programme = programme(config);
    let Some(reopened) = programme.reopened(global).filter(|_| passed.last_of_complete) else {
        return Ok(Ends::Changed(changes));
    };
    if programme.quasi_static_stage(&reopened).is_some() || !LoadProgramme::last_step_was_whole(global) {
        return Ok(Ends::PutOff(changes));
    }
    *global = reopened;
    Ok(Ends::Kept)
}

/// A checkpoint as initial state.
///
/// # Errors
/// The checkpoint belongs to another input (its species differ), or the input changes what no longer acts.
pub fn from_checkpoint(config: &Config, checkpoint: Checkpoint) -> Result<Initial> {
    let Checkpoint { mut global, mut particles, memory, columns, config_resolved, .. } = checkpoint;
    let had_ledger = begun::check(&config_resolved, &config.resolved, &global)?;
    let programme = programme(config);
    // A stage that was added to a complete run has not been entered yet.
    if global.step == global.stage_start_step {
        programme.enter(&mut global);
    }
    if !had_ledger {
        begin_ledgers(config, &global, &mut particles);
    }
    if programme.quasi_static_stage(&global).is_some() && global.quasi_static.is_none() {
        return Err(Error::Input(format!(
            "the checkpoint does not fit this input: it is from the middle of stage {}, which was dynamic and here is \
             quasi-static; restart with the stages of that run, or add one at the end",
            global.stage
        )));
    }
    Ok(Initial { global, particles, memory, columns })
}

/// The grid of ranks for a number of particles, and the ranks that it uses.
///
/// # Errors
/// An explicit grid that cannot work.
pub fn decomposition(comm: &Communicator, config: &Config, global: &GlobalState) -> Result<Decomposition> {
    let ParallelConfig { grid, min_particles_per_rank, .. } = config.parallel;
    match grid {
        Some(grid) => Decomposition::explicit(grid, comm.size()),
        None => Ok(Decomposition::automatic(comm.size(), global.particles, min_particles_per_rank, global.sides)),
    }
}

fn programme(config: &Config) -> LoadProgramme {
    LoadProgramme { stages: config.stages.clone(), kinematics: config.kinematics }
}

fn species_constants(config: &Config) -> Vec<SpeciesConstants> {
    let of_material = |index: usize| &config.materials[index];
    let constants = config.species.iter().map(|s| SpeciesConstants {
        density: of_material(s.material).density * of_material(s.material).density_scaling,
        driven: matches!(s.motion, Motion::Driven { .. }),
    });
    constants.collect()
}

/// The model: constants of species, passes, bounds, from the input and all particles.
///
/// # Errors
/// The memory of a checkpoint does not fit the laws of this input; the cell is too small for the
/// particles.
pub fn model(comm: &Communicator, config: &Arc<Config>, initial: &Initial) -> Result<Model> {
    let species = species_constants(config);
    let extremes = extremes(comm, &species, &initial.particles);
    let bodies = match extremes.sizes {
        _ if extremes.ellipsoids => Bodies::Ellipsoids,
        Sizes { smallest, .. } if smallest == extremes.max_radius => Bodies::EqualSpheres,
        _ => Bodies::Spheres,
    };
    let passes: Vec<_> = config.pairs.iter().map(|pair| PairPass::new(pair, bodies)).collect();
    let quasi_static = config.stages.iter().any(|stage| stage.routine == Routine::QuasiStatic);
    let static_passes = [config.quasi_static.restitution, 1.0].map(|restitution| {
        let pairs = config.pairs.iter().filter(|_| quasi_static);
        pairs.map(|pair| PairPass::new(&pair.artificially_damped(restitution), bodies)).collect()
    });
    let fraction = match config.time_step {
        TimeStepConfig::Automatic { reference_overlap, .. } => reference_overlap,
        TimeStepConfig::Fixed(_) => 1e-3,
    };
    let overlap = fraction * extremes.max_radius;
    let stiffnesses = passes.iter().map(|pass| pass.reference_stiffness(overlap, 0.5 * extremes.max_radius));
    let time_step = TimeStepControl {
        config: config.time_step,
        min_mass: extremes.min_mass,
        max_mass: extremes.max_mass,
        reference_overlap: overlap,
        reference_stiffness: stiffnesses.fold(0.0, |m, k| if k > m { k } else { m }),
        damped_safety: config.damped_safety(extremes.ellipsoids),
        quasi_static_safety: config.quasi_static_safety(extremes.ellipsoids),
    };
    let walls = config.cell.boundary.map(|boundary| match boundary {
        Boundary::Periodic => None,
        Boundary::Walls { material } => Some(material),
    });
    let lists = BuildContext {
        material: config.species.iter().map(|s| s.material).collect(),
        materials: config.materials.len(),
        columns: passes.iter().map(|pass| pass.columns().len()).collect(),
        walls,
        total: initial.global.particles as u32,
        skin: 0.0,
        stride: 0,
    };
    let turns = passes.iter().any(|pass| pass.width() > 4) || extremes.max_spin > 0.0 || extremes.ellipsoids;
    let cautions = cautions::of_run(config, extremes.sizes);
    let model = Model {
        config: Arc::clone(config),
        species,
        least_scale: LeastScale::new(config, &passes, &extremes.free),
        passes,
        static_passes,
        programme: programme(config),
        time_step,
        lists,
        max_radius: extremes.max_radius,
        solid_volume: extremes.solid_volume,
        ellipsoids: extremes.ellipsoids,
        rotation: turns,
        cautions,
        simd: agree(comm, Simd::choose(config.parallel.simd))?,
    };
    agree(comm, check_fit(&model, initial))?;
    Ok(model)
}

fn check_fit(model: &Model, initial: &Initial) -> Result<()> {
    let columns = checkpoint::named(&model.columns());
    if !initial.memory.keys.is_empty() && initial.columns != columns {
        let pairs = model.config.pairs.iter().map(|pair| pair.properties.names.join(" with "));
        let mut differing =
            pairs.zip(initial.columns.iter().zip(&columns)).filter(|(_, (found, needed))| found != needed);
        let difference = differing.next().map_or_else(
            || format!("it is of {} pairs of materials instead of {}", initial.columns.len(), columns.len()),
            |(pair, (found, needed))| format!("its contacts of {pair} {}", difference(found, needed)),
        );
        return Err(Error::Input(format!(
            "the checkpoint does not fit this input: {difference}; restart with the contact laws and the version of \
             that run (config.resolved.toml beside the checkpoint)"
        )));
    }
    let reach = 2.0 * model.max_radius + model.outer_skin();
    for (axis, side) in initial.global.sides.iter().enumerate() {
        // Contacts carry image shifts of at most three: one for the wrap and two for the reach.
        if model.lists.walls[axis].is_none() && 2.0 * side <= reach {
            return Err(Error::Packing(format!(
                "cell side {} is {side:.4e} m, less than half of the largest diameter with its skin, {reach:.4e} m: no \
                 periodic cell can be that thin; make the cell larger or use walls",
                ["x", "y", "z"][axis]
            )));
        }
    }
    Ok(())
}

/// How memory columns differ from those that the laws need.
fn difference(found: &[[String; 2]], needed: &[[String; 2]]) -> String {
    let missing_in = |columns: &[[String; 2]], other: &[[String; 2]]| {
        let missing = columns.iter().filter(|column| !other.contains(column));
        missing.map(|[name, unit]| format!("{name} ({unit})")).collect::<Vec<String>>().join(", ")
    };
    match (missing_in(found, needed), missing_in(needed, found)) {
        (extra, lacking) if extra.is_empty() && lacking.is_empty() => {
            "keep the same numbers in another order".to_owned()
        }
        (extra, lacking) if extra.is_empty() => format!("lack {lacking}"),
        (extra, lacking) if lacking.is_empty() => format!("keep {extra}, which the contact laws do not know"),
        (extra, lacking) if (extra.clone() + &lacking).contains(AT_STEP) => {
            format!("keep {extra} instead of {lacking} (springs lie half an increment ahead if any law has a dashpot)")
        }
        (extra, lacking) => format!("keep {extra} instead of {lacking}"),
    }
}

fn extremes(comm: &Communicator, species: &[SpeciesConstants], particles: &[ParticleState]) -> Extremes {
    let mut low = [f64::INFINITY; 2];
    let mut high = [0.0_f64; 5];
    // Number, radii and mass of the free particles of each species; at the end the volume of all.
    let mut sums = vec![ExactSum::new(); 3 * species.len() + 1];
    let raise = |place: &mut f64, value: f64| {
        if value > *place {
            *place = value;
        }
    };
    for particle in particles {
        let constants = species[particle.species as usize];
        let mass = ellipsoid_mass(particle.semi_axes, constants.density);
        sums[3 * species.len()].add(ellipsoid_mass(particle.semi_axes, 1.0));
        raise(&mut high[0], particle.radius);
        for spin in particle.spin {
            raise(&mut high[2], spin.abs());
        }
        let smallest = smallest_semi_axis(particle.semi_axes);
        if smallest < low[1] {
            low[1] = smallest;
        }
        raise(&mut high[4], particle.radius / smallest);
        if !is_sphere(particle.semi_axes) {
            high[3] = 1.0;
        }
        if !constants.driven {
            for (sum, term) in sums[3 * particle.species as usize..].iter_mut().zip([1.0, particle.radius, mass]) {
                sum.add(term);
            }
            raise(&mut high[1], mass);
            if mass < low[0] {
                low[0] = mass;
            }
        }
    }
    comm.min_f64(&mut low);
    comm.max_f64(&mut high);
    exact_sum::reduce(comm, &mut sums);
    let sums: Vec<f64> = sums.iter().map(ExactSum::value).collect();
    let (of_species, volume) = sums.as_chunks();
    let free =
        of_species.iter().map(|[number, radii, mass]| FreeParticles { number: *number, radii: *radii, mass: *mass });
    Extremes {
        max_radius: high[0],
        min_mass: low[0],
        max_mass: high[1],
        max_spin: high[2],
        ellipsoids: high[3] > 0.0,
        solid_volume: volume[0],
        free: free.collect(),
        sizes: Sizes { smallest: low[1], aspect_ratio: high[4] },
    }
}

/// What setting up took and found.
#[derive(Debug, Clone, Copy, Default)]
pub struct SetupReport {
    /// Bringing particles and contact memory to their owners \[s\].
    pub distribution: f64,
    /// Looking for overlaps in a packing that was made in parallel or relaxed \[s\].
    pub check: f64,
    /// First migration, halo, neighbour and contact lists \[s\].
    pub lists: f64,
    /// The largest overlap of a packing that was made in parallel or relaxed, if anything overlaps.
    pub overlap: Option<Worst>,
}

/// The simulation of this rank, its particles with their owners.
///
/// # Errors
/// As [`timed_simulation`].
pub fn simulation(
    comm: Communicator,
    config: &Arc<Config>,
    decomposition: Decomposition,
    initial: Initial,
    threads: usize,
) -> Result<Simulation> {
    timed_simulation(comm, config, decomposition, initial, threads).map(|(simulation, _)| simulation)
}

/// As [`simulation`], with what it took.
///
/// # Errors
/// As [`model`] and [`Simulation::new`]; particles of a replicated packing overlap too far.
pub fn timed_simulation(
    comm: Communicator,
    config: &Arc<Config>,
    decomposition: Decomposition,
    mut initial: Initial,
    threads: usize,
) -> Result<(Simulation, SetupReport)> {
    let mut report = SetupReport::default();
    let started = Instant::now();
    let mut model = model(&comm, config, &initial)?;
    model.lists.skin = model.inner_skin();
    model.lists.stride = model.line_stride();
    if initial.memory.keys.is_empty() {
        initial.memory = ContactMemory::new(model.lists.memory_width());
    }
    let setting = MigrationSetting {
        decomposition: &decomposition,
        species: &model.species,
        sides: initial.global.sides,
        extras: model.extras(),
        particles_total: initial.global.particles,
        step: initial.global.step,
    };
    let (mut particles, memory) = distribute(&comm, &setting, &initial.particles, &initial.memory)?;
    // Not needed any more; the lists need the room.
    initial.particles = Vec::new();
    initial.memory = ContactMemory::new(0);
    report.distribution = started.elapsed().as_secs_f64();
    let relaxed = matches!(config.packing, PackingConfig::DropAndRoll(_));
    if (relaxed || config.replication != Replication::NONE) && initial.global.step == 0 {
        let started = Instant::now();
        let space = overlap::Space { decomposition: &decomposition, sides: initial.global.sides, config };
        report.overlap = overlap::largest(&comm, &space, &mut particles, model.max_radius)?;
        report.check = started.elapsed().as_secs_f64();
    }
    let started = Instant::now();
    let simulation = Simulation::new(comm, model, decomposition, initial.global, particles, memory, threads)?;
    report.lists = started.elapsed().as_secs_f64();
    Ok((simulation, report))
}

/// Give what ranks beyond the first `ranks` hold to the ranks that compute.
///
/// # Errors
/// The exchange failed.
pub fn onto_first(comm: &Communicator, ranks: usize, initial: Initial) -> Result<Initial> {
    if ranks == comm.size() {
        return Ok(initial);
    }
    let mut sends = vec![Vec::new(); comm.size()];
    let mut memory_sends = vec![Vec::new(); comm.size()];
    let to = comm.rank() % ranks;
    sends[to].extend_from_slice(bytemuck::cast_slice(&initial.particles));
    memory_sends[to].extend_from_slice(bytemuck::cast_slice(&initial.memory.keys));
    let mut value_sends = vec![Vec::new(); comm.size()];
    value_sends[to].extend_from_slice(bytemuck::cast_slice(&initial.memory.values));
    let joined = |sends: Vec<Vec<u8>>| comm.all_to_all(sends).concat();
    let particles = bytemuck::pod_collect_to_vec(&joined(sends));
    let memory = ContactMemory {
        keys: bytemuck::pod_collect_to_vec(&joined(memory_sends)),
        width: initial.memory.width,
        values: bytemuck::pod_collect_to_vec(&joined(value_sends)),
    };
    Ok(Initial { particles, memory, ..initial })
}
