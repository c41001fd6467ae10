//! Reads contact laws and makes one law per pair of materials.

use super::alternatives::Chosen;
use super::schema::{Default, Key, Kind, Range, Table};
use super::section::Section;
use super::{Boundary, CellConfig, Material, PairConfig, Species, Velocities};
use crate::force::registry::{self, LawChoice, LawEntry, PairProperties, ParameterKind, ParameterValue, Role};
use crate::units::Dimension;
use std::sync::LazyLock;

const ROLES: [(Role, &str); 3] =
    [(Role::Normal, "normal"), (Role::Tangential, "tangential"), (Role::Rolling, "rolling")];

/// Every registered law with its parameters described as keys.
static LAW_KEYS: LazyLock<Vec<(&'static LawEntry, Vec<Key>)>> = LazyLock::new(|| {
    let laws = ROLES
        .iter()
        .flat_map(|(role, _)| registry::names(*role).into_iter().filter_map(move |name| registry::find(*role, name)));
    laws.map(|law| (law, law.parameters.iter().map(parameter_key).collect())).collect()
});

/// What stands for no law.
static NONE: Table = Table { meaning: "No such force.", keys: &[] };

fn parameter_key(parameter: &'static registry::ParameterSpec) -> Key {
    let (kind, default) = match (parameter.kind, parameter.default) {
        (ParameterKind::Number { min, max }, ParameterValue::Number(value)) => {
            (Kind::Number(Dimension::NONE, Range::closed(min, max)), Default::Number(value))
        }
        (ParameterKind::Choice(words), ParameterValue::Choice(index)) => {
            (Kind::Choice(words), Default::Word(words[index]))
        }
        (ParameterKind::Flag, ParameterValue::Flag(value)) => (Kind::Flag, Default::Flag(value)),
        (kind, default) => panic!("parameter {}: default {default:?} does not fit {kind:?}", parameter.name),
    };
    Key { name: parameter.name, kind, default, meaning: parameter.doc }
}

/// The laws of a role as sections: entry and description of its keys.
pub(super) fn laws(role: Role) -> impl Iterator<Item = (&'static LawEntry, &'static [Key])> {
    LAW_KEYS.iter().filter(move |(law, _)| law.role == role).map(|(law, keys)| (*law, keys.as_slice()))
}

/// Names that may stand for a law of this role.
pub(super) fn alternatives(role: Role) -> Vec<&'static str> {
    let none = if role == Role::Normal { None } else { Some("none") };
    laws(role).map(|(law, _)| law.name).chain(none).collect()
}

/// The three laws of a contact as far as they are given: `Some(None)` is an explicit "none".
#[derive(Debug, Clone, Default)]
pub(super) struct Laws {
    normal: Option<LawChoice>,
    tangential: Option<Option<LawChoice>>,
    rolling: Option<Option<LawChoice>>,
}

impl Laws {
    /// Read the laws of `[contact]` or of one `[[pair]]`.
    pub fn read(section: &Section) -> Self {
        Self {
            normal: read_law(section, "normal", Role::Normal).flatten(),
            tangential: read_law(section, "tangential", Role::Tangential),
            rolling: read_law(section, "rolling", Role::Rolling),
        }
    }
}

fn read_law(section: &Section, name: &str, role: Role) -> Option<Option<LawChoice>> {
    let tables: Vec<(&'static str, Table)> = laws(role)
        .map(|(law, keys)| (law.name, Table { meaning: law.summary, keys }))
        .chain((role != Role::Normal).then_some(("none", NONE)))
        .collect();
    let Chosen::Table(chosen, law_section) = section.choose_table(name, &tables)? else { return None };
    let Some(law) = registry::find(role, chosen) else { return Some(None) };
    let values = law.parameters.iter().map(|parameter| match parameter.kind {
        ParameterKind::Number { .. } => law_section.number(parameter.name).map(ParameterValue::Number),
        ParameterKind::Choice(_) => law_section.choice(parameter.name).map(ParameterValue::Choice),
        ParameterKind::Flag => law_section.flag(parameter.name).map(ParameterValue::Flag),
    });
    // Read all before giving up on one, so that every problem is reported.
    let values: Vec<Option<ParameterValue>> = values.collect();
    Some(Some(LawChoice { law, values: values.into_iter().collect::<Option<Vec<_>>>()? }))
}

/// One `[[pair]]` as read.
struct Override<'a> {
    section: Section<'a>,
    materials: [usize; 2],
    laws: Laws,
    /// In the order of [`CONSTANTS`].
    constants: [Option<f64>; 5],
}

