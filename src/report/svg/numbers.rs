//! Numbers in readable form, with SI prefixes and powers of ten.
//!
//! **Invariant:** a number and its unit stay on one line.

/// A power of ten: `10⁻⁶`, `10` and 1.
pub fn power(exponent: f64) -> String {
    match exponent.round() {
        0.0 => "1".to_owned(),
        1.0 => "10".to_owned(),
        exponent => format!("10{}", superscript(&format!("{exponent}"))),
    }
}

fn superscript(digits: &str) -> String {
    let raised = "⁰¹²³⁴⁵⁶⁷⁸⁹";
    let of = |digit: char| {
        let place = digit.to_digit(10).map_or(0, |digit| digit as usize);
        raised.chars().nth(place).unwrap_or(digit)
    };
    let digits = digits.chars();
    digits
        .map(|it| if it == '-' { '⁻' } else { of(it) })
        .collect()
}

/// A number with at most 3 significant digits and no trailing zeros.
pub fn number(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        size if !size.is_finite() => format!("{value}"),
        size if !(1e-3..1e6).contains(&size) => with_power(&format!("{value:.1e}")),
        size if size >= 100.0 => format!("{value:.0}"),
        _ => {
            let rounded = format!("{value:.2e}").parse().unwrap_or(value);
            format!("{rounded}")
        }
    }
}

/// A number of any magnitude: `2.3·10⁻⁹`, or plain if that is short.
pub fn scientific(value: f64) -> String {
    if value == 0.0 || (0.01..1e4).contains(&value.abs()) {
        return number(value);
    }
    with_power(&format!("{value:.1e}"))
}

/// A number with one significant digit: `2·10⁻⁹`.
pub fn one_digit(value: f64) -> String {
    with_power(&format!("{value:.0e}"))
}

fn with_power(text: &str) -> String {
    match text.split_once('e') {
        Some((mantissa, exponent)) => format!("{mantissa}·10{}", superscript(exponent)),
        None => text.to_owned(),
    }
}

/// A time with its SI prefix: `250 µs`.
pub fn seconds(value: f64) -> String {
    let (factor, unit) = match value.abs() {
        v if v == 0.0 || v >= 0.9995 => (1.0, "s"),
        v if v >= 0.9995e-3 => (1e3, "ms"),
        v if v >= 0.9995e-6 => (1e6, "µs"),
        _ => (1e9, "ns"),
    };
    format!("{}\u{a0}{unit}", number(value * factor))
}

/// A text with its numbers like `1.2e-9` written `1.2·10⁻⁹`.
pub fn plain(text: &str) -> String {
    let in_number = |it: char| it.is_ascii_digit() || matches!(it, '.' | 'e' | '-' | '+');
    let (mut out, mut rest) = (String::new(), text);
    while let Some(start) = rest.find(|it: char| it.is_ascii_digit()) {
        let (before, number) = rest.split_at(start);
        let end = number.find(|it| !in_number(it)).unwrap_or(number.len());
        let (number, after) = number.split_at(end);
        // A full stop or a range's dash is not part of a number.
        let trimmed = number.trim_end_matches(|it: char| !it.is_ascii_digit());
        let value = trimmed.split_once('e').and_then(|_| trimmed.parse().ok());
        out.push_str(before);
        out.push_str(&value.map_or_else(|| trimmed.to_owned(), scientific));
        out.push_str(number.get(trimmed.len()..).unwrap_or_default());
        rest = after;
    }
    out + rest
}
