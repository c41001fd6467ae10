//! What an input gives and no law of it reads.

use super::contact::meets;
use super::{Config, Material, PairConfig, Routine};
use crate::force::registry::{self, OPTIONAL_CONSTANTS, Role};

/// A warning for every constant of a material or of a pair that has no effect, and for every material without contacts.
#[must_use]
pub fn warnings(config: &Config) -> Vec<String> {
    let met: Vec<&PairConfig> = config
        .pairs
        .iter()
        .filter(|pair| meets(pair.materials[0], pair.materials[1], &config.species, &config.cell))
        .collect();
    let moves = config.stages.iter().any(|stage| stage.routine == Routine::Dynamic);
    let mut warnings = Vec::new();
    for (index, material) in config.materials.iter().enumerate() {
        let own: Vec<&&PairConfig> = met.iter().filter(|pair| pair.materials.contains(&index)).collect();
        if own.is_empty() {
            let name = &material.name;
            warnings.push(format!("the material \"{name}\" is that of no species and of no wall; remove it"));
            continue;
        }
        for constant in OPTIONAL_CONSTANTS.into_iter().filter(|constant| is_given(material, constant)) {
            if !own.iter().any(|pair| uses(pair, constant)) {
                warnings.push(text(constant, &format!("the material \"{}\"", material.name)));
            }
        }
        if moves && material.restitution < 1.0 && !own.iter().any(|pair| pair.normal.damps()) {
            warnings.push(format!(
                "restitution of the material \"{}\" has no effect: no normal law of its contacts has a dashpot; give it \
                 one (contact.normal.{}.damping = \"tsuji\"), or remove restitution",
                material.name, own[0].normal.law.name
            ));
        }
    }
    for pair in met {
        let energy = pair.properties.surface_energy;
        let of_materials = pair.materials.map(|index| config.materials[index].surface_energy);
        if energy > 0.0 && !of_materials.contains(&energy) && !uses(pair, "surface_energy") {
            let [first, second] = &pair.properties.names;
            warnings.push(text("surface_energy", &format!("the pair \"{first}\", \"{second}\"")));
        }
    }
    warnings
}

fn uses(pair: &PairConfig, constant: &str) -> bool {
    pair.normal.law.uses.contains(&constant)
}

fn is_given(material: &Material, constant: &str) -> bool {
    match constant {
        "maxwell" => !material.maxwell.is_empty(),
        "yield_stress" => material.yield_stress.is_some(),
        _ => material.surface_energy > 0.0,
    }
}

fn text(constant: &str, of: &str) -> String {
    let laws = registry::laws().iter().filter(|law| law.role == Role::Normal && law.uses.contains(&constant));
    let names: Vec<&str> = laws.map(|law| law.name).collect();
    format!(
        "{constant} of {of} has no effect: no normal law of its contacts uses it; choose one that does ({}), or remove it",
        names.join(", ")
    )
}