const CONSTANTS: [&str; 5] = ["restitution", "friction", "rolling_friction", "twisting_friction", "surface_energy"];

fn constants_of(material: &Material) -> [f64; 5] {
    let m = material;
    [m.restitution, m.friction, m.rolling_friction, m.twisting_friction, m.surface_energy]
}

fn read_overrides<'a>(root: &Section<'a>, names: &[String]) -> Vec<Override<'a>> {
    let mut overrides: Vec<Override<'a>> = Vec::new();
    for section in root.list("pair") {
        let laws = Laws::read(&section);
        let constants = CONSTANTS.map(|name| section.number(name));
        let Some(given) = section.texts("materials") else { continue };
        let indices: Vec<Option<usize>> =
            given.iter().map(|name| super::particles::find_material(&section, "materials", name, names)).collect();
        let (Some(a), Some(b)) = (indices[0], indices[1]) else { continue };
        let materials = [a.min(b), a.max(b)];
        if overrides.iter().any(|other| other.materials == materials) {
            let message = format!("the pair \"{}\" and \"{}\" is described twice", given[0], given[1]);
            section.problem("materials", message, "keep one [[pair]] per pair of materials");
            continue;
        }
        overrides.push(Override { section, materials, laws, constants });
    }
    overrides
}

/// Whether contacts between two materials can occur: both have particles, or one is a wall's.
pub(super) fn meets(a: usize, b: usize, species: &[Species], cell: &CellConfig) -> bool {
    let moving = |m: usize| species.iter().any(|s| s.material == m);
    let wall = |m: usize| cell.boundary.contains(&Boundary::Walls { material: m });
    (moving(a) && (moving(b) || wall(b))) || (moving(b) && wall(a))
}

/// The materials, species and cell that decide which pairs there are.
pub(super) struct Context<'a> {
    pub names: &'a [String],
    pub materials: Option<&'a [Material]>,
    pub species: Option<&'a [Species]>,
    pub cell: Option<&'a CellConfig>,
}

/// Read `[contact]` and `[[pair]]`. Returns the pairs and the largest overlap fraction.
pub(super) fn read(root: &Section, context: &Context) -> Option<(Vec<PairConfig>, f64)> {
    let contact = root.table("contact");
    let common = contact.as_ref().map(Laws::read);
    let max_overlap = contact.as_ref().and_then(|section| section.number("max_overlap_fraction"));
    let overrides = read_overrides(root, context.names);
    let (contact, common) = (contact?, common?);
    let (materials, species, cell) = (context.materials?, context.species?, context.cell?);
    let pairs: Vec<Option<PairConfig>> = (0..materials.len())
        .flat_map(|a| (a..materials.len()).map(move |b| [a, b]))
        .map(|ends| {
            if !meets(ends[0], ends[1], species, cell) {
                return None;
            }
            let special = overrides.iter().find(|o| o.materials == ends);
            make_pair(root, &contact, &common, special, ends, materials)
        })
        .collect();
    // Pairs that never meet take the laws of one that does, so that every entry is a checked one.
    let any = pairs.iter().flatten().next()?.clone();
    let ends = (0..materials.len()).flat_map(|a| (a..materials.len()).map(move |b| [a, b]));
    let complete = pairs
        .into_iter()
        .zip(ends)
        .map(|(pair, ends)| pair.unwrap_or_else(|| PairConfig { materials: ends, ..any.clone() }))
        .collect();
    Some((complete, max_overlap?))
}

