//! Axes: maps from values to positions, and ticks.
//!
//! **Invariant:** a tick's label says its value exactly.

use super::numbers::{number, power, scientific, seconds};

/// How a tick's value is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// Powers of ten, or plain numbers on a linear axis.
    Number,
    /// Seconds, with SI prefixes.
    Seconds,
}

/// One axis of a plot.
#[derive(Debug, Clone)]
pub struct Axis {
    pub(crate) label: &'static str,
    is_log: bool,
    unit: Unit,
    pub(crate) min: f64,
    pub(crate) max: f64,
}

impl Axis {
    /// A logarithmic axis over whole decades around the positive and finite `values`.
    pub fn around(label: &'static str, unit: Unit, values: impl IntoIterator<Item = f64>) -> Self {
        let values = values.into_iter();
        let logs = values.map(f64::log10).filter(|log| log.is_finite());
        let (min, max) = logs.fold((f64::INFINITY, f64::NEG_INFINITY), |(min, max), log| {
            (min.min(log.floor()), max.max(log.ceil()))
        });
        // Without values there is a decade.
        let (min, max) = if min > max {
            (0.0, 1.0)
        } else {
            (min, max.max(min + 1.0))
        };
        Self::log(label, unit, (10_f64.powf(min), 10_f64.powf(max)))
    }

    /// A logarithmic axis between these ends.
    pub fn log(label: &'static str, unit: Unit, (min, max): (f64, f64)) -> Self {
        Self {
            label,
            is_log: true,
            unit,
            min,
            max,
        }
    }

    /// A linear axis between these ends.
    pub fn linear(label: &'static str, (min, max): (f64, f64)) -> Self {
        Self {
            is_log: false,
            ..Self::log(label, Unit::Number, (min, max))
        }
    }

    /// Its label with the unit of its values.
    pub(super) fn name(&self) -> String {
        match self.unit {
            Unit::Number => self.label.to_owned(),
            Unit::Seconds => format!("{} [s]", self.label),
        }
    }

    /// The place of `value`: 0 at the start of the axis, 1 at its end.
    pub(crate) fn place(&self, value: f64) -> f64 {
        if self.is_log {
            (value / self.min).log10() / (self.max / self.min).log10()
        } else {
            (value - self.min) / (self.max - self.min)
        }
    }

    /// Whether `value` lies between the ends, within rounding.
    pub(crate) fn holds(&self, value: f64) -> bool {
        (-1e-9..=1.0 + 1e-9).contains(&self.place(value))
    }

    /// About `most` ticks at most: value and label.
    pub fn ticks(&self, most: f64) -> Vec<(f64, String)> {
        let (first, last) = if self.is_log {
            (self.min.log10(), self.max.log10())
        } else {
            (self.min, self.max)
        };
        let raw = (last - first) / most;
        // Decades alone would leave a short axis almost without ticks.
        let factors: &[f64] = if self.is_log && last - first < 2.2 {
            &[1.0, 2.0, 5.0]
        } else {
            &[1.0]
        };
        let stride = if self.is_log {
            raw.ceil().max(1.0)
        } else {
            let magnitude = 10_f64.powf(raw.log10().floor());
            let steps = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * magnitude);
            steps.into_iter().find(|step| *step >= raw).unwrap_or(raw)
        };
        // Multiples of the stride, so that panels side by side agree.
        let mut index = (first / stride).floor();
        let mut ticks = Vec::new();
        while index * stride <= last + 1e-9 * (last - first) {
            let at = index * stride;
            let base = if self.is_log { 10_f64.powf(at) } else { at };
            let values = factors.iter().map(|factor| factor * base);
            ticks.extend(
                values
                    .filter(|value| self.holds(*value))
                    .map(|it| (it, self.said(it))),
            );
            index += 1.0;
        }
        ticks
    }

    /// Its label with one of its values, for a tooltip.
    pub(super) fn told(&self, value: f64) -> String {
        let value = match self.unit {
            Unit::Seconds => seconds(value),
            Unit::Number => scientific(value),
        };
        format!("{} {value}", self.label)
    }

    fn said(&self, value: f64) -> String {
        let exponent = value.log10();
        match self.unit {
            Unit::Seconds => seconds(value),
            Unit::Number if self.is_log && (exponent - exponent.round()).abs() < 1e-9 => {
                power(exponent)
            }
            Unit::Number => number(value),
        }
    }
}
