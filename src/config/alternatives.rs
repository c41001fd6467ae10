//! Reads places where exactly one of several alternatives stands.

use super::diagnostic::did_you_mean;
use super::document::{Entry, Node, Value};
use super::schema::{Default, Key, Kind, Table};
use super::section::Section;
use super::values::unit_of;

/// The alternative chosen where exactly one is allowed.
pub(super) enum Chosen<'a> {
    /// A plain value.
    Value(Option<f64>),
    /// A section of its own.
    Table(&'static str, Section<'a>),
}

/// One of several alternatives: a section with these keys, or a plain value.
struct Alternative {
    name: &'static str,
    keys: Option<&'static [Key]>,
    kind: Kind,
}

impl<'a> Section<'a> {
    /// Exactly one of several alternatives.
    pub fn choose(&self, name: &str) -> Option<Chosen<'a>> {
        let Kind::OneOf(table, plain) = self.spec(name).kind else {
            panic!("`{name}` is not described as one of several")
        };
        let alternatives: Vec<Alternative> = table
            .keys
            .iter()
            .map(|key| match key.kind {
                Kind::Table(inner) => Alternative { name: key.name, keys: Some(inner.keys), kind: key.kind },
                kind => Alternative { name: key.name, keys: None, kind },
            })
            .collect();
        self.choose_among(name, &alternatives, plain)
    }

    /// Exactly one of these sections.
    pub fn choose_table(&self, name: &str, tables: &[(&'static str, Table)]) -> Option<Chosen<'a>> {
        let kind = self.spec(name).kind;
        let alternatives: Vec<Alternative> =
            tables.iter().map(|(name, table)| Alternative { name, keys: Some(table.keys), kind }).collect();
        self.choose_among(name, &alternatives, None)
    }

    /// A table with one entry, the name of a section with all its defaults, or a plain value for the
    /// alternative `plain`.
    fn choose_among(
        &self,
        name: &str,
        alternatives: &[Alternative],
        plain: Option<&'static str>,
    ) -> Option<Chosen<'a>> {
        let (key, node) = self.lookup(name);
        let find = |word: &str| alternatives.iter().find(|alternative| alternative.name == word);
        let (alternative, node, place) = match (node, key.default) {
            (None, Default::Word(word)) => (find(word)?, None, self.place.clone()),
            (None, _) => return None,
            (Some(node), _) => match &node.value {
                Value::Table(_) => {
                    let entry = self.only_entry(node, name, alternatives, &key.kind)?;
                    (find(&entry.key)?, Some(&entry.node), entry.node.place.clone())
                }
                Value::Text(word) if find(word).is_some_and(|a| a.keys.is_some()) => {
                    (find(word)?, None, node.place.clone())
                }
                Value::Text(word) if plain.is_none() => {
                    let near = did_you_mean(word, alternatives.iter().map(|a| a.name));
                    let message = format!("\"{word}\" is not known here{near}");
                    self.report(node.place.clone(), name, message, format!("allowed: {}", key.kind.allowed()));
                    return None;
                }
                Value::Text(_) | Value::Integer(_) | Value::Float(_) if plain.is_some() => {
                    (find(plain?)?, Some(node), node.place.clone())
                }
                _ => {
                    self.mismatch(node, name, &key.kind);
                    return None;
                }
            },
        };
        let path = format!("{name}.{}", alternative.name);
        match (alternative.keys, node) {
            (Some(keys), node) => {
                if let Some(node) = node.filter(|node| node.entries().is_none()) {
                    let remedy = format!("allowed: a section [{}]", self.dotted(&path));
                    self.report(node.place.clone(), &path, format!("found {}", node.found()), remedy);
                    return None;
                }
                let child = Self::open(self.reader, self.dotted(&path), keys.to_vec(), node, place);
                Some(Chosen::Table(alternative.name, child))
            }
            (None, node) => {
                // A message names what the user wrote.
                let given = self.lookup(name).1.is_some_and(|node| node.entries().is_some());
                let value = self.quantity(node?, if given { &path } else { name }, &alternative.kind);
                if let Some(value) = value {
                    self.record(&path, value, &unit_of(&alternative.kind));
                }
                Some(Chosen::Value(value))
            }
        }
    }

    /// The single entry of a table of alternatives. One set on the command line outdoes the file's.
    fn only_entry(&self, node: &'a Node, name: &str, alternatives: &[Alternative], kind: &Kind) -> Option<&'a Entry> {
        let entries = node.entries()?;
        let known = |word: &str| alternatives.iter().any(|a| a.name == word);
        for entry in entries.iter().filter(|entry| !known(&entry.key)) {
            let near = did_you_mean(&entry.key, alternatives.iter().map(|a| a.name));
            let path = format!("{name}.{}", entry.key);
            let message = format!("`{}` is not known here{near}", entry.key);
            self.report(entry.key_place.clone(), &path, message, format!("allowed: {}", kind.allowed()));
        }
        let of_file: Vec<_> = entries.iter().filter(|entry| entry.key_place.source == 0).collect();
        let of_command_line: Vec<_> = entries.iter().filter(|entry| entry.key_place.source > 0).collect();
        match (&of_command_line[..], &of_file[..]) {
            ([one], _) | ([], [one]) => Some(*one).filter(|entry| known(&entry.key)),
            (several, others) => {
                let second = several.get(1).or(others.get(1)).map_or(&node.place, |entry| &entry.key_place);
                let given = entries.iter().map(|entry| entry.key.as_str()).collect::<Vec<_>>().join(", ");
                let found =
                    if given.is_empty() { "nothing is chosen".to_owned() } else { format!("given together: {given}") };
                self.report(second.clone(), name, found, format!("allowed: {}", kind.allowed()));
                None
            }
        }
    }
}
