//! The pre-run sheet: what a run will be like, from the input alone. All numbers are estimates for
//! the reader's judgement; no simulation reads them.

mod particles;
mod quasi_static;

use super::programme::{Progress, advance};
use super::settings::RANDOM_CLOSE;
use super::{
    AxisControl, Config, MAX_STRAIN_PER_STEP, Material, PackingConfig, PairConfig, Routine, Species, TimeStepConfig,
};
use particles::Found;
use std::f64::consts::PI;
use std::fmt::Write as _;

/// Contacts per particle times two in a dense packing.
const COORDINATION: f64 = 6.0;
/// Solid fraction of equal spheres after drop and roll.
const DROP_AND_ROLL: f64 = 0.58;
/// Largest ε̇²·density_scaling \[1/s²\] at which packings near jamming still answer quasi-statically.
const INERTIA_LIMIT: f64 = 1e4;

/// The sheet as an aligned table with warnings below it.
/// With particles from a file it says more of an input that knows what the file holds (`setup::trial`).
#[must_use]
pub fn sheet(config: &Config) -> String {
    let estimate = Estimate::new(config);
    let mut table = Table::default();
    particles::rows(&mut table, config, &estimate);
    times(&mut table, config, &estimate);
    regime(&mut table, config, &estimate);
    quasi_static::rows(&mut table, config, &estimate);
    let mut text = format!("{}\n\n", config.title);
    let width = table.rows.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
    for (name, value) in &table.rows {
        let _ = writeln!(text, "{name:<width$}  {value}");
    }
    for warning in warnings(config, &estimate) {
        let _ = writeln!(text, "\nwarning: {warning}");
    }
    text
}

#[derive(Default)]
struct Table {
    rows: Vec<(String, String)>,
}

impl Table {
    fn row(&mut self, name: impl Into<String>, value: impl Into<String>) {
        self.rows.push((name.into(), value.into()));
    }
}

/// What several rows need.
struct Estimate {
    /// What the particles are, as far as input and file tell.
    found: Option<Found>,
    solid_fraction: Option<f64>,
    /// Largest overlap that the motion of cell and copies brings, over radius, and where it comes from.
    geometric: (f64, &'static str),
    /// Largest stress of the programme \[Pa\].
    stress: f64,
    /// Largest initial velocity \[m/s\].
    initial: f64,
    /// Largest strain rate of the programme \[1/s\].
    rate: f64,
    progress: Progress,
    /// Impact velocity expected \[m/s\].
    velocity: f64,
}

impl Estimate {
    fn new(config: &Config) -> Self {
        let found = Found::counted(config);
        let solid_fraction = match (&found, config.cell.sides, &config.packing) {
            (_, None, PackingConfig::DropAndRoll(_)) => Some(DROP_AND_ROLL),
            (Some(Found { solid_volume, sides: Some(sides), .. }), ..) => {
                Some(solid_volume / (sides[0] * sides[1] * sides[2]))
            }
            (None, ..) => None,
            _ => Some(config.cell.solid_fraction.unwrap_or(RANDOM_CLOSE)),
        };
        let mut progress = Progress::default();
        let (mut strain, mut rate, mut stress) = (0.0_f64, 0.0_f64, 0.0_f64);
        for stage in &config.stages {
            advance(&mut progress, stage);
            for axis in 0..3 {
                strain = strain.max(progress.strain[axis].unwrap_or(0.0));
                match stage.axes[axis] {
                    AxisControl::StrainRate(_) if stage.routine == Routine::QuasiStatic => {}
                    AxisControl::StrainRate(value) => rate = rate.max(value.abs()),
                    AxisControl::Stress { target, max_rate } => {
                        rate = rate.max(max_rate);
                        stress = stress.max(target);
                    }
                }
            }
            stress = stress.max(stage.until_stress.map_or(0.0, |(_, value)| value));
        }
        let largest = config.species.iter().map(Species::largest_semi_axis).fold(0.0, f64::max);
        let initial = config.species.iter().map(|s| norm(s.velocity) + 3.0 * s.velocity_deviation).fold(0.0, f64::max);
        // Radius over radius: strain ε brings centres 2R apart closer by 2εR.
        let mut geometric = (2.0 * strain, "strain");
        // Two touching spheres that both move towards each other.
        if 2.0 * config.replication.perturbation > geometric.0 {
            geometric = (2.0 * config.replication.perturbation, "perturbation");
        }
        let velocity = initial.max(rate * 2.0 * largest);
        Self { found, solid_fraction, geometric, stress, initial, rate, progress, velocity }
    }

    fn fraction(&self) -> f64 {
        self.solid_fraction.unwrap_or(RANDOM_CLOSE)
    }

