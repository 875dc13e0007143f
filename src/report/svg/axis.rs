//! Axes: from values to places on the paper, and what is written beside them.
//!
//! **Invariant:** a tick's label says its value exactly.

/// How values are spaced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scale {
    Log,
    Linear,
}

/// How a tick's value is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Unit {
    /// Powers of ten, or plain numbers on a linear axis.
    Number,
    /// Seconds, with SI prefixes.
    Seconds,
}

/// One axis of a plot.
#[derive(Debug, Clone)]
pub(crate) struct Axis {
    pub(crate) label: &'static str,
    pub(crate) scale: Scale,
    pub(crate) unit: Unit,
    pub(crate) min: f64,
    pub(crate) max: f64,
}

impl Axis {
    /// A logarithmic axis over whole decades around `values`, those that are positive and finite.
    pub(crate) fn log(
        label: &'static str,
        unit: Unit,
        values: impl IntoIterator<Item = f64>,
    ) -> Self {
        let (min, max) =
            bounds(values.into_iter().filter(|value| *value > 0.0)).unwrap_or((1.0, 10.0));
        let (min, max) = (min.log10().floor(), max.log10().ceil());
        let max = if max > min { max } else { min + 1.0 };
        Self {
            label,
            scale: Scale::Log,
            unit,
            min: 10_f64.powf(min),
            max: 10_f64.powf(max),
        }
    }

    /// A logarithmic axis from `min` to `max` as they are.
    pub(crate) fn log_between(label: &'static str, unit: Unit, min: f64, max: f64) -> Self {
        Self {
            label,
            scale: Scale::Log,
            unit,
            min,
            max,
        }
    }

    /// A linear axis from `min` to `max`.
    pub(crate) fn linear(label: &'static str, min: f64, max: f64) -> Self {
        Self {
            label,
            scale: Scale::Linear,
            unit: Unit::Number,
            min,
            max,
        }
    }

    /// The place of `value`: 0 at the start of the axis, 1 at its end.
    pub(crate) fn place(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Log => (value / self.min).log10() / (self.max / self.min).log10(),
            Scale::Linear => (value - self.min) / (self.max - self.min),
        }
    }

    /// Whether `value` lies between the ends, give or take rounding.
    pub(crate) fn holds(&self, value: f64) -> bool {
        (-1e-9..=1.0 + 1e-9).contains(&self.place(value))
    }

    /// Ticks, at most some `most` of them: value and label.
    pub(crate) fn ticks(&self, most: f64) -> Vec<(f64, String)> {
        match self.scale {
            Scale::Linear => self.linear_ticks(most),
            Scale::Log => self.log_ticks(most),
        }
    }

    fn linear_ticks(&self, most: f64) -> Vec<(f64, String)> {
        let span = self.max - self.min;
        let raw = span / most;
        let magnitude = 10_f64.powf(raw.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0]
            .into_iter()
            .map(|factor| factor * magnitude)
            .find(|step| *step >= raw)
            .unwrap_or(raw);
        let first = (self.min / step - 1e-9).ceil();
        let mut ticks = Vec::new();
        let mut index = first;
        while index * step <= self.max + 1e-9 * span {
            ticks.push((index * step, number(index * step)));
            index += 1.0;
        }
        ticks
    }

    fn log_ticks(&self, most: f64) -> Vec<(f64, String)> {
        let (first, last) = (
            (self.min.log10() - 1e-9).ceil(),
            (self.max.log10() + 1e-9).floor(),
        );
        let stride = ((last - first) / most).ceil().max(1.0);
        let mut ticks = Vec::new();
        // Decades alone would leave a short axis bare.
        if (self.max / self.min).log10() < 2.2 {
            let mut exponent = first - 1.0;
            while exponent <= last {
                for value in [1.0, 2.0, 5.0].map(|factor| factor * 10_f64.powf(exponent)) {
                    if self.holds(value) {
                        ticks.push((value, self.label(value)));
                    }
                }
                exponent += 1.0;
            }
            return ticks;
        }
        // Multiples of the stride, so that panels side by side agree.
        let mut exponent = (first / stride).ceil() * stride;
        while exponent <= last {
            let value = 10_f64.powf(exponent);
            ticks.push((value, self.label(value)));
            exponent += stride;
        }
        ticks
    }

    fn label(&self, value: f64) -> String {
        let exponent = value.log10();
        match self.unit {
            Unit::Seconds => seconds(value),
            Unit::Number if (exponent - exponent.round()).abs() < 1e-9 => power(exponent.round()),
            Unit::Number => number(value),
        }
    }
}

/// Smallest and largest of the finite values, if there are any.
pub(crate) fn bounds(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    values
        .into_iter()
        .filter(|value| value.is_finite())
        .fold(None, |bounds, value| match bounds {
            None => Some((value, value)),
            Some((min, max)) => Some((f64::min(min, value), f64::max(max, value))),
        })
}

/// A power of ten: `10⁻⁶`, and 1 for `10⁰`.
pub(crate) fn power(exponent: f64) -> String {
    match exponent {
        e if e.abs() < 0.5 => "1".to_owned(),
        e if (e - 1.0).abs() < 0.5 => "10".to_owned(),
        e => {
            let digits: String = format!("{e:.0}").chars().map(superscript).collect();
            format!("10{digits}")
        }
    }
}

