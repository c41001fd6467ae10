//! Reads sections of the input against their description: every problem is collected, every value
//! (given or default) is recorded for the resolved text.

use super::Interval;
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
    place: Place,
}

/// The alternative chosen where exactly one is allowed.
pub(super) enum Chosen<'a> {
    /// A plain value.
    Value(&'static str, Option<f64>),
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
    /// The whole document.
    pub fn root(reader: &'a Reader, node: &'a Node, table: &Table) -> Self {
        Self::open(reader, String::new(), table.keys.to_vec(), Some(node), node.place.clone())
    }

    fn open(reader: &'a Reader, path: String, keys: Vec<Key>, node: Option<&'a Node>, place: Place) -> Self {
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

    fn spec(&self, name: &str) -> Key {
        let found = self.keys.iter().find(|key| key.name == name);
        *found.unwrap_or_else(|| panic!("the description of [{}] lacks `{name}`", self.path))
    }

    fn node(&self, name: &str) -> Option<&'a Node> {
        self.node?.get(name).map(|entry| &entry.node)
    }

    /// The dotted key of `name` in this section.
    pub fn dotted(&self, name: &str) -> String {
        if self.path.is_empty() { name.to_owned() } else { format!("{}.{name}", self.path) }
    }

    /// Whether the key stands in the input.
    pub fn given(&self, name: &str) -> bool {
        self.node(name).is_some()
    }

    fn report(&self, place: Place, name: &str, message: String, remedy: String) {
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

    fn mismatch(&self, node: &Node, name: &str, kind: &Kind) {
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

    fn record(&self, name: &str, value: impl Into<toml::Value>, unit: &str) {
        self.reader.resolved.borrow_mut().value(&self.dotted(name), value, unit);
    }

    /// The node of a key, or its default, or neither (then a missing required key is reported).
    fn lookup(&self, name: &str) -> (Key, Option<&'a Node>) {
        let key = self.spec(name);
        let node = self.node(name);
        if node.is_none() && matches!(key.default, Default::Required) {
            self.missing(&key);
        }
        (key, node)
    }

    /// One number in SI units; `name` may be `key.x` for messages.
    fn quantity(&self, node: &Node, name: &str, kind: &Kind) -> Option<f64> {
        let (Kind::Number(dimension, range) | Kind::Numbers(dimension, range) | Kind::Axes { dimension, range, .. }) =
            kind
        else {
            panic!("`{name}` is described as {kind:?}, not as numbers")
        };
        let value = match &node.value {
            #[allow(clippy::cast_precision_loss)]
            Value::Integer(v) => *v as f64,
            Value::Float(v) => *v,
            Value::Text(text) => match crate::units::parse(text, *dimension) {
                Ok(value) => value,
                Err(message) => {
                    let remedy = format!("allowed: {}", kind.allowed());
                    self.report(node.place.clone(), name, format!("\"{text}\": {message}"), remedy);
                    return None;
                }
            },
            _ => {
                self.mismatch(node, name, kind);
                return None;
            }
        };
        if range.contains(value) {
            return Some(value);
        }
        let remedy = format!("allowed: {}, finite", kind.allowed());
        self.report(node.place.clone(), name, format!("{} is out of range", node.found()), remedy);
        None
    }

    /// A number in SI units.
    pub fn number(&self, name: &str) -> Option<f64> {
        let (key, node) = self.lookup(name);
        let value = match (node, key.default) {
            (Some(node), _) => self.quantity(node, name, &key.kind),
            (None, Default::Number(value)) => Some(value),
            _ => None,
        }?;
        self.record(name, value, &unit_of(&key.kind));
        Some(value)
    }

    /// A number with a default that follows from other keys.
    pub fn number_or(&self, name: &str, default: f64) -> Option<f64> {
        if self.given(name) {
            return self.number(name);
        }
        self.record(name, default, &unit_of(&self.spec(name).kind));
        Some(default)
    }

    /// A list of numbers.
    pub fn numbers(&self, name: &str) -> Option<Vec<f64>> {
        let (key, node) = self.lookup(name);
        let Value::List(items) = &node?.value else {
            self.mismatch(node?, name, &key.kind);
            return None;
        };
        let values: Vec<Option<f64>> =
            items.iter().enumerate().map(|(i, item)| self.quantity(item, &format!("{name}.{i}"), &key.kind)).collect();
        let values = values.into_iter().collect::<Option<Vec<f64>>>()?;
        self.record(name, values.clone(), &unit_of(&key.kind));
        Some(values)
    }

    /// The nodes per axis of a list of three, a table with x, y, z, or one value for all.
    fn axis_nodes(&self, node: &'a Node, name: &str, key: &Key, uniform: bool) -> Option<[Option<&'a Node>; 3]> {
        match &node.value {
            Value::List(items) if items.len() == 3 => Some([0, 1, 2].map(|k| Some(&items[k]))),
            Value::Table(entries) => {
                for entry in entries.iter().filter(|entry| !["x", "y", "z"].contains(&entry.key.as_str())) {
                    let text = format!("unknown axis `{}`", entry.key);
                    self.report(entry.key_place.clone(), name, text, "the axes are x, y, z".to_owned());
                }
                Some(["x", "y", "z"].map(|axis| node.get(axis).map(|entry| &entry.node)))
            }
            Value::List(_) => {
                self.mismatch(node, name, &key.kind);
                None
            }
            _ if uniform => Some([Some(node); 3]),
            _ => {
                self.mismatch(node, name, &key.kind);
                None
            }
        }
    }

    /// One number per axis; axes that a table leaves out are zero, if zero is allowed.
    pub fn axes(&self, name: &str) -> Option<[f64; 3]> {
        let (key, node) = self.lookup(name);
        let Kind::Axes { uniform, range, .. } = key.kind else { panic!("`{name}` is not described as axes") };
        let values = match (node, key.default) {
            (Some(node), _) => {
                let nodes = self.axis_nodes(node, name, &key, uniform)?;
                let [x, y, z] = [0, 1, 2].map(|axis| {
                    let dotted = format!("{name}.{}", ["x", "y", "z"][axis]);
                    match nodes[axis] {
                        Some(item) => self.quantity(item, &dotted, &key.kind),
                        None if range.contains(0.0) => Some(0.0),
                        None => {
                            let remedy = format!("give all three axes: {}", key.kind.allowed());
                            self.report(node.place.clone(), &dotted, "missing".to_owned(), remedy);
                            None
                        }
                    }
                });
                [x?, y?, z?]
            }
            (None, Default::Number(value)) => [value; 3],
            _ => return None,
        };
        self.record(name, values.to_vec(), &unit_of(&key.kind));
        Some(values)
    }

    /// One word per axis.
    pub fn axis_words(&self, name: &str) -> [Option<String>; 3] {
        let (key, node) = self.lookup(name);
        let Kind::AxisWords(allowed) = key.kind else { panic!("`{name}` is not described as words per axis") };
        let words = match (node, key.default) {
            (Some(node), _) => match self.axis_nodes(node, name, &key, true) {
                Some(nodes) => nodes.map(|item| self.word(item?, name, &key.kind, allowed)),
                None => [const { None }; 3],
            },
            (None, Default::Word(word)) => [const { () }; 3].map(|()| Some(word.to_owned())),
            _ => [const { None }; 3],
        };
        let mut table = toml::map::Map::new();
        for (axis, word) in ["x", "y", "z"].iter().zip(&words) {
            if let Some(word) = word {
                table.insert((*axis).to_owned(), word.clone().into());
            }
        }
        if !table.is_empty() {
            self.record(name, table, "");
        }
        words
    }

    fn word(&self, node: &Node, name: &str, kind: &Kind, allowed: &[&str]) -> Option<String> {
        match &node.value {
            Value::Text(text) if allowed.is_empty() || allowed.contains(&text.as_str()) => Some(text.clone()),
            Value::Text(text) => {
                let message = format!("\"{text}\" is not known here{}", did_you_mean(text, allowed.iter().copied()));
                self.report(node.place.clone(), name, message, format!("allowed: {}", kind.allowed()));
                None
            }
            _ => {
                self.mismatch(node, name, kind);
                None
            }
        }
    }

    fn whole(&self, node: &Node, name: &str, kind: &Kind, min: u64) -> Option<u64> {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let value = match node.value {
            Value::Integer(v) => u64::try_from(v).ok(),
            // 1e5 is a float to TOML and a count to people.
            Value::Float(v) if v >= 0.0 && v <= 9e15 && libm::trunc(v) == v => Some(v as u64),
            _ => None,
        };
        if value.is_none_or(|v| v < min) {
            self.mismatch(node, name, kind);
            return None;
        }
        value
    }

    /// A whole number.
    pub fn integer(&self, name: &str) -> Option<u64> {
        let (key, node) = self.lookup(name);
        let Kind::Integer(min) = key.kind else { panic!("`{name}` is not described as a whole number") };
        let value = match (node, key.default) {
            (Some(node), _) => self.whole(node, name, &key.kind, min),
            (None, Default::Integer(value)) => Some(value),
            _ => None,
        }?;
        self.record(name, i64::try_from(value).unwrap_or(i64::MAX), "");
        Some(value)
    }

    /// Three whole numbers.
    pub fn integers3(&self, name: &str) -> Option<[usize; 3]> {
        let (key, node) = self.lookup(name);
        let node = node?;
        let Value::List(items) = &node.value else {
            self.mismatch(node, name, &key.kind);
            return None;
        };
        if items.len() != 3 {
            self.mismatch(node, name, &key.kind);
            return None;
        }
        let [x, y, z] = [0, 1, 2].map(|k| self.whole(&items[k], name, &key.kind, 1));
        let values = [x?, y?, z?];
        self.record(name, values.iter().map(|v| i64::try_from(*v).unwrap_or(i64::MAX)).collect::<Vec<_>>(), "");
        let [x, y, z] = values.map(|v| usize::try_from(v).ok());
        Some([x?, y?, z?])
    }

    /// A text.
    pub fn text(&self, name: &str) -> Option<String> {
        let (key, node) = self.lookup(name);
        let value = self.word(node?, name, &key.kind, &[])?;
        self.record(name, value.clone(), "");
        Some(value)
    }

    /// A text with a default that follows from other keys.
    pub fn text_or(&self, name: &str, default: &str) -> Option<String> {
        if self.given(name) {
            return self.text(name);
        }
        self.record(name, default, "");
        Some(default.to_owned())
    }

    /// Record another value than the one written, for the resolved text.
    pub fn record_text(&self, name: &str, value: &str) {
        self.record(name, value, "");
    }

    /// A fixed number of texts.
    pub fn texts(&self, name: &str) -> Option<Vec<String>> {
        let (key, node) = self.lookup(name);
        let node = node?;
        match (&node.value, key.kind) {
            (Value::List(items), Kind::Texts(count)) if items.len() == count => {
                let texts: Vec<_> = items.iter().map(|item| self.word(item, name, &key.kind, &[])).collect();
                let texts = texts.into_iter().collect::<Option<Vec<_>>>()?;
                self.record(name, texts.clone(), "");
                Some(texts)
            }
            _ => {
                self.mismatch(node, name, &key.kind);
                None
            }
        }
    }

    /// true or false.
    pub fn flag(&self, name: &str) -> Option<bool> {
        let (key, node) = self.lookup(name);
        let value = match (node.map(|n| (n, &n.value)), key.default) {
            (Some((_, Value::Flag(value))), _) => *value,
            (Some((node, _)), _) => {
                self.mismatch(node, name, &key.kind);
                return None;
            }
            (None, Default::Flag(value)) => value,
            _ => return None,
        };
        self.record(name, value, "");
        Some(value)
    }

    /// One of the described words, as its index.
    pub fn choice(&self, name: &str) -> Option<usize> {
        let (key, node) = self.lookup(name);
        let Kind::Choice(words) = key.kind else { panic!("`{name}` is not described as a choice") };
        let value = match (node, key.default) {
            (Some(node), _) => self.word(node, name, &key.kind, words)?,
            (None, Default::Word(word)) => word.to_owned(),
            _ => return None,
        };
        self.record(name, value.clone(), "");
        words.iter().position(|word| *word == value)
    }

    /// A time or a number of steps.
    pub fn interval(&self, name: &str) -> Option<Interval> {
        let (key, node) = self.lookup(name);
        let text = match (node, key.default) {
            (Some(node), _) => match &node.value {
                Value::Text(text) => text.clone(),
                _ => {
                    self.mismatch(node, name, &key.kind);
                    return None;
                }
            },
            (None, Default::Word(word)) => word.to_owned(),
            _ => return None,
        };
        match parse_interval(&text) {
            Ok(interval) => {
                let resolved = match interval {
                    Interval::Steps(steps) => format!("{steps} steps"),
                    Interval::Time(time) => format!("{time:?} s"),
                };
                self.record(name, resolved, "");
                Some(interval)
            }
            Err(message) => {
                self.problem(name, format!("\"{text}\": {message}"), format!("allowed: {}", key.kind.allowed()));
                None
            }
        }
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
                let value = self.quantity(node?, &path, &alternative.kind);
                if let Some(value) = value {
                    self.record(&path, value, &unit_of(&alternative.kind));
                }
                Some(Chosen::Value(alternative.name, value))
            }
        }
    }

    /// The single entry of a table of alternatives. One set on the command line outdoes the file's.
    fn only_entry(
        &self,
        node: &'a Node,
        name: &str,
        alternatives: &[Alternative],
        kind: &Kind,
    ) -> Option<&'a super::document::Entry> {
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

/// The SI unit written behind a number in the resolved text.
fn unit_of(kind: &Kind) -> String {
    match kind {
        Kind::Number(dimension, _) | Kind::Numbers(dimension, _) | Kind::Axes { dimension, .. } => dimension.unit(),
        _ => String::new(),
    }
}

fn parse_interval(text: &str) -> Result<Interval, String> {
    let trimmed = text.trim();
    if let Some(count) = trimmed.strip_suffix("steps").or_else(|| trimmed.strip_suffix("step")) {
        return match count.trim().parse::<u64>() {
            Ok(steps) if steps > 0 => Ok(Interval::Steps(steps)),
            _ => Err(format!("`{}` is not a whole number of steps greater than 0", count.trim())),
        };
    }
    if trimmed.parse::<f64>().is_ok() {
        return Err("a unit is missing: seconds or steps?".to_owned());
    }
    let time = crate::units::parse(trimmed, crate::units::Dimension::TIME)?;
    if time > 0.0 { Ok(Interval::Time(time)) } else { Err("not greater than 0".to_owned()) }
}