    /// Overlap over radius expected of two species: what stress and impacts bring depends on their stiffness.
    fn overlap_of(&self, meeting: &Meeting) -> (f64, &'static str) {
        let force = force_of_pressure(self.stress, self.fraction(), meeting.radius);
        let under_stress = (meeting.overlap_under(force) / meeting.radius, "stress");
        let of_impact = (meeting.overlap_of_impact(2.0 * self.initial) / meeting.radius, "initial velocity");
        [under_stress, of_impact].into_iter().fold(self.geometric, |most, one| if one.0 > most.0 { one } else { most })
    }

    /// The largest of all species.
    fn largest_overlap(&self, config: &Config) -> (f64, &'static str) {
        let all = Meeting::all(config).map(|meeting| self.overlap_of(&meeting));
        all.fold(self.geometric, |most, one| if one.0 > most.0 { one } else { most })
    }
}

/// Force per contact under a pressure, `4πR²p/(Zφ)`, and back.
fn force_of_pressure(pressure: f64, fraction: f64, radius: f64) -> f64 {
    4.0 * PI * radius * radius * pressure / (COORDINATION * fraction)
}

fn pressure_of_force(force: f64, fraction: f64, radius: f64) -> f64 {
    COORDINATION * fraction * force / (4.0 * PI * radius * radius)
}

fn norm(v: [f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

/// Spontaneous Young's modulus: long-term spring and all branches.
fn spontaneous(young_modulus: f64, maxwell: &[super::MaxwellBranch]) -> f64 {
    young_modulus + maxwell.iter().map(|branch| branch.modulus).sum::<f64>()
}

fn smallest_mass(species: &Species, material: &Material) -> f64 {
    let radius = species.radius.min();
    4.0 / 3.0 * PI * radius * radius * radius * material.density * material.density_scaling
}

/// Two species in contact, with spontaneous moduli.
struct Meeting<'a> {
    pair: &'a PairConfig,
    modulus: f64,
    effective_radius: f64,
    effective_mass: f64,
    /// The smaller of the two largest radii \[m\].
    radius: f64,
}

impl<'a> Meeting<'a> {
    fn all(config: &'a Config) -> impl Iterator<Item = Self> {
        let species = &config.species;
        (0..species.len())
            .flat_map(move |a| (a..species.len()).map(move |b| Self::new(config, &species[a], &species[b])))
    }

    fn new(config: &'a Config, a: &Species, b: &Species) -> Self {
        let pair = &config.pairs[config.pair_index(a.material, b.material)];
        let compliance = [a, b].map(|s| {
            let material = &config.materials[s.material];
            (1.0 - material.poisson_ratio * material.poisson_ratio)
                / spontaneous(material.young_modulus, &material.maxwell)
        });
        let radii = [a.radius.max(), b.radius.max()];
        let masses = [a, b].map(|s| smallest_mass(s, &config.materials[s.material]));
        Self {
            pair,
            modulus: 1.0 / (compliance[0] + compliance[1]),
            effective_radius: radii[0] * radii[1] / (radii[0] + radii[1]),
            effective_mass: masses[0] * masses[1] / (masses[0] + masses[1]),
            radius: radii[0].min(radii[1]),
        }
    }

    /// Tangent stiffness `2 E_eff √(R_eff δ)` \[N/m\].
    fn stiffness(&self, overlap: f64) -> f64 {
        2.0 * self.modulus * (self.effective_radius * overlap).sqrt()
    }

    /// Hertz force \[N\].
    fn force(&self, overlap: f64) -> f64 {
        self.stiffness(overlap) * overlap * 2.0 / 3.0
    }

    fn overlap_under(&self, force: f64) -> f64 {
        let scaled = 0.75 * force / (self.modulus * self.effective_radius.sqrt());
        libm::pow(scaled, 2.0 / 3.0)
    }

    /// Largest overlap of an elastic impact, `(15 m_eff v²/(16 E_eff √R_eff))^{2/5}` \[m\].
    fn overlap_of_impact(&self, velocity: f64) -> f64 {
        let energy = self.effective_mass * velocity * velocity;
        libm::pow(15.0 * energy / (16.0 * self.modulus * self.effective_radius.sqrt()), 0.4)
    }
}

/// A time that contacts set, and the contact that sets it.
struct Limit {
    time: f64,
    pair: String,
    /// Overlap over radius of that contact.
    overlap: f64,
}

/// `√(m_min/K_max)` at these overlaps over radius \[s\], with the pair that sets K.
fn contact_time(config: &Config, overlap: impl Fn(&Meeting) -> f64) -> Option<Limit> {
    let mass =
        config.species.iter().map(|s| smallest_mass(s, &config.materials[s.material])).fold(f64::INFINITY, f64::min);
    let stiffnesses = Meeting::all(config).map(|meeting| {
        let overlap = overlap(&meeting);
        (meeting.stiffness(overlap * meeting.radius), overlap, meeting)
    });
    let (stiffness, overlap, meeting) = stiffnesses.max_by(|a, b| a.0.total_cmp(&b.0))?;
    let pair = meeting.pair.properties.names.join("-");
    (stiffness > 0.0).then(|| Limit { time: (mass / stiffness).sqrt(), pair, overlap })
}

/// Whether any particles are ellipsoids.
fn ellipsoids(config: &Config) -> bool {
    !config.species.iter().all(Species::is_spherical)
}

/// The automatic time step at these overlaps over radius \[s\], and the pair that limits it.
fn automatic_step(config: &Config, safety: f64, overlap: impl Fn(&Meeting) -> f64) -> Option<Limit> {
    let safety = safety.min(config.damped_safety(ellipsoids(config)));
    contact_time(config, overlap).map(|limit| Limit { time: safety * limit.time, ..limit })
}

fn times(table: &mut Table, config: &Config, estimate: &Estimate) {
    let (safety, reference) = match config.time_step {
        TimeStepConfig::Automatic { safety, reference_overlap } => (safety, reference_overlap),
        TimeStepConfig::Fixed(_) => (0.17, 1e-3),
    };
    let steps_at = [
        ("reference", automatic_step(config, safety, |_| reference)),
        ("expected", automatic_step(config, safety, |meeting| estimate.overlap_of(meeting).0)),
    ];
    for (name, limit) in &steps_at {
        let Some(Limit { time, pair, overlap }) = limit else { continue };
        let text = format!("{}, limited by K of {pair} at overlap/radius {overlap:.1e}", quantity(*time, "s"));
        table.row(format!("automatic Δt at {name} overlap"), text);
    }
    if let TimeStepConfig::Fixed(step) = config.time_step {
        table.row("Δt", format!("{} (fixed)", quantity(step, "s")));
    }
    table.row("Rayleigh time", quantity(rayleigh_time(config), "s"));
    match hertz_time(config, estimate.velocity) {
        Some(time) => {
            table.row(
                "Hertz time",
                format!("{} at {} (Δt must stay below half)", quantity(time, "s"), quantity(estimate.velocity, "m/s")),
            );
        }
        None => table.row("Hertz time", "none: nothing moves at the start"),
    }
    if config.stages.iter().all(|stage| stage.routine == Routine::QuasiStatic) {
        return;
    }
    let length = if estimate.progress.complete { "" } else { "at least " };
    let time = estimate.progress.time;
    table.row("time of all stages", format!("{length}{}", quantity(time, "s")));
    // The strain of one step is bounded too.
    let most = if estimate.rate > 0.0 { MAX_STRAIN_PER_STEP / estimate.rate } else { f64::INFINITY };
    let count = |step: f64| estimate.progress.steps + if time > 0.0 { time / step.min(most) } else { 0.0 };
    let steps: Vec<f64> = match config.time_step {
        TimeStepConfig::Fixed(step) => vec![count(step)],
        TimeStepConfig::Automatic { .. } => {
            steps_at.iter().filter_map(|(_, limit)| Some(count(limit.as_ref()?.time))).collect()
        }
    };
    let length = if estimate.progress.countable { "" } else { "at least " };
    let counts: Vec<String> = steps.iter().map(|count| format!("{count:.2e}")).collect();
    table.row("steps", format!("{length}{}", counts.join(" to ")));
}

/// Smallest `π R √(ρ/G)/(0.1631 ν + 0.8766)` over the species \[s\].
fn rayleigh_time(config: &Config) -> f64 {
    let of = |species: &Species| {
        let m = &config.materials[species.material];
        let shear = spontaneous(m.young_modulus, &m.maxwell) / (2.0 * (1.0 + m.poisson_ratio));
        let slowness = (m.density * m.density_scaling / shear).sqrt();
        PI * species.radius.min() * slowness / (0.1631 * m.poisson_ratio + 0.8766)
    };
    config.species.iter().map(of).fold(f64::INFINITY, f64::min)
}

/// Smallest duration of a contact, W (2.5), at this velocity \[s\].
fn hertz_time(config: &Config, velocity: f64) -> Option<f64> {
    let of = |species: &Species| {
        let m = &config.materials[species.material];
        let modulus = spontaneous(m.young_modulus, &m.maxwell);
        let density = m.density * m.density_scaling;
        let ratio =
            5.0 * std::f64::consts::SQRT_2 * PI * density * (1.0 - m.poisson_ratio * m.poisson_ratio) / (4.0 * modulus);
        2.94 * libm::pow(ratio, 0.4) * species.radius.min() / libm::pow(velocity, 0.2)
    };
    (velocity > 0.0).then(|| config.species.iter().map(of).fold(f64::INFINITY, f64::min))
}

fn regime(table: &mut Table, config: &Config, estimate: &Estimate) {
    let (overlap, cause) = estimate.largest_overlap(config);
    table.row("overlap/radius expected", format!("{overlap:.2e} (from {cause})"));
    if let Some(number) = inertial_number(config, estimate) {
        table.row("inertial number", format!("{number:.1e} (quasi-static near jamming: below about 2e-5)"));
    }
    for material in &config.materials {
        for branch in &material.maxwell {
            let product = estimate.rate * branch.relaxation_time;
            let text = format!("{product:.2e} (τ = {})", quantity(branch.relaxation_time, "s"));
            table.row(format!("strain rate × τ of {}", material.name), text);
        }
    }
    table.row(
        "strain rate² × density scaling",
        format!("{:.1e} 1/s² (quasi-static: below {INERTIA_LIMIT:.0e})", inertia(config, estimate)),
    );
}

fn inertia(config: &Config, estimate: &Estimate) -> f64 {
    let scaling = config.materials.iter().map(|m| m.density_scaling).fold(0.0, f64::max);
    estimate.rate * estimate.rate * scaling
}

/// `ε̇ · 2R √(ρ/p)`, p from the expected overlap.
fn inertial_number(config: &Config, estimate: &Estimate) -> Option<f64> {
    let heaviest = |s: &Species| {
        let material = &config.materials[s.material];
        2.0 * s.radius.mean() * (material.density * material.density_scaling).sqrt()
    };
    let size = config.species.iter().map(heaviest).fold(0.0, f64::max);
    let pressure_of = |meeting: Meeting| {
        let overlap = estimate.overlap_of(&meeting).0 * meeting.radius;
        pressure_of_force(meeting.force(overlap), estimate.fraction(), meeting.radius)
    };
    let pressure = Meeting::all(config).map(pressure_of).fold(0.0, f64::max);
    (pressure > 0.0 && estimate.rate > 0.0).then(|| estimate.rate * size / pressure.sqrt())
}

fn warnings(config: &Config, estimate: &Estimate) -> Vec<String> {
    let mut warnings = super::idle::warnings(config);
    let inertia = inertia(config, estimate);
    if inertia > 1.01 * INERTIA_LIMIT {
        warnings.push(format!(
            "strain rate² × density scaling is {inertia:.1e} 1/s²; above {INERTIA_LIMIT:.0e} inertia raises the stress of \
             packings near jamming (1.25 to 1.5 times at 1e6): lower density_scaling or the strain rate"
        ));
    }
    let overlap = estimate.largest_overlap(config).0;
    if overlap > config.max_overlap_fraction {
        warnings.push(format!(
            "the overlap expected, {overlap:.2} of the radius, exceeds contact.max_overlap_fraction = {}: the run would stop",
            config.max_overlap_fraction
        ));
    }
    if let (TimeStepConfig::Fixed(step), Some(automatic)) =
        (config.time_step, automatic_step(config, 0.17, |meeting| estimate.overlap_of(meeting).0.max(1e-3)))
        && step > automatic.time
        && config.stages.iter().any(|stage| stage.routine == Routine::Dynamic)
    {
        let limit = contact_time(config, |_| 1e-3).map_or(f64::INFINITY, |limit| 2.0 * limit.time);
        warnings.push(format!(
            "the fixed time step {} is larger than the automatic one, {}{}",
            quantity(step, "s"),
            quantity(automatic.time, "s"),
            if step > limit { "; it is unstable, and the run will refuse it" } else { "" }
        ));
    }
    warnings.extend(config.scaled_weights());
    let held = config.species.iter().any(|s| matches!(s.motion, super::Motion::Driven { .. }));
    for axis in (0..3).filter(|axis| config.gravity[*axis] != 0.0) {
        if config.cell.boundary[axis] == super::Boundary::Periodic && !held {
            let name = ["x", "y", "z"][axis];
            warnings.push(format!("gravity along the periodic {name} axis: everything falls for ever; give it walls"));
        }
    }
    warnings
}

/// Four digits with the unit.
fn quantity(value: f64, unit: &str) -> String {
    if value == 0.0 || (0.01..1e5).contains(&value) {
        let digits = if value < 1.0 { 4 } else { 2 };
        let text = format!("{value:.digits$}");
        return format!("{} {unit}", text.trim_end_matches('0').trim_end_matches('.'));
    }
    format!("{value:.3e} {unit}")
}

#[cfg(test)]
mod tests;
