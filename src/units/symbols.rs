//! Unit symbols, SI prefixes, and the grammar of products, quotients and powers.

use super::Dimension;
use std::f64::consts::PI;

/// A unit as `factor / divisor × 10^exponent` of the SI unit of its dimension.
#[derive(Debug, Clone, Copy)]
pub(super) struct Unit {
    pub dimension: Dimension,
    pub exponent: i32,
    pub factor: f64,
    pub divisor: f64,
}

/// A symbol: name, takes SI prefixes, dimension, power of ten, factor that is no power of ten.
struct Symbol(&'static str, bool, Dimension, i32, f64);

const ENERGY: Dimension = Dimension([2, 1, -2, 0, 0]);
const POWER: Dimension = Dimension([2, 1, -3, 0, 0]);
const VOLUME: Dimension = Dimension([3, 0, 0, 0, 0]);

const SYMBOLS: [Symbol; 33] = [
    Symbol("m", true, Dimension::LENGTH, 0, 1.0),
    Symbol("micron", false, Dimension::LENGTH, -6, 1.0),
    Symbol("g", true, Dimension::MASS, -3, 1.0),
    Symbol("t", false, Dimension::MASS, 3, 1.0),
    Symbol("s", true, Dimension::TIME, 0, 1.0),
    Symbol("sec", false, Dimension::TIME, 0, 1.0),
    Symbol("second", false, Dimension::TIME, 0, 1.0),
    Symbol("seconds", false, Dimension::TIME, 0, 1.0),
    Symbol("min", false, Dimension::TIME, 0, 60.0),
    Symbol("minute", false, Dimension::TIME, 0, 60.0),
    Symbol("minutes", false, Dimension::TIME, 0, 60.0),
    Symbol("h", false, Dimension::TIME, 0, 3600.0),
    Symbol("hour", false, Dimension::TIME, 0, 3600.0),
    Symbol("hours", false, Dimension::TIME, 0, 3600.0),
    Symbol("day", false, Dimension::TIME, 0, 86400.0),
    Symbol("days", false, Dimension::TIME, 0, 86400.0),
    Symbol("K", true, Dimension([0, 0, 0, 1, 0]), 0, 1.0),
    Symbol("A", true, Dimension([0, 0, 0, 0, 1]), 0, 1.0),
    Symbol("N", true, Dimension::FORCE, 0, 1.0),
    Symbol("Pa", true, Dimension::PRESSURE, 0, 1.0),
    Symbol("bar", false, Dimension::PRESSURE, 5, 1.0),
    Symbol("J", true, ENERGY, 0, 1.0),
    Symbol("W", true, POWER, 0, 1.0),
    Symbol("V", true, Dimension([2, 1, -3, 0, -1]), 0, 1.0),
    Symbol("C", true, Dimension([0, 0, 1, 0, 1]), 0, 1.0),
    Symbol("Hz", true, Dimension::RATE, 0, 1.0),
    Symbol("L", true, VOLUME, -3, 1.0),
    Symbol("l", true, VOLUME, -3, 1.0),
    Symbol("rad", true, Dimension::NONE, 0, 1.0),
    Symbol("deg", false, Dimension::NONE, 0, PI / 180.0),
    Symbol("rpm", false, Dimension::RATE, 0, PI / 30.0),
    Symbol("%", false, Dimension::NONE, -2, 1.0),
    Symbol("1", false, Dimension::NONE, 0, 1.0),
];

const PREFIXES: [(&str, i32); 15] = [
    ("f", -15),
    ("p", -12),
    ("n", -9),
    ("u", -6),
    ("\u{b5}", -6),
    ("\u{3bc}", -6),
    ("m", -3),
    ("c", -2),
    ("d", -1),
    ("h", 2),
    ("k", 3),
    ("M", 6),
    ("G", 9),
    ("T", 12),
    ("P", 15),
];

impl Unit {
    /// Parse a unit such as `kg/m^3`, `MPa s`, `1/s` or `J/(kg K)`.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let mut parser = Parser { text, rest: text, depth: 0 };
        let unit = parser.product()?;
        if parser.rest.is_empty() {
            Ok(unit)
        } else {
            Err(parser.error(&format!("`{}` has no place here", parser.rest)))
        }
    }

    const ONE: Self = Self { dimension: Dimension::NONE, exponent: 0, factor: 1.0, divisor: 1.0 };

    /// `self · other^power`.
    fn times(self, other: Self, power: i32) -> Option<Self> {
        let repeat = |base: f64| (0..power.unsigned_abs()).fold(1.0, |product, _| product * base);
        let (up, down) = if power < 0 { (other.divisor, other.factor) } else { (other.factor, other.divisor) };
        Some(Self {
            dimension: self.dimension.times(other.dimension, power)?,
            exponent: self.exponent.checked_add(other.exponent.checked_mul(power)?)?,
            factor: self.factor * repeat(up),
            divisor: self.divisor * repeat(down),
        })
    }

    /// A symbol with or without prefix.
    fn symbol(name: &str) -> Option<Self> {
        let exact = SYMBOLS.iter().find(|s| s.0 == name).map(|s| (s, 0));
        let (symbol, prefix) = exact.or_else(|| {
            PREFIXES.iter().find_map(|(prefix, power)| {
                let rest = name.strip_prefix(prefix)?;
                SYMBOLS.iter().find(|s| s.1 && s.0 == rest).map(|s| (s, *power))
            })
        })?;
        Some(Self { dimension: symbol.2, exponent: symbol.3 + prefix, factor: symbol.4, divisor: 1.0 })
    }
}

