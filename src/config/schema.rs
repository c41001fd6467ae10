//! How the keys of the input are described: kind, range, default, meaning. The reader, the input
//! reference and the commented example all work from these descriptions.

use crate::force::registry::Role;
use crate::units::Dimension;

/// An interval of allowed values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Lower end.
    pub min: f64,
    /// Upper end.
    pub max: f64,
    /// The lower end itself is allowed.
    pub min_allowed: bool,
    /// The upper end itself is allowed.
    pub max_allowed: bool,
}

impl Range {
    /// Every finite number.
    pub const ANY: Self = Self { min: f64::NEG_INFINITY, max: f64::INFINITY, min_allowed: false, max_allowed: false };
    /// Greater than zero.
    pub const POSITIVE: Self = Self { min: 0.0, ..Self::ANY };
    /// Zero or greater.
    pub const NOT_NEGATIVE: Self = Self { min: 0.0, min_allowed: true, ..Self::ANY };
    /// In (0, 1].
    pub const FRACTION: Self = Self { min: 0.0, max: 1.0, min_allowed: false, max_allowed: true };

    /// Both ends excluded.
    #[must_use]
    pub const fn between(min: f64, max: f64) -> Self {
        Self { min, max, min_allowed: false, max_allowed: false }
    }

    /// Both ends included (an infinite end stays excluded: values are finite).
    #[must_use]
    pub const fn closed(min: f64, max: f64) -> Self {
        Self { min, max, min_allowed: true, max_allowed: true }
    }

    /// Whether a value is allowed.
    #[must_use]
    pub fn contains(&self, value: f64) -> bool {
        value.is_finite()
            && (value > self.min || (self.min_allowed && value >= self.min))
            && (value < self.max || (self.max_allowed && value <= self.max))
    }

    /// For messages: `greater than 0`, `in (-1, 0.5)`; empty when everything is allowed.
    #[must_use]
    pub fn describe(&self) -> String {
        let (low, high) = (self.min > f64::NEG_INFINITY, self.max < f64::INFINITY);
        match (low, high) {
            (false, false) => String::new(),
            (true, false) if self.min_allowed => format!("{} or greater", self.min),
            (true, false) => format!("greater than {}", self.min),
            (false, true) if self.max_allowed => format!("{} or less", self.max),
            (false, true) => format!("less than {}", self.max),
            (true, true) => format!(
                "in {}{}, {}{}",
                if self.min_allowed { '[' } else { '(' },
                self.min,
                self.max,
                if self.max_allowed { ']' } else { ')' }
            ),
        }
    }
}

/// What a key holds.
#[derive(Debug, Clone, Copy)]
pub enum Kind {
    /// A number with a unit.
    Number(Dimension, Range),
    /// A list of numbers with a unit.
    Numbers(Dimension, Range),
    /// One number per axis: a list of three, or a table with x, y, z.
    Axes {
        /// Dimension of each.
        dimension: Dimension,
        /// Range of each.
        range: Range,
        /// One value for all three axes is allowed too.
        uniform: bool,
    },
    /// One word per axis, or one for all; of the given words, or any text if there are none.
    AxisWords(&'static [&'static str]),
    /// A whole number of at least this size.
    Integer(u64),
    /// Three whole numbers of at least 1.
    Integers3,
    /// A text.
    Text,
    /// A list of this many texts.
    Texts(usize),
    /// true or false.
    Flag,
    /// One of these words.
    Choice(&'static [&'static str]),
    /// `"0.1 s"`, `"1000 steps"` or `"10 increments"`.
    Interval,
    /// A section.
    Table(&'static Table),
    /// Any number of sections, `[[...]]`.
    List(&'static Table),
    /// Exactly one of the table's keys; a plain value stands for the key named here.
    OneOf(&'static Table, Option<&'static str>),
    /// A contact law of this part of the contact.
    Law(Role),
}

/// The value of an absent key.
#[derive(Debug, Clone, Copy)]
pub enum Default {
    /// The key must be there.
    Required,
    /// Nothing; the meaning says what happens then.
    Absent,
    /// A number in SI units.
    Number(f64),
    /// A whole number.
    Integer(u64),
    /// A word.
    Word(&'static str),
    /// true or false.
    Flag(bool),
    /// Computed from other keys, as the text says.
    Derived(&'static str),
}

/// A key.
#[derive(Debug, Clone, Copy)]
pub struct Key {
    /// Name.
    pub name: &'static str,
    /// What it holds.
    pub kind: Kind,
    /// Value when absent.
    pub default: Default,
    /// One sentence for the reference.
    pub meaning: &'static str,
}

/// A section and its keys, in the order of the reference.
#[derive(Debug, Clone, Copy)]
pub struct Table {
    /// What the section describes.
    pub meaning: &'static str,
    /// Its keys.
    pub keys: &'static [Key],
}

/// A key description, short enough for tables of them.
pub(super) const fn key(name: &'static str, kind: Kind, default: Default, meaning: &'static str) -> Key {
    Key { name, kind, default, meaning }
}

impl Kind {
    /// What is allowed, for messages and the reference.
    #[must_use]
    pub fn allowed(&self) -> String {
        let ranged = |what: String, range: &Range| match range.describe() {
            text if text.is_empty() => what,
            text => format!("{what}, {text}"),
        };
        match self {
            Self::Number(dimension, range) => ranged(dimension.describe(), range),
            Self::Numbers(dimension, range) => ranged(format!("a list; each {}", dimension.describe()), range),
            Self::Axes { dimension, range, uniform } => {
                let one = if *uniform { "one value for all axes, " } else { "" };
                ranged(format!("{one}[x, y, z] or {{x = …, y = …, z = …}}; each {}", dimension.describe()), range)
            }
            Self::AxisWords([]) => "one text for all axes, or {x = \"…\", …}".to_owned(),
            Self::AxisWords(words) => format!("{}; one for all axes, [x, y, z] or {{x = …, …}}", quoted(words)),
            Self::Integer(0) => "a whole number".to_owned(),
            Self::Integer(min) => format!("a whole number, {min} or greater"),
            Self::Integers3 => "[x, y, z], three whole numbers, 1 or greater".to_owned(),
            Self::Text => "a text".to_owned(),
            Self::Texts(count) => format!("a list of {count} texts"),
            Self::Flag => "true or false".to_owned(),
            Self::Choice(words) => quoted(words),
            Self::Interval => {
                "a time such as \"0.1 s\" or a count such as \"1000 steps\" or \"10 increments\", greater than 0"
                    .to_owned()
            }
            Self::Table(_) => "a section".to_owned(),
            Self::List(_) => "sections in double brackets, [[…]]".to_owned(),
            Self::OneOf(table, _) => {
                format!("exactly one of {}", quoted(&table.keys.iter().map(|k| k.name).collect::<Vec<_>>()))
            }
            Self::Law(role) => format!("exactly one of {}", quoted(&super::contact::alternatives(*role))),
        }
    }
}

/// `"a", "b" or "c"`.
pub(super) fn quoted(words: &[&str]) -> String {
    let quoted: Vec<String> = words.iter().map(|word| format!("\"{word}\"")).collect();
    match quoted.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
        Some((last, _)) => last.clone(),
        None => "nothing".to_owned(),
    }
}
