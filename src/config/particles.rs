//! Reads materials and species.

use super::alternatives::Chosen;
use super::diagnostic::did_you_mean;
use super::schema::quoted;
use super::section::Section;
use super::{Material, MaxwellBranch, Motion, RadiusDistribution, Species};

/// All materials: their names (also of faulty ones, so that no reference to them looks wrong) and,
/// if none is faulty, the materials.
pub(super) fn read_materials(root: &Section) -> (Vec<String>, Option<Vec<Material>>) {
    let sections = root.list("material");
    let materials: Vec<Option<Material>> = sections.iter().map(read_material).collect();
    let names = names_of(&sections);
    (names, materials.into_iter().collect())
}

/// Names of named sections; a name used twice is a problem.
fn names_of(sections: &[Section]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for section in sections {
        let name = if section.given("name") { section.text("name").unwrap_or_default() } else { String::new() };
        if !name.is_empty() && names.contains(&name) {
            section.problem("name", format!("the name \"{name}\" is used twice"), "give each one a name of its own");
        }
        names.push(name);
    }
    names
}

/// Index of a material by name, or a problem at `key` of `section`.
pub(super) fn find_material(section: &Section, key: &str, name: &str, names: &[String]) -> Option<usize> {
    let found = names.iter().position(|known| known == name);
    // Without any material, that is the problem to report, not each reference.
    if found.is_none() && !names.is_empty() {
        let known: Vec<&str> = names.iter().map(String::as_str).filter(|known| !known.is_empty()).collect();
        let near = did_you_mean(name, known.iter().copied());
        section.problem(
            key,
            format!("unknown material \"{name}\"{near}"),
            format!("known materials: {}", quoted(&known)),
        );
    }
    found
}

fn read_material(section: &Section) -> Option<Material> {
    let name = section.text("name");
    let density = section.number("density");
    let density_scaling = section.number("density_scaling");
    let young_modulus = section.number("young_modulus");
    let poisson_ratio = section.number("poisson_ratio");
    let yield_stress = section.number("yield_stress");
    let friction = section.number("friction");
    let restitution = section.number("restitution");
    let rolling_friction = section.number("rolling_friction");
    let twisting_friction = section.number("twisting_friction");
    let surface_energy = section.number("surface_energy");
    let maxwell: Vec<Option<MaxwellBranch>> = section.list("maxwell").iter().map(read_branch).collect();
    Some(Material {
        name: name?,
        density: density?,
        density_scaling: density_scaling?,
        young_modulus: young_modulus?,
        poisson_ratio: poisson_ratio?,
        maxwell: maxwell.into_iter().collect::<Option<_>>()?,
        yield_stress,
        friction: friction?,
        restitution: restitution?,
        rolling_friction: rolling_friction?,
        twisting_friction: twisting_friction?,
        surface_energy: surface_energy?,
    })
}

fn read_branch(section: &Section) -> Option<MaxwellBranch> {
    let modulus = section.number("modulus");
    let relaxation_time = section.number("relaxation_time");
    let viscosity = section.number("viscosity");
    match (section.given("relaxation_time"), section.given("viscosity")) {
        (true, false) => Some(MaxwellBranch { modulus: modulus?, relaxation_time: relaxation_time? }),
        (false, true) => {
            let modulus = modulus?;
            Some(MaxwellBranch { modulus, relaxation_time: viscosity? / modulus })
        }
        (both, _) => {
            let found = if both { "relaxation_time and viscosity are both given" } else { "the branch has no dashpot" };
            section.problem(
                "viscosity",
                found,
                "give relaxation_time or viscosity (relaxation_time = viscosity / modulus)",
            );
            None
        }
    }
}

/// Read all species. `from_file`: a file gives the particles, so counts have no place.
pub(super) fn read_species(root: &Section, materials: &[String], from_file: bool) -> Option<Vec<Species>> {
    let sections = root.list("species");
    let total = root.integer("particles");
    let species: Vec<Option<Species>> = sections.iter().map(|section| read_one(section, materials)).collect();
    let fractions: Vec<Option<f64>> = sections.iter().map(|section| section.number("fraction")).collect();
    let counts: Vec<Option<u64>> = sections.iter().map(|section| section.integer("count")).collect();
    names_of(&sections);
    let counts = if from_file {
        refuse_counts(root, &sections);
        vec![0; sections.len()]
    } else {
        share(root, &sections, total, &counts, &fractions)?
    };
    let species = species.into_iter().collect::<Option<Vec<Species>>>()?;
    Some(species.into_iter().zip(counts).map(|(one, count)| Species { count, ..one }).collect())
}

