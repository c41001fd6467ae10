//! Quantities with units as text, `"142 GPa"`, `"1.8 g/cm3"`, `"0.3 %"`, turned into SI numbers.
//! Knows physical dimensions and nothing of the program's input.

mod dimension;
mod symbols;

pub use dimension::Dimension;

use symbols::Unit;

/// Parse a quantity and check its dimension; the result is in SI units.
///
/// The text is a decimal number, then a unit: symbols with SI prefixes, joined by a space, `*` or
/// `·` (product) and `/` (quotient, of the next factor only), with powers written `m^3`, `m3`, `m³`
/// or `s^-1`; parentheses group. A number without a unit is taken as SI. Where the unit is a power of
/// ten of the SI one, the scale is applied to the decimal text, so that `"5 um"` is exactly `5e-6`.
///
/// # Errors
/// What is wrong in one sentence: no number, an unknown unit with the nearest known one, a wrong
/// dimension naming both, a value outside the range of a 64-bit float.
pub fn parse(text: &str, expected: Dimension) -> Result<f64, String> {
    let (number, unit_text) = split_number(text.trim())?;
    if unit_text.is_empty() {
        return finite(number, text);
    }
    let unit = Unit::parse(unit_text)?;
    if unit.dimension != expected {
        return Err(format!("`{unit_text}` is {}; expected {}", unit.dimension.describe(), expected.describe()));
    }
    let (mantissa, exponent) = split_exponent(number)?;
    let shifted = format!("{mantissa}e{}", exponent.saturating_add(unit.exponent));
    Ok(finite(&shifted, text)? * unit.factor / unit.divisor)
}

/// Whether the unit of a quantity counts cycles: `Hz`, with or without prefix. Angular velocities count radians.
#[must_use]
pub fn counts_cycles(text: &str) -> bool {
    split_number(text.trim()).is_ok_and(|(_, unit)| unit.split(|c: char| !c.is_alphabetic()).any(|s| s.ends_with("Hz")))
}

/// The leading decimal number and the rest without blanks around it.
fn split_number(text: &str) -> Result<(&str, &str), String> {
    let bytes = text.as_bytes();
    let digits = |from: usize| bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
    let mut end = usize::from(matches!(bytes.first(), Some(b'+' | b'-')));
    let whole = digits(end);
    end += whole;
    let mut fraction = 0;
    if bytes.get(end) == Some(&b'.') {
        fraction = digits(end + 1);
        end += 1 + fraction;
    }
    if whole + fraction == 0 {
        return Err("no number at the start; write a number, then a unit, for example \"5 um\"".to_owned());
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        let exponent = bytes.get(end + 1 + sign..).map_or(0, |_| digits(end + 1 + sign));
        if exponent > 0 {
            end += 1 + sign + exponent;
        }
    }
    Ok((&text[..end], text[end..].trim()))
}

/// `"1.8e3"` as `("1.8", 3)`.
fn split_exponent(number: &str) -> Result<(&str, i32), String> {
    match number.split_once(['e', 'E']) {
        None => Ok((number, 0)),
        Some((mantissa, exponent)) => exponent
            .parse()
            .map(|e| (mantissa, e))
            .map_err(|_| format!("`{number}` is outside the range of a 64-bit float")),
    }
}

fn finite(number: &str, text: &str) -> Result<f64, String> {
    match number.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) => Err(format!("`{text}` is outside the range of a 64-bit float")),
        Err(_) => Err(format!("`{number}` is not a number")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prefixes_give_the_correctly_rounded_decimal() {
        let cases = [
            ("5 um", Dimension::LENGTH, 5e-6),
            ("0.25um", Dimension::LENGTH, 0.25e-6),
            ("5 µm", Dimension::LENGTH, 5e-6),
            ("142 GPa", Dimension::PRESSURE, 142e9),
            ("1365.9 MPa", Dimension::PRESSURE, 1365.9e6),
            ("1.8e3 kg/m^3", Dimension::DENSITY, 1.8e3),
            ("1.8 g/cm3", Dimension::DENSITY, 1800.0),
            ("1.8 g cm^-3", Dimension::DENSITY, 1800.0),
            ("728.28 MPa s", Dimension::VISCOSITY, 728.28e6),
            ("1/s", Dimension::RATE, 1.0),
            ("0.003 1/s", Dimension::RATE, 0.003),
            ("0.003 s⁻¹", Dimension::RATE, 0.003),
            ("3 rad/s", Dimension::RATE, 3.0),
            ("-9.81 m/s^2", Dimension::ACCELERATION, -9.81),
            ("0.3 %", Dimension::NONE, 0.003),
            ("2 hours", Dimension::TIME, 7200.0),
            ("30 min", Dimension::TIME, 1800.0),
            ("36 km/h", Dimension::VELOCITY, 10.0),
            ("7", Dimension::TIME, 7.0),
            ("2 J/(kg K)", Dimension([2, 0, -2, -1, 0]), 2.0),
            ("1 N/mm2", Dimension::PRESSURE, 1e6),
        ];
        for (text, dimension, value) in cases {
            assert_eq!(parse(text, dimension), Ok(value), "{text}");
        }
    }

    #[test]
    fn hertz_counts_cycles() {
        assert!(["2 Hz", "1 kHz", "3 rad Hz"].into_iter().all(counts_cycles));
        assert!(!["2 1/s", "3 rad/s", "60 rpm", "5", "word"].into_iter().any(counts_cycles));
    }

    #[test]
    fn a_wrong_dimension_names_both() {
        let message = parse("5 um", Dimension::PRESSURE).unwrap_err();
        assert_eq!(message, "`um` is a length (m); expected a pressure (Pa)");
    }

    #[test]
    fn an_unknown_unit_names_the_nearest() {
        for (text, nearest) in [("1 Gpa", "GPa"), ("1 gpa", "GPa"), ("1 kgg/m3", "kg"), ("1 kPaa", "kPa")] {
            let message = parse(text, Dimension::PRESSURE).unwrap_err();
            assert!(message.contains(&format!("did you mean `{nearest}`")), "{message}");
        }
    }

    #[test]
    fn malformed_text_is_an_error_and_never_a_panic() {
        for text in
            ["", "um", "5 /", "5 m^", "5 m^x", "5 (m", "5 m)", "5 J/kg K", "1e999 m", "1e99999999999 m", "5 m^999"]
        {
            assert!(parse(text, Dimension::LENGTH).is_err(), "{text}");
        }
    }
}