fn superscript(digit: char) -> char {
    match digit {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '4' => '⁴',
        '5' => '⁵',
        '6' => '⁶',
        '7' => '⁷',
        '8' => '⁸',
        '9' => '⁹',
        _ => '⁰',
    }
}

/// A number as people write it: as many digits as it has, at most 3 that count.
pub(crate) fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 {
            "0".to_owned()
        } else {
            format!("{value}")
        };
    }
    let size = value.abs().log10();
    if !(-3.0..6.0).contains(&size) {
        return mantissa_and_power(value);
    }
    let decimals = (2.0 - size.floor()).clamp(0.0, 9.0);
    let text = match decimals {
        d if d < 0.5 => format!("{value:.0}"),
        d if d < 1.5 => format!("{value:.1}"),
        d if d < 2.5 => format!("{value:.2}"),
        d if d < 3.5 => format!("{value:.3}"),
        d if d < 4.5 => format!("{value:.4}"),
        _ => format!("{value:.5}"),
    };
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// A size that may be anything: `2.3·10⁻⁹`, or plain where that is short.
pub(crate) fn scientific(value: f64) -> String {
    if value == 0.0 || (0.01..1e4).contains(&value.abs()) {
        return number(value);
    }
    mantissa_and_power(value)
}

/// A size of which one digit is known: `2·10⁻⁹`.
pub(crate) fn one_digit(value: f64) -> String {
    with_power(&format!("{value:.0e}"))
}

fn mantissa_and_power(value: f64) -> String {
    with_power(&format!("{value:.1e}"))
}

fn with_power(text: &str) -> String {
    match text.split_once('e') {
        Some((mantissa, exponent)) => {
            let digits: String = exponent.chars().map(superscript).collect();
            format!("{mantissa}·10{digits}")
        }
        None => text.to_owned(),
    }
}

/// A time with its SI prefix: `250 µs`.
pub(crate) fn seconds(value: f64) -> String {
    let (factor, unit) = match value.abs() {
        v if v == 0.0 || v >= 0.9995 => (1.0, "s"),
        v if v >= 0.9995e-3 => (1e3, "ms"),
        v if v >= 0.9995e-6 => (1e6, "µs"),
        _ => (1e9, "ns"),
    };
    // A number and its unit stay on one line.
    format!("{}\u{a0}{unit}", number(value * factor))
}

/// A text in which numbers like `1.2e-9` are written as people write them: `1.2·10⁻⁹`.
pub(crate) fn plain(text: &str) -> String {
    let in_number =
        |letter: char| letter.is_ascii_digit() || matches!(letter, '.' | 'e' | '-' | '+');
    let mut out = String::new();
    let mut rest = text;
    while let Some(start) = rest.find(|letter: char| letter.is_ascii_digit()) {
        let (before, number) = rest.split_at(start);
        let end = number
            .find(|letter| !in_number(letter))
            .unwrap_or(number.len());
        let (number, after) = number.split_at(end);
        // The end of a sentence or of a range is no part of a number.
        let trimmed = number.trim_end_matches(|letter: char| !letter.is_ascii_digit());
        let value = trimmed
            .split_once('e')
            .and_then(|_| trimmed.parse::<f64>().ok());
        out.push_str(before);
        match value {
            Some(value) => out.push_str(&scientific(value)),
            None => out.push_str(trimmed),
        }
        out.push_str(number.get(trimmed.len()..).unwrap_or_default());
        rest = after;
    }
    out + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_as_people_write_them() {
        let cases = [
            (0.0, "0"),
            (1234.0, "1234"),
            (0.031_26, "0.0313"),
            (2.5, "2.5"),
            (2.3e-9, "2.3·10⁻⁹"),
            (-3.0, "-3"),
            (100.0, "100"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
        assert_eq!(seconds(0.000_25), "250\u{a0}µs");
        assert_eq!(seconds(0.001), "1\u{a0}ms");
    }

    #[test]
    fn powers_of_ten_in_a_text_are_written_as_people_write_them() {
        let cases = [
            ("off by 3.5600e-3 s, 2e9.", "off by 3.6·10⁻³ s, 2.0·10⁹."),
            ("0.0000e0 rad", "0 rad"),
            (
                "euler 1.2e-9 (slope 1.0), step 2-3",
                "euler 1.2·10⁻⁹ (slope 1.0), step 2-3",
            ),
            ("1 degree", "1 degree"),
        ];
        for (text, expected) in cases {
            assert_eq!(plain(text), expected);
        }
    }

    #[test]
    fn ticks_stand_at_multiples_of_their_stride() {
        let labels = |axis: &Axis, most| -> Vec<String> {
            axis.ticks(most).into_iter().map(|tick| tick.1).collect()
        };
        let wide = Axis::log("", Unit::Number, [3e-16, 2.0]);
        assert_eq!(labels(&wide, 5.0), ["10⁻¹⁶", "10⁻¹²", "10⁻⁸", "10⁻⁴", "1"]);
        let times = Axis::log("", Unit::Seconds, [2e-6, 0.03]);
        assert_eq!(
            labels(&times, 9.0),
            [
                "1\u{a0}µs",
                "10\u{a0}µs",
                "100\u{a0}µs",
                "1\u{a0}ms",
                "10\u{a0}ms",
                "100\u{a0}ms"
            ]
        );
        let linear = Axis::linear("", 0.0, 30.0);
        assert_eq!(
            labels(&linear, 6.0),
            ["0", "5", "10", "15", "20", "25", "30"]
        );
    }
}