/// The known unit most like `name`: letter case counts least.
fn nearest(name: &str) -> Option<String> {
    let plain = SYMBOLS.iter().filter(|s| s.0 != "1").map(|s| s.0.to_owned());
    let prefixed = SYMBOLS
        .iter()
        .filter(|s| s.1)
        .flat_map(|s| PREFIXES.iter().filter(|p| p.0.is_ascii()).map(move |(prefix, _)| format!("{prefix}{}", s.0)));
    plain
        .chain(prefixed)
        .map(|candidate| {
            let letters = strsim::osa_distance(&candidate.to_lowercase(), &name.to_lowercase());
            ((letters, strsim::osa_distance(&candidate, name)), candidate)
        })
        .filter(|((letters, _), _)| *letters <= (name.chars().count() / 2).max(1))
        .min_by_key(|(distance, candidate)| (*distance, candidate.chars().count()))
        .map(|(_, candidate)| candidate)
}

struct Parser<'a> {
    text: &'a str,
    rest: &'a str,
    depth: usize,
}

impl Parser<'_> {
    fn error(&self, what: &str) -> String {
        format!("unit `{}`: {what}", self.text)
    }

    fn skip_blanks(&mut self) -> bool {
        let trimmed = self.rest.trim_start();
        let skipped = trimmed.len() < self.rest.len();
        self.rest = trimmed;
        skipped
    }

    fn take(&mut self, characters: &[char]) -> bool {
        let Some(rest) = self.rest.strip_prefix(characters) else { return false };
        self.rest = rest;
        true
    }

    /// factor { (`*` | `·` | blank | `/`) factor }; a unit may begin with `/` (`"1 /s"`).
    fn product(&mut self) -> Result<Unit, String> {
        let mut unit = Unit::ONE;
        let mut divided = false;
        let mut first = true;
        loop {
            let blank = self.skip_blanks();
            if self.rest.is_empty() || self.rest.starts_with(')') {
                return if first { Err(self.error("a unit symbol is missing")) } else { Ok(unit) };
            }
            let power = if self.take(&['/']) {
                divided = true;
                -1
            } else {
                let explicit = self.take(&['*', '·']);
                if !first && blank && !explicit && divided {
                    return Err(self.error("a blank after a quotient is ambiguous; write a/(b c) or a/b*c"));
                }
                1
            };
            self.skip_blanks();
            let factor = self.factor()?;
            unit = unit.times(factor, power).ok_or_else(|| self.error("the powers are too large"))?;
            first = false;
        }
    }

    /// A symbol or a parenthesis, with an optional power.
    fn factor(&mut self) -> Result<Unit, String> {
        let base = if self.take(&['(']) {
            self.depth += 1;
            if self.depth > 8 {
                return Err(self.error("too many parentheses"));
            }
            let inner = self.product()?;
            if !self.take(&[')']) {
                return Err(self.error("`)` is missing"));
            }
            inner
        } else {
            let end = self.rest.find(|c: char| !(c.is_alphabetic() || c == '%')).unwrap_or(self.rest.len());
            let end = if end == 0 && self.rest.starts_with('1') { 1 } else { end };
            let (name, rest) = self.rest.split_at(end);
            if name.is_empty() {
                return Err(self.error("a unit symbol is missing"));
            }
            self.rest = rest;
            Unit::symbol(name).ok_or_else(|| match nearest(name) {
                Some(near) => format!("unknown unit `{name}`; did you mean `{near}`?"),
                None => format!("unknown unit `{name}`; known are SI units with prefixes, for example um, MPa, kg, ms"),
            })?
        };
        let power = self.power()?;
        Unit::ONE.times(base, power).ok_or_else(|| self.error("the powers are too large"))
    }

    /// `^3`, `^-1`, `3`, `-1`, `³`, `⁻¹` or nothing.
    fn power(&mut self) -> Result<i32, String> {
        let caret = self.take(&['^']);
        let plain: String = self.rest.chars().map_while(plain_digit).collect();
        if plain.is_empty() {
            return if caret { Err(self.error("a whole number must follow `^`")) } else { Ok(1) };
        }
        let length: usize = self.rest.chars().take(plain.chars().count()).map(char::len_utf8).sum();
        self.rest = &self.rest[length..];
        match plain.parse::<i32>() {
            Ok(power) if power.abs() <= 12 => Ok(power),
            _ => Err(self.error(&format!("`{plain}` is not a power between -12 and 12"))),
        }
    }
}

/// A digit or sign of an exponent, superscripts included.
fn plain_digit(c: char) -> Option<char> {
    const SUPERSCRIPTS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    match c {
        '0'..='9' | '-' => Some(c),
        '⁻' => Some('-'),
        _ => (0_u8..10).find(|d| SUPERSCRIPTS[usize::from(*d)] == c).map(|d| char::from(b'0' + d)),
    }
}
