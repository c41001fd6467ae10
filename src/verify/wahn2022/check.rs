//! What a figure must show, and whether it came out.

use crate::verify::number;

/// How a check ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// It came out.
    Pass,
    /// It did not.
    Fail,
    /// It did not, and the note says why it cannot or need not.
    Finding,
}

impl Verdict {
    /// As it stands in the table.
    pub fn word(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Fail => "FAIL",
            Self::Finding => "finding",
        }
    }
}

/// One line of the table.
#[derive(Debug, Clone, PartialEq)]
pub struct Check {
    /// What must show.
    pub claim: String,
    /// The range it must lie in.
    pub expected: String,
    /// What came out; several values as mean and range.
    pub got: String,
    /// Whether it did.
    pub verdict: Verdict,
    /// Why it is a finding.
    pub note: Option<&'static str>,
}

/// How values are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// As they are.
    Plain,
    /// Times 100, with a percent sign.
    Percent,
    /// As they are, followed by a unit.
    Of(&'static str),
}

impl Unit {
    fn show(self, value: f64) -> String {
        match self {
            Self::Plain => short(value),
            Self::Percent if value != 0.0 && value.abs() < 1e-5 => "< 0.001 %".to_owned(),
            Self::Percent => format!("{} %", short(100.0 * value)),
            Self::Of(unit) => format!("{} {unit}", short(value)),
        }
    }
}

/// Four digits at most: more says nothing about a packing.
fn short(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let size = libm::pow(10.0, libm::floor(libm::log10(value.abs())) - 3.0);
    number((value / size).round() * size)
}

impl Check {
    /// Every value (of each seed, or the only one) lies between `low` and `high`; there is at least one.
    pub fn within(claim: impl Into<String>, [low, high]: [f64; 2], unit: Unit, values: &[f64]) -> Self {
        // Written so that NaN fails.
        let holds = !values.is_empty() && values.iter().all(|value| (low..=high).contains(value));
        let expected = if low == f64::NEG_INFINITY {
            format!("≤ {}", unit.show(high))
        } else if high == f64::INFINITY {
            format!("≥ {}", unit.show(low))
        } else if low == high {
            unit.show(low)
        } else {
            format!("{} to {}", unit.show(low), unit.show(high))
        };
        let verdict = if holds { Verdict::Pass } else { Verdict::Fail };
        Self { claim: claim.into(), expected, got: spread_of(values, unit), verdict, note: None }
    }

    /// Every value is at most `high`.
    pub fn at_most(claim: impl Into<String>, high: f64, unit: Unit, values: &[f64]) -> Self {
        Self::within(claim, [f64::NEG_INFINITY, high], unit, values)
    }

    /// Something of the paper that need not come out: if it does not, that is a finding with this reason.
    pub fn or_finding(mut self, note: &'static str) -> Self {
        if self.verdict == Verdict::Fail {
            self.verdict = Verdict::Finding;
            self.note = Some(note);
        }
        self
    }

    /// A figure that could not be made.
    pub fn failed(claim: impl Into<String>, reason: String) -> Self {
        Self { claim: claim.into(), expected: String::new(), got: reason, verdict: Verdict::Fail, note: None }
    }
}

/// "mean (least … most)".
fn spread_of(values: &[f64], unit: Unit) -> String {
    match values {
        [] => "nothing".to_owned(),
        [value] => unit.show(*value),
        _ => {
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let least = values.iter().copied().fold(f64::INFINITY, |a, b| if b < a { b } else { a });
            let most = values.iter().copied().fold(f64::NEG_INFINITY, |a, b| if b > a { b } else { a });
            format!("{} ({} … {})", unit.show(mean), unit.show(least), unit.show(most))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_seed_outside_or_no_number_fails() {
        let check = |values: &[f64]| Check::within("", [0.9, 1.1], Unit::Plain, values).verdict;
        assert_eq!(check(&[0.95, 1.0, 1.1]), Verdict::Pass);
        assert_eq!(check(&[0.95, 1.2]), Verdict::Fail);
        assert_eq!(check(&[1.0, f64::NAN]), Verdict::Fail);
        assert_eq!(check(&[]), Verdict::Fail);
    }

    #[test]
    fn a_finding_is_what_does_not_come_out() {
        let check = |value: f64| Check::at_most("", 0.05, Unit::Percent, &[value]).or_finding("because");
        assert_eq!((check(0.04).verdict, check(0.04).note), (Verdict::Pass, None));
        assert_eq!((check(0.16).verdict, check(0.16).note), (Verdict::Finding, Some("because")));
    }

    #[test]
    fn ranges_and_spreads_read_well() {
        let check = Check::within("", [1.15, 1.17], Unit::Plain, &[1.1612345, 1.1598765]);
        assert_eq!((check.expected.as_str(), check.got.as_str()), ("1.15 to 1.17", "1.161 (1.16 … 1.161)"));
        let check = Check::at_most("", 0.001, Unit::Percent, &[0.000_123_456]);
        assert_eq!((check.expected.as_str(), check.got.as_str()), ("≤ 0.1 %", "0.01235 %"));
    }
}
