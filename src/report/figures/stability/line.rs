//! The limits of one arm with one set of gains, predicted and measured, and the words for them.
//!
//! **Invariant:** a limit that was not measured is said to be none, not guessed.

use crate::math::integrator::Method;
use crate::study::stability::Sampling;

/// Measured and predicted limits may differ by this part.
pub(super) const AGREEMENT: f64 = 0.01;

/// One line of the table of limits.
pub(super) struct LimitRow {
    pub(super) links: usize,
    pub(super) gains: &'static str,
    pub(super) method: Method,
    pub(super) sampling: Sampling,
    pub(super) predicted: f64,
    pub(super) measured: Option<f64>,
    pub(super) over_poses: Option<f64>,
    pub(super) advised: Option<f64>,
}

impl LimitRow {
    pub(super) fn ratio(&self) -> Option<f64> {
        Some(self.measured? / self.predicted)
    }
}

/// A sampling in words.
pub(super) fn in_words(sampling: Sampling) -> &'static str {
    match sampling {
        Sampling::Held => "effort held for the step (as the live arm does)",
        Sampling::Continuous => "law in every stage",
    }
}

/// The line of the 2-link arm with its default gains.
pub(super) fn with_default_gains(
    lines: &[LimitRow],
    sampling: Sampling,
    method: Method,
) -> Option<&LimitRow> {
    lines.iter().find(|line| {
        line.links == 2
            && line.gains == "default"
            && line.sampling == sampling
            && line.method == method
    })
}