fn refuse_counts(root: &Section, sections: &[Section]) {
    let remedy = "remove it; packing.file gives the particles of every species";
    if root.given("particles") {
        root.problem("particles", "has no meaning with packing.file", remedy);
    }
    for section in sections {
        for key in ["count", "fraction"].into_iter().filter(|key| section.given(key)) {
            section.problem(key, "has no meaning with packing.file", remedy);
        }
    }
}

/// Numbers of particles per species, from counts or from shares of the total.
fn share(
    root: &Section,
    sections: &[Section],
    total: Option<u64>,
    counts: &[Option<u64>],
    fractions: &[Option<f64>],
) -> Option<Vec<usize>> {
    if sections.is_empty() {
        return None; // reported as such
    }
    let by_fraction = sections.iter().any(|section| section.given("fraction"));
    let (wanted, other) = if by_fraction { ("fraction", "count") } else { ("count", "fraction") };
    let mut complete = true;
    for section in sections {
        if section.given(other) {
            section.problem(
                other,
                "counts and fractions are mixed",
                "give every species a count, or every one a fraction",
            );
            complete = false;
        } else if !section.given(wanted) {
            section.problem(
                wanted,
                "missing",
                "give the species a `count`, or all a `fraction` and `particles` at the top",
            );
            complete = false;
        }
    }
    if by_fraction != root.given("particles") {
        let (message, remedy) = if by_fraction {
            ("missing, and species give fractions", "add `particles`, the number of all particles together")
        } else {
            ("has no meaning when species give counts", "remove it, or give every species a `fraction`")
        };
        root.problem("particles", message, remedy);
        complete = false;
    }
    if !complete {
        return None;
    }
    let counts = if by_fraction {
        let fractions = fractions.iter().copied().collect::<Option<Vec<f64>>>()?;
        let sum: f64 = fractions.iter().sum();
        if (sum - 1.0).abs() > 1e-9 {
            let last = sections.last()?;
            last.problem("fraction", format!("the fractions of all species sum to {sum}"), "make them sum to 1");
            return None;
        }
        let (total, mut enough) = (total?, true);
        let counts = largest_remainders(total, &fractions);
        for ((section, fraction), _) in sections.iter().zip(&fractions).zip(&counts).filter(|(_, count)| **count == 0) {
            let message = format!("the fraction {fraction} of {total} particles is not one particle");
            section.problem("fraction", message, "give more `particles` or a larger fraction, or remove the species");
            enough = false;
        }
        if !enough {
            return None;
        }
        counts
    } else {
        counts.iter().copied().collect::<Option<Vec<u64>>>()?
    };
    let all = counts.iter().fold(0_u64, |sum, count| sum.saturating_add(*count));
    if all > u64::from(u32::MAX) - 6 {
        root.problem(
            if by_fraction { "particles" } else { "species" },
            format!("{all} particles"),
            "at most 4294967289 fit",
        );
        return None;
    }
    counts.into_iter().map(|count| usize::try_from(count).ok()).collect()
}

/// Whole numbers that sum to `total` and are as near as can be to its shares.
fn largest_remainders(total: u64, fractions: &[f64]) -> Vec<u64> {
    let exact: Vec<f64> = fractions.iter().map(|fraction| fraction * total as f64).collect();
    let mut counts: Vec<u64> = exact.iter().map(|share| libm::floor(*share) as u64).collect();
    let mut order: Vec<usize> = (0..counts.len()).collect();
    order.sort_by(|a, b| (exact[*b] - libm::floor(exact[*b])).total_cmp(&(exact[*a] - libm::floor(exact[*a]))));
    let mut left = total.saturating_sub(counts.iter().sum());
    for index in order.iter().cycle().take(4 * counts.len()) {
        if left == 0 {
            break;
        }
        counts[*index] += 1;
        left -= 1;
    }
    counts
}

