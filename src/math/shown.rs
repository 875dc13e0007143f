//! Numbers in messages.
//!
//! **Invariant:** a number has at most [`DIGITS`] significant digits, unless it needs more to differ from another.

use std::fmt;

/// Significant digits of a number in a sentence.
const DIGITS: usize = 5;

/// A number with few digits: 1e300 is not written with 301 digits, nor 0.1 + 0.2 with 17.
pub(crate) struct Shown(pub(crate) f64);

impl fmt::Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&rounded(self.0, DIGITS))
    }
}

/// A number that a message compares with `other`. It has enough digits to differ from it.
pub(crate) fn shown_against(number: f64, other: f64) -> String {
    // Seventeen digits distinguish any two doubles.
    let texts = (DIGITS..=17).map(|digits| (rounded(number, digits), rounded(other, digits)));
    let apart = texts.into_iter().find(|(one, other)| one != other);
    apart.map_or_else(|| rounded(number, DIGITS), |(one, _)| one)
}

fn rounded(number: f64, digits: usize) -> String {
    // Adding 0 removes the sign of a negative zero.
    let rounded = format!("{:.*e}", digits - 1, number + 0.0);
    // Subnormal numbers have fewer significant digits.
    let shortest = format!("{:e}", number + 0.0);
    let text = if shortest.len() < rounded.len() {
        shortest
    } else {
        rounded
    };
    let Some((mantissa, exponent)) = text.split_once('e') else {
        return text;
    };
    match text.parse::<f64>() {
        Ok(plain) if plain == 0.0 || (1e-4..1e5).contains(&plain.abs()) => plain.to_string(),
        _ => {
            let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.');
            format!("{mantissa}e{exponent}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_those_that_are_compared_differ() {
        for (number, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (0.1 + 0.2, "0.3"),
            (-1234.5678, "-1234.6"),
            (99_999.6, "1e5"),
            (0.000_099_999_7, "0.0001"),
            (f64::MAX, "1.7977e308"),
            (5e-324, "5e-324"),
            (f64::NEG_INFINITY, "-inf"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(Shown(number).to_string(), text);
        }
        assert_eq!(shown_against(2.000_000_1, 2.0), "2.0000001");
        assert_eq!(shown_against(2.0, 2.000_000_1), "2");
        assert_eq!(shown_against(2.0, 2.0), "2");
        assert_ne!(
            shown_against(2.0, 2.0_f64.next_up()),
            shown_against(2.0_f64.next_up(), 2.0)
        );
        assert_eq!(shown_against(1e157 / 3.0, 1.0), "3.3333e156");
    }
}
