//! The input reference and the commented example, made from the descriptions that the reader uses.

use super::contact::laws;
use super::keys;
use super::schema::{Default, Key, Kind, Table};
use crate::force::registry::{LawEntry, Role};
use std::fmt::Write as _;

/// Law that the example puts in force, per part of the contact.
const EXAMPLE_LAWS: [(Role, &str, &str); 3] = [
    (Role::Normal, "normal", "maxwell_zener"),
    (Role::Tangential, "tangential", "mindlin"),
    (Role::Rolling, "rolling", "spring_slider"),
];

/// The commented example that `dem-mpi init` prints. It loads as it stands.
#[must_use]
pub fn example() -> String {
    include_str!("example.toml").replace("{laws}\n", &example_laws())
}

fn example_laws() -> String {
    let mut text = String::new();
    for (role, part, in_force) in EXAMPLE_LAWS {
        for (law, parameters) in laws(role) {
            let mark = if law.name == in_force { "" } else { "#| " };
            let _ = writeln!(text, "{:<42}# {}", format!("{mark}[contact.{part}.{}]", law.name), law.summary);
            for parameter in parameters {
                let line = format!("{mark}{} = {}", parameter.name, default_value(parameter));
                let _ = writeln!(text, "{line:<42}# {}", parameter.meaning);
            }
        }
        text.push('\n');
    }
    text
}

/// A default as it would stand in the input.
fn default_value(key: &Key) -> String {
    match key.default {
        Default::Number(value) => format!("{value:?}"),
        Default::Integer(value) => value.to_string(),
        Default::Word(word) => format!("\"{word}\""),
        Default::Flag(flag) => flag.to_string(),
        Default::Derived(text) => text.to_owned(),
        Default::Required => "required".to_owned(),
        Default::Absent => "none".to_owned(),
    }
}

/// All sections and keys of the input as Markdown tables.
#[must_use]
pub fn reference_markdown() -> String {
    let mut text = String::new();
    section(&mut text, "Top level", "", &keys::ROOT);
    text
}

fn section(text: &mut String, title: &str, path: &str, table: &Table) {
    let _ = writeln!(text, "### {title}\n\n{}\n", table.meaning);
    if !table.keys.is_empty() {
        text.push_str("| key | allowed | unit | default | meaning |\n|---|---|---|---|---|\n");
    }
    for key in table.keys {
        let _ = writeln!(
            text,
            "| `{}` | {} | {} | {} | {} |",
            key.name,
            allowed(&key.kind),
            unit(&key.kind),
            code(&default_value(key), matches!(key.default, Default::Number(_) | Default::Word(_) | Default::Flag(_))),
            key.meaning
        );
    }
    text.push('\n');
    for key in table.keys {
        let inner = if path.is_empty() { key.name.to_owned() } else { format!("{path}.{}", key.name) };
        match key.kind {
            Kind::Table(table) if !table.keys.is_empty() => section(text, &format!("`[{inner}]`"), &inner, table),
            Kind::List(table) if inner != "stage.part" => section(text, &format!("`[[{inner}]]`"), &inner, table),
            Kind::OneOf(table, _) => section(text, &format!("`[{inner}]`"), &inner, table),
            Kind::Law(role) if path == "contact" => {
                laws(role).for_each(|(law, keys)| law_section(text, &inner, law, keys));
            }
            _ => {}
        }
    }
}

fn law_section(text: &mut String, path: &str, law: &LawEntry, keys: &'static [Key]) {
    let table = Table { meaning: law.summary, keys };
    section(text, &format!("`[{path}.{}]`", law.name), path, &table);
    let _ = writeln!(text, "Source: {}.\n", law.source);
}

fn code(value: &str, is_code: bool) -> String {
    if is_code { format!("`{value}`") } else { value.to_owned() }
}

/// What is allowed, without the unit, which has a column of its own.
fn allowed(kind: &Kind) -> String {
    match kind {
        Kind::Number(_, range) => match range.describe() {
            text if text.is_empty() => "a number".to_owned(),
            text => format!("a number {text}"),
        },
        Kind::OneOf(..) | Kind::Law(_) => kind.allowed().replace('"', "`"),
        _ => kind.allowed(),
    }
}

fn unit(kind: &Kind) -> String {
    let (Kind::Number(dimension, _) | Kind::Numbers(dimension, _) | Kind::Axes { dimension, .. }) = kind else {
        return String::new();
    };
    match dimension.unit() {
        unit if unit.is_empty() => "1".to_owned(),
        unit => unit,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use std::path::Path;

    #[test]
    fn the_example_loads_and_so_does_its_resolved_text() {
        let first = Config::parse(&example(), Path::new("example.toml"), &[], None, None).unwrap();
        let second = Config::parse(&first.resolved, Path::new("example.toml"), &[], None, None).unwrap();
        assert_eq!(format!("{first:?}"), format!("{second:?}"));
    }

    #[test]
    fn every_possibility_of_the_example_is_known() {
        // The alternatives contradict each other, so they are read one paragraph at a time.
        let known = reference_markdown();
        for line in example().lines().filter_map(|line| line.strip_prefix("#| ")) {
            let key =
                line.split(['=', '[', ']', '.']).map(str::trim).rfind(|word| known.contains(&format!("`{word}`")));
            assert!(key.is_some() || known.contains(line.split('#').next().unwrap_or("").trim()), "{line}");
        }
    }

    #[test]
    fn the_reference_names_every_section() {
        let text = reference_markdown();
        for title in
            ["[[material]]", "[[material.maxwell]]", "[species.radius.normal]", "[contact.normal.hertz]", "[[stage]]"]
        {
            assert!(text.contains(&format!("### `{title}`")), "{title}");
        }
    }
}
