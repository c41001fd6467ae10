//! Reads sections of the input against their description: every problem is collected, every value
//! (given or default) is recorded for the resolved text.

use super::diagnostic::{Place, Problem, did_you_mean};
use super::document::{Node, Value};
use super::resolved::Resolved;
use super::schema::{Default, Key, Kind, Table};
use std::cell::RefCell;

/// What all sections share while the input is read.
#[derive(Debug, Default)]
pub(super) struct Reader {
    pub problems: RefCell<Vec<Problem>>,
    pub resolved: RefCell<Resolved>,
}

/// One section: its description, its entries (none if it is absent) and its place.
#[derive(Debug, Clone)]
pub(super) struct Section<'a> {
    pub reader: &'a Reader,
    path: String,
    keys: Vec<Key>,
    node: Option<&'a Node>,
    pub(super) place: Place,
}

impl<'a> Section<'a> {
    /// The whole document.
    pub fn root(reader: &'a Reader, node: &'a Node, table: &Table) -> Self {
        Self::open(reader, String::new(), table.keys.to_vec(), Some(node), node.place.clone())
    }

    pub(super) fn open(reader: &'a Reader, path: String, keys: Vec<Key>, node: Option<&'a Node>, place: Place) -> Self {
        let section = Self { reader, path, keys, node, place };
        section.refuse_unknown_keys();
        reader.resolved.borrow_mut().table(&section.path);
        section
    }

    fn refuse_unknown_keys(&self) {
        let known: Vec<&str> = self.keys.iter().map(|k| k.name).collect();
        for entry in self.node.and_then(Node::entries).unwrap_or(&[]) {
            if !known.contains(&entry.key.as_str()) {
                let near = did_you_mean(&entry.key, known.iter().copied());
                let list = if known.is_empty() {
                    "nothing is set here".to_owned()
                } else {
                    format!("known here: {}", known.join(", "))
                };
                self.report(entry.key_place.clone(), &entry.key, format!("unknown key `{}`{near}", entry.key), list);
            }
        }
    }

    pub(super) fn spec(&self, name: &str) -> Key {
        let found = self.keys.iter().find(|key| key.name == name);
        *found.unwrap_or_else(|| panic!("the description of [{}] lacks `{name}`", self.path))
    }

    pub(super) fn node(&self, name: &str) -> Option<&'a Node> {
        self.node?.get(name).map(|entry| &entry.node)
    }

    /// A list without entries stands at the key.
    pub fn is_empty_list(&self, name: &str) -> bool {
        self.node(name).is_some_and(|node| matches!(&node.value, Value::List(items) if items.is_empty()))
    }

    /// The dotted key of `name` in this section.
    pub fn dotted(&self, name: &str) -> String {
        if self.path.is_empty() { name.to_owned() } else { format!("{}.{name}", self.path) }
    }

    /// Whether the key stands in the input.
    pub fn given(&self, name: &str) -> bool {
        self.node(name).is_some()
    }

    /// Nothing stands in the section.
    pub fn is_empty(&self) -> bool {
        self.node.and_then(Node::entries).is_none_or(<[_]>::is_empty)
    }

    pub(super) fn report(&self, place: Place, name: &str, message: String, remedy: String) {
        self.reader.problems.borrow_mut().push(Problem { place, key: self.dotted(name), message, remedy });
    }

    /// Whether the alternative `word` is chosen for `name`, be it faulty or not.
    pub fn chooses(&self, name: &str, word: &str) -> bool {
        self.node(name).is_some_and(|node| match &node.value {
            Value::Text(text) => text == word,
            _ => node.get(word).is_some(),
        })
    }

    /// A section that was read before, for checks that need more than it.
    pub fn reopened(&self, name: &str) -> Option<Self> {
        let node = self.node(name);
        let Kind::Table(table) = self.spec(name).kind else { return None };
        let place = node.map_or_else(|| self.place.clone(), |node| node.place.clone());
        Some(Self { reader: self.reader, path: self.dotted(name), keys: table.keys.to_vec(), node, place })
    }

    /// Report a problem at the value of `name`, or at the section if it is absent.
    pub fn problem(&self, name: &str, message: impl Into<String>, remedy: impl Into<String>) {
        let place = self.node(name).map_or_else(|| self.place.clone(), |node| node.place.clone());
        self.report(place, name, message.into(), remedy.into());
    }

    pub(super) fn mismatch(&self, node: &Node, name: &str, kind: &Kind) {
        self.report(
            node.place.clone(),
            name,
            format!("found {}", node.found()),
            format!("allowed: {}", kind.allowed()),
        );
    }

    fn missing(&self, key: &Key) {
        let remedy = format!("add `{}`: {} ({})", key.name, key.meaning, key.kind.allowed());
        self.report(self.place.clone(), key.name, "missing".to_owned(), remedy);
    }

    pub(super) fn record(&self, name: &str, value: impl Into<toml::Value>, unit: &str) {
        self.reader.resolved.borrow_mut().value(&self.dotted(name), value, unit);
    }

    /// The node of a key, or its default, or neither (then a missing required key is reported).
    pub(super) fn lookup(&self, name: &str) -> (Key, Option<&'a Node>) {
        let key = self.spec(name);
        let node = self.node(name);
        if node.is_none() && matches!(key.default, Default::Required) {
            self.missing(&key);
        }
        (key, node)
    }

    /// A section. An absent one is `None` if it is optional or required, else all its defaults.
    pub fn table(&self, name: &str) -> Option<Self> {
        let (key, node) = self.lookup(name);
        let Kind::Table(table) = key.kind else { panic!("`{name}` is not described as a section") };
        match node {
            None if matches!(key.default, Default::Derived(_)) => Some(self.child(name, table.keys.to_vec(), None)),
            None => None,
            Some(node) if node.entries().is_some() => Some(self.child(name, table.keys.to_vec(), Some(node))),
            Some(node) => {
                self.report(
                    node.place.clone(),
                    name,
                    format!("found {}", node.found()),
                    format!("allowed: a section [{}] with its own keys", self.dotted(name)),
                );
                None
            }
        }
    }

    fn child(&self, name: &str, keys: Vec<Key>, node: Option<&'a Node>) -> Self {
        let place = node.map_or_else(|| self.place.clone(), |node| node.place.clone());
        Self::open(self.reader, self.dotted(name), keys, node, place)
    }

    /// All sections of a list.
    pub fn list(&self, name: &str) -> Vec<Self> {
        let (key, node) = self.lookup(name);
        let Kind::List(table) = key.kind else { panic!("`{name}` is not described as a list of sections") };
        let Some(node) = node else { return Vec::new() };
        let Value::List(items) = &node.value else {
            let remedy = format!("write [[{}]] with double brackets, once per entry", self.dotted(name));
            self.report(node.place.clone(), name, format!("found {}", node.found()), remedy);
            return Vec::new();
        };
        if items.is_empty() && matches!(key.default, Default::Required) {
            let remedy = format!("give at least one [[{}]] section", self.dotted(name));
            self.report(node.place.clone(), name, "is an empty list".to_owned(), remedy);
        }
        let section = |(index, item): (usize, &'a Node)| {
            let path = format!("{name}.{index}");
            if item.entries().is_none() {
                self.report(
                    item.place.clone(),
                    &path,
                    format!("found {}", item.found()),
                    "allowed: a table".to_owned(),
                );
                return None;
            }
            Some(self.child(&path, table.keys.to_vec(), Some(item)))
        };
        items.iter().enumerate().filter_map(section).collect()
    }
}