fn read_one(section: &Section, materials: &[String]) -> Option<Species> {
    let name = section.text("name");
    let material = section.text("material");
    let material = material.and_then(|name| find_material(section, "material", &name, materials));
    let size = super::shape::read(section, section.choose("radius").and_then(read_radius));
    let motion = section.choose("motion").and_then(read_motion);
    let driven = matches!(motion, Some(Motion::Driven { .. }));
    if driven {
        for key in ["velocity", "velocity_deviation", "spin"].into_iter().filter(|key| section.given(key)) {
            section.problem(
                key,
                "has no effect: the motion is prescribed",
                "remove it, or use motion.driven.velocity and .spin",
            );
        }
    }
    let start = if driven {
        Some(([0.0; 3], 0.0, [0.0; 3]))
    } else {
        let read = (section.axes("velocity"), section.number("velocity_deviation"), section.angular_axes("spin"));
        read.0.zip(read.1).zip(read.2).map(|((velocity, deviation), spin)| (velocity, deviation, spin))
    };
    let ((radius, shape), (velocity, velocity_deviation, spin)) = (size?, start?);
    Some(Species {
        name: name?,
        material: material?,
        radius,
        shape,
        count: 0,
        motion: motion?,
        velocity,
        velocity_deviation,
        spin,
    })
}

fn read_motion(chosen: Chosen) -> Option<Motion> {
    match chosen {
        Chosen::Table("driven", section) => {
            let (velocity, spin) = (section.axes("velocity"), section.angular_axes("spin"));
            Some(Motion::Driven { velocity: velocity?, spin: spin? })
        }
        Chosen::Table("fixed", _) => Some(Motion::Driven { velocity: [0.0; 3], spin: [0.0; 3] }),
        _ => Some(Motion::Free),
    }
}

fn read_radius(chosen: Chosen) -> Option<RadiusDistribution> {
    match chosen {
        Chosen::Table("normal", section) => {
            let (mean, deviation) = (section.number("mean"), section.number("deviation"));
            let (mean, deviation) = (mean?, deviation?);
            let lowest = mean - 3.0 * deviation;
            if lowest <= 0.0 && !section.given("min") {
                let message = format!("missing: mean - 3 deviation = {lowest:e} m is no radius");
                section.problem("min", message, "give `min` (greater than 0), or a smaller deviation");
                return None;
            }
            let (min, max) = (section.number_or("min", lowest), section.number_or("max", mean + 3.0 * deviation));
            let (min, max) = ordered(&section, min?, max?, mean)?;
            Some(RadiusDistribution::Normal { mean, deviation, min, max })
        }
        Chosen::Table("lognormal", section) => {
            let (median, sigma) = (section.number("median"), section.number("sigma"));
            let (median, sigma) = (median?, sigma?);
            let min = section.number_or("min", median * libm::exp(-3.0 * sigma));
            let max = section.number_or("max", median * libm::exp(3.0 * sigma));
            let (min, max) = ordered(&section, min?, max?, median)?;
            Some(RadiusDistribution::Lognormal { median, sigma, min, max })
        }
        Chosen::Table(_, section) => {
            let (radius, weight) = (section.numbers("radius"), section.numbers("weight"));
            let (radius, weight) = (radius?, weight?);
            if radius.len() != weight.len() {
                let message = format!("{} weights for {} radii", weight.len(), radius.len());
                section.problem("weight", message, "give one weight per radius");
                return None;
            }
            if weight.iter().sum::<f64>() <= 0.0 {
                section.problem("weight", "the weights sum to 0", "give at least one radius a weight greater than 0");
                return None;
            }
            Some(RadiusDistribution::Tabulated { radius, weight })
        }
        Chosen::Value(value) => value.map(RadiusDistribution::Fixed),
    }
}

/// The cut must leave the middle of the distribution in.
fn ordered(section: &Section, min: f64, max: f64, middle: f64) -> Option<(f64, f64)> {
    let key = if section.given("min") { "min" } else { "max" };
    if let Some(radius) = [min, max].into_iter().find(|radius| !(radius * radius * radius).is_normal()) {
        let message = format!("a sphere of radius {radius:e} m has no volume that a number can hold");
        section.problem(key, message, "give `min` and `max`, or lower the width of the distribution");
        return None;
    }
    if min < max && min <= middle && middle <= max {
        return Some((min, max));
    }
    section.problem(
        key,
        format!("min {min:e} m and max {max:e} m do not enclose {middle:e} m"),
        "choose min < mean or median < max",
    );
    None
}
