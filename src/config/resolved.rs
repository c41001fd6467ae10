//! The input as resolved: every value that was read, defaults included, in SI units, as TOML text.

use std::fmt::Write as _;

/// Values by dotted path, in the order in which they were read; whole-number parts of a path count
/// the entries of a list.
#[derive(Debug, Default)]
pub(super) struct Resolved {
    root: Branch,
}

#[derive(Debug, Default)]
struct Branch {
    children: Vec<(String, Item)>,
}

#[derive(Debug)]
enum Item {
    Value { text: String, unit: String },
    Branch(Branch),
}

impl Resolved {
    /// Note that a section is there, even if nothing stands in it.
    pub fn table(&mut self, path: &str) {
        self.root.descend(path.split('.').filter(|part| !part.is_empty()));
    }

    /// Note a value; a later one for the same path replaces it.
    pub fn value(&mut self, path: &str, value: impl Into<toml::Value>, unit: &str) {
        let (section, name) = path.rsplit_once('.').unwrap_or(("", path));
        let branch = self.root.descend(section.split('.').filter(|part| !part.is_empty()));
        let item = Item::Value { text: toml_text(&value.into()), unit: unit.to_owned() };
        match branch.children.iter_mut().find(|(key, _)| key == name) {
            Some((_, old)) => *old = item,
            None => branch.children.push((name.to_owned(), item)),
        }
    }

    /// The TOML text.
    pub fn text(&self) -> String {
        let mut text = String::from("# Every value in force, defaults included, in SI units. Runs as it stands.\n");
        self.root.write(&mut text, "", "");
        text
    }
}

/// A value as TOML text; floats in the shortest form that reads back to the same bits.
fn toml_text(value: &toml::Value) -> String {
    match value {
        toml::Value::Float(number) => format!("{number:?}"),
        toml::Value::Array(items) => format!("[{}]", items.iter().map(toml_text).collect::<Vec<_>>().join(", ")),
        other => other.to_string(),
    }
}

impl Branch {
    fn descend<'p>(&mut self, path: impl Iterator<Item = &'p str>) -> &mut Self {
        let mut branch = self;
        for part in path {
            let index = branch.children.iter().position(|(key, _)| key == part).unwrap_or_else(|| {
                branch.children.push((part.to_owned(), Item::Branch(Self::default())));
                branch.children.len() - 1
            });
            let child = &mut branch.children[index].1;
            if matches!(child, Item::Value { .. }) {
                *child = Item::Branch(Self::default());
            }
            branch = match child {
                Item::Branch(inner) => inner,
                Item::Value { .. } => unreachable!("replaced by a branch above"),
            };
        }
        branch
    }

    fn is_list(&self) -> bool {
        !self.children.is_empty() && self.children.iter().all(|(key, _)| key.bytes().all(|b| b.is_ascii_digit()))
    }

    /// TOML wants a section's values before its sub-sections. `header` is this section's own header
    /// line, left out where sub-sections imply it.
    fn write(&self, text: &mut String, path: &str, header: &str) {
        let has_values = self.children.iter().any(|(_, item)| matches!(item, Item::Value { .. }));
        if !header.is_empty() && (has_values || self.children.is_empty() || header.starts_with("[[")) {
            let _ = writeln!(text, "\n{header}");
        }
        for (key, item) in &self.children {
            if let Item::Value { text: value, unit } = item {
                let comment = if unit.is_empty() { String::new() } else { format!(" # {unit}") };
                let _ = writeln!(text, "{key} = {value}{comment}");
            }
        }
        for (key, item) in &self.children {
            let Item::Branch(branch) = item else { continue };
            let inner = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
            if branch.is_list() {
                for (_, entry) in &branch.children {
                    if let Item::Branch(entry) = entry {
                        entry.write(text, &inner, &format!("[[{inner}]]"));
                    }
                }
            } else {
                branch.write(text, &inner, &format!("[{inner}]"));
            }
        }
    }
}
