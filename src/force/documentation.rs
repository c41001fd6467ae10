//! The table of laws for the documentation, written from the registry itself so that it cannot go stale.

use super::composition::{NormalVisitor, RollingVisitor, TangentialVisitor};
use super::law::{Column, NormalLaw, RollingLaw, TangentialLaw};
use super::registry::{
    LawEntry, PairProperties, ParameterKind, ParameterSpec, ParameterValue, Role, build_normal, build_rolling,
    build_tangential, laws,
};
use super::shear::ShearSprings;
use crate::config::{MaxwellBranch, PairConfig, Velocities};
use std::fmt::Write;

/// Markdown table of all laws: key, summary, parameters with range and default, memory columns (of a
/// material with one Maxwell branch), source; below it what each parameter means.
#[must_use]
pub fn table_markdown() -> String {
    let mut table =
        String::from("| role | law | what it is | parameters | memory | source |\n|---|---|---|---|---|---|\n");
    let mut meanings = String::new();
    for law in laws() {
        let role = match law.role {
            Role::Normal => "normal",
            Role::Tangential => "tangential",
            Role::Rolling => "rolling",
        };
        let parameters: Vec<String> = law.parameters.iter().map(parameter).collect();
        let memory: Vec<String> = memory(law).iter().map(|c| format!("{} [{}]", c.name, c.unit)).collect();
        let (parameters, memory) = (or_dash(&parameters), or_dash(&memory));
        // Writing to a String cannot fail.
        let _ =
            writeln!(table, "| {role} | `{}` | {} | {parameters} | {memory} | {} |", law.name, law.summary, law.source);
        for spec in law.parameters {
            let _ = writeln!(meanings, "- `{}.{}`: {}.", law.name, spec.name, spec.doc);
        }
    }
    table + "\n" + &meanings
}

fn or_dash(items: &[String]) -> String {
    if items.is_empty() { "-".to_owned() } else { items.join(", ") }
}

fn parameter(spec: &ParameterSpec) -> String {
    let range = match spec.kind {
        ParameterKind::Number { min, max } => format!("{min} to {max}"),
        ParameterKind::Choice(words) => words.join(", "),
        ParameterKind::Flag => "true, false".to_owned(),
    };
    let default = match (spec.kind, spec.default) {
        (ParameterKind::Choice(words), ParameterValue::Choice(index)) => words[index].to_owned(),
        (_, ParameterValue::Number(value)) => format!("{value:.4}"),
        (_, ParameterValue::Flag(value)) => value.to_string(),
        (_, ParameterValue::Choice(index)) => index.to_string(),
    };
    format!("`{}` ({range}; default {default})", spec.name)
}

fn memory(law: &'static LawEntry) -> Vec<Column> {
    let pair = example_pair(law);
    match law.role {
        Role::Normal => build_normal(&pair, Columns),
        Role::Tangential => {
            build_tangential(&pair, &law.with_defaults(), &ShearSprings::elastic(&pair.properties), Columns)
        }
        Role::Rolling => build_rolling(&pair, &law.with_defaults(), Columns),
    }
}

/// A pair with one Maxwell branch; only the number of memory columns is read from it.
fn example_pair(law: &'static LawEntry) -> PairConfig {
    let branches = vec![MaxwellBranch { modulus: 1e9, relaxation_time: 1.0 }];
    PairConfig {
        materials: [0, 0],
        properties: PairProperties {
            names: ["example".to_owned(), "example".to_owned()],
            young_modulus: [1e9; 2],
            poisson_ratio: [0.3; 2],
            maxwell: [branches.clone(), branches],
            yield_stress: [Some(1e7); 2],
            restitution: 0.5,
            friction: 0.5,
            rolling_friction: 0.1,
            twisting_friction: 0.1,
            surface_energy: 0.1,
            velocities: Velocities::default(),
        },
        normal: law.with_defaults(),
        tangential: None,
        rolling: None,
    }
}

/// Asks a law for its memory columns.
struct Columns;

impl NormalVisitor for Columns {
    type Output = Vec<Column>;
    fn visit<N: NormalLaw, const SPRINGS: usize>(self, law: N, _: ShearSprings<SPRINGS>) -> Vec<Column> {
        law.columns()
    }
}

impl TangentialVisitor for Columns {
    type Output = Vec<Column>;
    fn visit<T: TangentialLaw>(self, law: T) -> Vec<Column> {
        law.columns()
    }
}

impl RollingVisitor for Columns {
    type Output = Vec<Column>;
    fn visit<R: RollingLaw>(self, law: R) -> Vec<Column> {
        law.columns()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_names_every_law_with_its_parameters_and_memory() {
        let table = table_markdown();
        for law in laws() {
            assert!(table.contains(&format!("| `{}` |", law.name)), "{table}");
            for spec in law.parameters {
                assert!(table.contains(&format!("`{}.{}`", law.name, spec.name)), "{table}");
            }
        }
        assert!(table.contains("hertzian [m^2], branch_1_force [N]"), "{table}");
        assert!(table.contains("tangential_force_x [N]"), "{table}");
    }
}