fn make_pair(
    root: &Section,
    contact: &Section,
    common: &Laws,
    special: Option<&Override>,
    ends: [usize; 2],
    materials: &[Material],
) -> Option<PairConfig> {
    let [first, second] = ends.map(|m| &materials[m]);
    let place = special.map_or(contact, |o| &o.section);
    let normal = special.and_then(|o| o.laws.normal.clone()).or_else(|| common.normal.clone())?;
    let tangential = special.and_then(|o| o.laws.tangential.clone()).or_else(|| common.tangential.clone())?;
    let rolling = special.and_then(|o| o.laws.rolling.clone()).or_else(|| common.rolling.clone())?;
    let both = [constants_of(first), constants_of(second)];
    let constants = [0, 1, 2, 3, 4].map(|k| {
        let own = special.and_then(|o| o.constants[k]);
        if own.is_none() && both[0][k] != both[1][k] {
            let message = format!(
                "materials \"{}\" and \"{}\" differ in {} ({} and {}), and nothing is mixed silently",
                first.name, second.name, CONSTANTS[k], both[0][k], both[1][k]
            );
            let remedy = format!(
                "add [[pair]] with materials = [\"{}\", \"{}\"] and {} = …",
                first.name, second.name, CONSTANTS[k]
            );
            let (section, key) = special.map_or((root, "pair"), |o| (&o.section, CONSTANTS[k]));
            section.problem(key, message, remedy);
        }
        own.unwrap_or(both[0][k])
    });
    let properties = PairProperties {
        names: [first.name.clone(), second.name.clone()],
        young_modulus: [first.young_modulus, second.young_modulus],
        poisson_ratio: [first.poisson_ratio, second.poisson_ratio],
        maxwell: [first.maxwell.clone(), second.maxwell.clone()],
        yield_stress: [first.yield_stress, second.yield_stress],
        restitution: constants[0],
        friction: constants[1],
        rolling_friction: constants[2],
        twisting_friction: constants[3],
        surface_energy: constants[4],
        velocities: Velocities::default(),
    };
    let chosen = [("normal", Some(&normal)), ("tangential", tangential.as_ref()), ("rolling", rolling.as_ref())];
    for (role, choice) in chosen {
        if let Some(Err(message)) = choice.map(|choice| (choice.law.check)(&properties)) {
            let section = if place.given(role) { place } else { contact };
            let pair = format!("pair \"{}\", \"{}\"", first.name, second.name);
            section.problem(role, format!("{pair}: {message}"), "change the law or the materials as said above");
        }
    }
    refuse_idle_friction(place, contact, &properties, tangential.is_some(), rolling.is_some());
    Some(PairConfig { materials: ends, properties, normal, tangential, rolling })
}

/// A friction coefficient that no law reads is an error, unless the law was refused in words.
fn refuse_idle_friction(place: &Section, contact: &Section, pair: &PairProperties, sliding: bool, rolling: bool) {
    let coefficients = [
        ("friction", pair.friction, sliding, "tangential", Role::Tangential),
        ("rolling_friction", pair.rolling_friction, rolling, "rolling", Role::Rolling),
        ("twisting_friction", pair.twisting_friction, rolling, "rolling", Role::Rolling),
    ];
    for (name, value, has_law, key, role) in coefficients {
        if value > 0.0 && !has_law && !place.given(key) && !contact.given(key) {
            let law = alternatives(role).first().copied().unwrap_or("none");
            let message = format!(
                "{name} {value} of the pair \"{}\", \"{}\" has no effect without a {key} law",
                pair.names[0], pair.names[1]
            );
            contact.problem(
                key,
                message,
                format!("add {key} = \"{law}\" to [contact], or {key} = \"none\" if so meant"),
            );
        }
    }
}
