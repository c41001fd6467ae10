//! Reads single values and lists of values: numbers with units, words, flags, intervals.

use super::Interval;
use super::diagnostic::did_you_mean;
use super::document::{Node, Value};
use super::schema::{Default, Key, Kind};
use super::section::Section;

/// Up to here every whole number is a float of its own.
const LARGEST_WHOLE: f64 = 9e15;

impl<'a> Section<'a> {
    /// One number in SI units; `name` may be `key.x` for messages.
    pub(super) fn quantity(&self, node: &Node, name: &str, kind: &Kind) -> Option<f64> {
        let (Kind::Number(dimension, range) | Kind::Numbers(dimension, range) | Kind::Axes { dimension, range, .. }) =
            kind
        else {
            panic!("`{name}` is described as {kind:?}, not as numbers")
        };
        let value = match &node.value {
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

    /// As [`Self::axes`], for angular velocities: a unit that counts cycles is refused.
    pub fn angular_axes(&self, name: &str) -> Option<[f64; 3]> {
        let nodes = match self.node(name).map(|node| &node.value) {
            Some(Value::List(items)) => items.iter().collect(),
            Some(Value::Table(entries)) => entries.iter().map(|entry| &entry.node).collect(),
            _ => Vec::new(),
        };
        let mut faulty = false;
        for node in nodes {
            let Value::Text(text) = &node.value else { continue };
            if crate::units::counts_cycles(text) {
                let message = format!("\"{text}\": Hz counts revolutions, and an angular velocity counts radians");
                let remedy = "write rad/s or 1/s (one revolution is 2π rad), or rpm for revolutions per minute";
                self.report(node.place.clone(), name, message, remedy.to_owned());
                faulty = true;
            }
        }
        self.axes(name).filter(|_| !faulty)
    }

    /// One word per axis.
    pub fn axis_words(&self, name: &str) -> [Option<String>; 3] {
        let (key, node) = self.lookup(name);
        let Kind::AxisWords(allowed) = key.kind else { panic!("`{name}` is not described as words per axis") };
        let words = match (node, key.default) {
            (Some(node), _) => match self.axis_nodes(node, name, &key, true) {
                Some(nodes) => nodes.map(|item| match (item, key.default) {
                    (Some(item), _) => self.word(item, name, &key.kind, allowed),
                    (None, Default::Word(word)) => Some(word.to_owned()),
                    _ => None,
                }),
                None => [const { None }; 3],
            },
            (None, Default::Word(word)) => [const {}; 3].map(|()| Some(word.to_owned())),
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
        let value = match node.value {
            Value::Integer(v) => u64::try_from(v).ok(),
            // 1e5 is a float to TOML and a count to people.
            Value::Float(v) if (0.0..=LARGEST_WHOLE).contains(&v) && libm::trunc(v) == v => Some(v as u64),
            _ => None,
        };
        let Some(value) = value.filter(|value| *value >= min) else {
            match node.value {
                Value::Float(v) if v > LARGEST_WHOLE => {
                    let remedy = format!("allowed: {}, at most {LARGEST_WHOLE:e}", kind.allowed());
                    self.report(node.place.clone(), name, format!("{} is too large", node.found()), remedy);
                }
                _ => self.mismatch(node, name, kind),
            }
            return None;
        };
        Some(value)
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

    /// Whether an interval counts increments; a faulty one does not.
    pub fn counts_increments(&self, name: &str) -> bool {
        let text = self.node(name).map(|node| &node.value);
        matches!(text, Some(Value::Text(text)) if matches!(parse_interval(text), Ok(Interval::Increments(_))))
    }

    /// A time, or a number of steps or increments.
    pub fn interval(&self, name: &str) -> Option<Interval> {
        let (key, node) = self.lookup(name);
        let text = match (node, key.default) {
            (Some(node), _) => {
                if let Value::Text(text) = &node.value {
                    text.clone()
                } else {
                    self.mismatch(node, name, &key.kind);
                    return None;
                }
            }
            (None, Default::Word(word)) => word.to_owned(),
            _ => return None,
        };
        match parse_interval(&text) {
            Ok(interval) => {
                let resolved = match interval {
                    Interval::Steps(steps) => format!("{steps} steps"),
                    Interval::Time(time) => format!("{time:?} s"),
                    Interval::Increments(count) => format!("{count} increments"),
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
}

/// The SI unit written behind a number in the resolved text.
pub(super) fn unit_of(kind: &Kind) -> String {
    match kind {
        Kind::Number(dimension, _) | Kind::Numbers(dimension, _) | Kind::Axes { dimension, .. } => dimension.unit(),
        _ => String::new(),
    }
}

fn parse_interval(text: &str) -> Result<Interval, String> {
    let trimmed = text.trim();
    for word in ["step", "increment"] {
        if let Some(count) = trimmed.trim_end_matches('s').strip_suffix(word) {
            return match count.trim().parse::<u64>() {
                Ok(count) if count > 0 => {
                    Ok(if word == "step" { Interval::Steps(count) } else { Interval::Increments(count) })
                }
                _ => Err(format!("`{}` is not a whole number of {word}s greater than 0", count.trim())),
            };
        }
    }
    if trimmed.parse::<f64>().is_ok() {
        return Err("a unit is missing: seconds or steps?".to_owned());
    }
    let time = crate::units::parse(trimmed, crate::units::Dimension::TIME)?;
    if time > 0.0 { Ok(Interval::Time(time)) } else { Err("not greater than 0".to_owned()) }
}
