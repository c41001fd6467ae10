//! `dem-mpi verify`: runs cases with a known answer through the whole program in this process and
//! compares. Knows the simulation from outside only, as a user's script would.

pub mod becker2021;
mod collision;
mod conservation;
mod ellipsoids;
mod hereditary;
mod oblique;
mod plastic;
mod scene;
mod sliding;
mod viscoelastic;
pub mod wahn2022;

use crate::error::Result;
use std::time::Instant;

/// Exit code of a filter that names no case.
const EXIT_NO_CASE: i32 = 2;

/// What a result may be, beside the expected value.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Tolerance {
    /// Off by at most this much.
    Absolute(f64),
    /// Off by at most this share of the expected value.
    Relative(f64),
    /// Magnitude at most the expected value.
    Bound,
}

/// One comparison.
#[derive(Debug, Clone, PartialEq)]
struct Claim {
    text: String,
    expected: f64,
    got: f64,
    tolerance: Tolerance,
}

impl Claim {
    fn relative(text: impl Into<String>, expected: f64, got: f64, share: f64) -> Self {
        Self { text: text.into(), expected, got, tolerance: Tolerance::Relative(share) }
    }

    fn absolute(text: impl Into<String>, expected: f64, got: f64, difference: f64) -> Self {
        Self { text: text.into(), expected, got, tolerance: Tolerance::Absolute(difference) }
    }

    /// An error that is at most `bound`.
    fn bounded(text: impl Into<String>, bound: f64, got: f64) -> Self {
        Self { text: text.into(), expected: bound, got, tolerance: Tolerance::Bound }
    }

    /// Written so that NaN fails.
    fn passes(&self) -> bool {
        let off = (self.got - self.expected).abs();
        match self.tolerance {
            Tolerance::Absolute(difference) => off <= difference,
            Tolerance::Relative(share) => off <= share * self.expected.abs(),
            Tolerance::Bound => self.got.abs() <= self.expected,
        }
    }

    fn row(&self) -> [String; 5] {
        let (sign, tolerance) = match self.tolerance {
            Tolerance::Absolute(difference) => ("", format!("± {}", number(difference))),
            Tolerance::Relative(share) => ("", format!("± {} %", number(100.0 * share))),
            Tolerance::Bound => ("≤ ", String::new()),
        };
        let verdict = if self.passes() { "pass" } else { "FAIL" };
        [self.text.clone(), format!("{sign}{}", number(self.expected)), number(self.got), tolerance, verdict.to_owned()]
    }
}

/// Six digits, with an exponent where plain digits would be long.
fn number(value: f64) -> String {
    let magnitude = value.abs();
    if value == 0.0 || (1e-3..1e5).contains(&magnitude) {
        let digits = if magnitude < 1.0 { 6 } else { 5 - libm::floor(libm::log10(magnitude)) as usize };
        let text = format!("{value:.digits$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    } else {
        let text = format!("{value:.5e}");
        let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        format!("{}e{exponent}", mantissa.trim_end_matches('0').trim_end_matches('.'))
    }
}

/// A case: runs, and says what it found.
struct Case {
    name: &'static str,
    run: fn() -> Result<Vec<Claim>>,
}

const CASES: &[Case] = &[
    Case { name: "Hertz impact of two spheres (Chung & Ooi 2011, test 1)", run: collision::spheres },
    Case { name: "Hertz impact on a rigid wall (Chung & Ooi 2011, test 2)", run: collision::rigid_wall },
    Case { name: "restitution (Chung & Ooi 2011, test 3)", run: collision::restitution },
    Case { name: "oblique impact on a wall (Chung & Ooi 2011, test 4)", run: oblique::wall },
    Case { name: "oblique impact of two spheres (Chung & Ooi 2011, test 5)", run: oblique::spheres },
    Case { name: "Maxwell-Zener strain rates (W Fig. 9)", run: viscoelastic::rates },
    Case { name: "Maxwell-Zener relaxation (W Fig. 10)", run: viscoelastic::relaxation },
    Case { name: "Thornton force along a path of overlaps", run: plastic::path },
    Case { name: "Thornton restitution (Thornton 1997)", run: plastic::restitution },
    Case { name: "Becker-Kamlah force along a path of overlaps (B Table 3)", run: ellipsoids::path },
    Case { name: "off-centre impact of two ellipsoids", run: ellipsoids::conservation },
    Case { name: "spheres treated as ellipsoids", run: ellipsoids::spheres },
    Case { name: "generalised Maxwell: hereditary integral, several branches", run: hereditary::branches },
    Case { name: "sliding block and rolling sphere", run: sliding::to_rest },
    Case { name: "momentum and energy of a periodic gas", run: conservation::gas },
    Case { name: "order of the integrator", run: conservation::order },
];

/// Run the cases whose name contains `filter` (all without one), print the table, and return the exit
/// code: 0 if every claim holds, 1 if one fails, 2 if no case has such a name.
#[must_use]
pub fn main(filter: Option<&str>) -> i32 {
    let wanted = filter.unwrap_or_default().to_lowercase();
    let cases: Vec<&Case> = CASES.iter().filter(|case| case.name.to_lowercase().contains(&wanted)).collect();
    if cases.is_empty() {
        let names: Vec<&str> = CASES.iter().map(|case| case.name).collect();
        eprintln!("dem-mpi: no case has \"{wanted}\" in its name; the cases are:\n  {}", names.join("\n  "));
        return EXIT_NO_CASE;
    }
    let started = Instant::now();
    let (mut passed, mut failed) = (0, 0);
    say!("{}", aligned(&["claim", "expected", "got", "tolerance", ""].map(str::to_owned)));
    for case in cases {
        say!("\n{}", case.name);
        match (case.run)() {
            Ok(claims) => {
                for claim in &claims {
                    say!("{}", aligned(&claim.row()));
                }
                let good = claims.iter().filter(|claim| claim.passes()).count();
                passed += good;
                failed += claims.len() - good;
            }
            Err(error) => {
                say!("  FAIL: {error}");
                failed += 1;
            }
        }
    }
    say!("\n{passed} passed, {failed} failed, {:.1} s", started.elapsed().as_secs_f64());
    i32::from(failed > 0)
}

/// One line of the table.
fn aligned([claim, expected, got, tolerance, verdict]: &[String; 5]) -> String {
    format!("  {claim:<64} {expected:>12} {got:>12} {tolerance:>12}  {verdict}").trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_show_six_digits_at_most() {
        let shown = [0.0, 0.55, 10697.0, 2.741234567e-4, 1e-12, 40.3, 123456.0, -1.5].map(number);
        assert_eq!(shown, ["0", "0.55", "10697", "2.74123e-4", "1e-12", "40.3", "1.23456e5", "-1.5"]);
    }

    #[test]
    fn a_result_that_is_no_number_fails() {
        for claim in [
            Claim::relative("", 1.0, f64::NAN, 1.0),
            Claim::absolute("", 1.0, f64::NAN, 1.0),
            Claim::bounded("", 1.0, f64::NAN),
        ] {
            assert!(!claim.passes());
        }
    }
}
