//! The input as written: a tree of values, each with its place, from a TOML text and the `--set`
//! overrides of the command line.

use super::diagnostic::{Place, Problem, Source};
use std::ops::Range;
use toml::de::{DeTable, DeValue};

/// A value with its place.
#[derive(Debug, Clone)]
pub(super) struct Node {
    pub place: Place,
    pub value: Value,
}

/// A TOML value.
#[derive(Debug, Clone)]
pub(super) enum Value {
    Integer(i64),
    Float(f64),
    Text(String),
    Flag(bool),
    List(Vec<Node>),
    Table(Vec<Entry>),
}

/// A key and its value.
#[derive(Debug, Clone)]
pub(super) struct Entry {
    pub key: String,
    pub key_place: Place,
    pub node: Node,
}

impl Node {
    /// The entries, if this is a table.
    pub fn entries(&self) -> Option<&[Entry]> {
        if let Value::Table(entries) = &self.value { Some(entries) } else { None }
    }

    /// The value of `key`, if this is a table that has it.
    pub fn get(&self, key: &str) -> Option<&Entry> {
        self.entries()?.iter().find(|entry| entry.key == key)
    }

    /// What was found, for messages.
    pub fn found(&self) -> String {
        match &self.value {
            Value::Integer(v) => format!("the number {v}"),
            Value::Float(v) => format!("the number {v}"),
            Value::Text(v) => format!("the text \"{v}\""),
            Value::Flag(v) => format!("{v}"),
            Value::List(v) => format!("a list of {}", v.len()),
            Value::Table(_) => "a table".to_owned(),
        }
    }
}

/// Parse the file's text; syntax errors become problems.
pub(super) fn parse(text: &str, problems: &mut Vec<Problem>) -> Node {
    let (table, errors) = DeTable::parse_recoverable(text);
    for error in errors {
        problems.push(Problem {
            place: Place { source: 0, span: error.span().unwrap_or(0..0) },
            key: String::new(),
            message: format!("not valid TOML: {}", error.message()),
            remedy: "write `key = value` lines below `[section]` headers, each key once; texts in quotes".to_owned(),
        });
    }
    let span = table.span();
    let mut builder = Builder { source: 0, problems };
    Node { place: Place { source: 0, span: 0..span.end.min(1) }, value: builder.table(table.get_ref()) }
}

struct Builder<'a> {
    source: usize,
    problems: &'a mut Vec<Problem>,
}

impl Builder<'_> {
    fn place(&self, span: Range<usize>) -> Place {
        Place { source: self.source, span }
    }

    fn table(&mut self, table: &DeTable<'_>) -> Value {
        let mut entries = Vec::new();
        for (key, value) in table {
            let node = self.value(value.get_ref(), value.span());
            entries.push(Entry { key: key.get_ref().to_string(), key_place: self.place(key.span()), node });
        }
        entries.sort_by_key(|entry| entry.key_place.span.start);
        Value::Table(entries)
    }

    fn value(&mut self, value: &DeValue<'_>, span: Range<usize>) -> Node {
        let place = self.place(span);
        let result = match value {
            DeValue::String(text) => Value::Text(text.to_string()),
            DeValue::Integer(number) => match i64::from_str_radix(number.as_str(), number.radix()) {
                Ok(number) => Value::Integer(number),
                Err(_) => {
                    self.refuse(&place, "an integer beyond 64 bits", "use a number of at most 9223372036854775807")
                }
            },
            DeValue::Float(number) => match number.as_str().parse::<f64>() {
                Ok(number) => Value::Float(number),
                Err(_) => self.refuse(&place, "not a number", "write a decimal number"),
            },
            DeValue::Boolean(flag) => Value::Flag(*flag),
            DeValue::Datetime(_) => {
                self.refuse(&place, "a date has no place in this input", "write a number with its unit in quotes")
            }
            DeValue::Array(items) => {
                Value::List(items.iter().map(|item| self.value(item.get_ref(), item.span())).collect())
            }
            DeValue::Table(table) => self.table(table),
        };
        Node { place, value: result }
    }

    fn refuse(&mut self, place: &Place, message: &str, remedy: &str) -> Value {
        self.problems.push(Problem {
            place: place.clone(),
            key: String::new(),
            message: message.to_owned(),
            remedy: remedy.to_owned(),
        });
        Value::Integer(0)
    }
}

/// Put one `--set a.b.0.c=value` into the tree. The value is read as TOML, else taken as a text, so
/// that `--set stage.0.duration="2 s"` needs no second pair of quotes.
pub(super) fn set(root: &mut Node, sources: &mut Vec<Source>, argument: &str, problems: &mut Vec<Problem>) {
    let source = sources.len();
    sources.push(Source { name: "command line, --set".to_owned(), text: argument.to_owned() });
    let whole = Place { source, span: 0..argument.len() };
    let Some((path, text)) = argument.split_once('=') else {
        problems.push(Problem {
            place: whole,
            key: String::new(),
            message: format!("`{argument}` has no `=`"),
            remedy: "write --set key=value, for example --set stage.0.duration=\"2 s\"".to_owned(),
        });
        return;
    };
    let path_length = path.len();
    let value_place = Place { source, span: path_length + 1..argument.len() };
    let mut node = match DeValue::parse(text.trim()) {
        Ok(value) => Builder { source, problems }.value(value.get_ref(), 0..0),
        Err(_) => Node { place: value_place.clone(), value: Value::Text(text.trim().to_owned()) },
    };
    relocate(&mut node, &value_place);
    let result = descend(root, path.trim(), &Place { source, span: 0..path_length }, node);
    if let Err((message, remedy)) = result {
        problems.push(Problem { place: whole, key: path.to_owned(), message, remedy });
    }
}

/// Put a value from another option of the command line into the tree.
pub(super) fn put(
    root: &mut Node,
    sources: &mut Vec<Source>,
    option: &str,
    path: &str,
    value: Value,
    problems: &mut Vec<Problem>,
) {
    let text = match &value {
        Value::Text(text) => text.clone(),
        Value::Integer(number) => number.to_string(),
        _ => String::new(),
    };
    let place = Place { source: sources.len(), span: 0..text.len() };
    sources.push(Source { name: option.to_owned(), text });
    let node = Node { place: place.clone(), value };
    if let Err((message, remedy)) = descend(root, path, &place, node) {
        problems.push(Problem { place, key: path.to_owned(), message, remedy });
    }
}

fn relocate(node: &mut Node, place: &Place) {
    node.place = place.clone();
    match &mut node.value {
        Value::List(items) => items.iter_mut().for_each(|item| relocate(item, place)),
        Value::Table(entries) => {
            for entry in entries {
                entry.key_place = place.clone();
                relocate(&mut entry.node, place);
            }
        }
        _ => {}
    }
}

/// Walk to the place named by `path`, making tables on the way, and put `node` there.
fn descend(root: &mut Node, path: &str, place: &Place, node: Node) -> Result<(), (String, String)> {
    let mut current = root;
    for segment in path.split('.').map(str::trim) {
        if segment.is_empty() {
            return Err((format!("`{path}` has an empty part"), "write keys joined by single dots".to_owned()));
        }
        current = match &mut current.value {
            Value::List(items) => {
                let count = items.len();
                segment.parse().ok().and_then(|index: usize| items.get_mut(index)).ok_or_else(|| {
                    (
                        format!("`{segment}` is no entry of this list of {count}"),
                        format!("entries are counted from 0 to {}", count.saturating_sub(1)),
                    )
                })?
            }
            Value::Table(entries) => {
                let index = entries.iter().position(|entry| entry.key == segment).unwrap_or_else(|| {
                    let value = Node { place: place.clone(), value: Value::Table(Vec::new()) };
                    entries.push(Entry { key: segment.to_owned(), key_place: place.clone(), node: value });
                    entries.len() - 1
                });
                &mut entries[index].node
            }
            // A value such as radius = "5 um" gives way to a table such as radius.normal.
            plain => {
                *plain = Value::Table(Vec::new());
                let Value::Table(entries) = plain else { unreachable!("just made a table") };
                let value = Node { place: place.clone(), value: Value::Table(Vec::new()) };
                entries.push(Entry { key: segment.to_owned(), key_place: place.clone(), node: value });
                &mut entries[0].node
            }
        };
    }
    *current = node;
    Ok(())
}
