//! The rejected fields of a request, with reasons.
//!
//! **Invariant:** they are reported in one line of bounded length.

use std::fmt;

use serde_json::value::RawValue;

use crate::protocol::wire::{json, text};

/// Longest `status` in characters: room for every field of the largest service.
const MAX_STATUS: usize = 2048;
/// Longest reason, in characters.
const MAX_REASON: usize = 256;

/// The required range of a finite number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bound {
    /// Any finite number.
    Finite,
    /// Greater than 0.
    Positive,
    /// 0 or greater.
    NonNegative,
}

impl Bound {
    fn holds(self, value: f64) -> bool {
        match self {
            Self::Finite => true,
            Self::Positive => value > 0.0,
            Self::NonNegative => value >= 0.0,
        }
    }
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Finite => "finite",
            Self::Positive => "greater than 0",
            Self::NonNegative => "at least 0",
        })
    }
}

/// A rejected field with its reason. It reads as a sentence: `masses[1] must be greater than 0, got -2`.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field} {reason}")]
pub struct RejectedField {
    /// The field, with the index of the wrong entry if there is one.
    pub field: String,
    /// The fault, which continues the sentence.
    pub reason: String,
}

/// The rejected fields of a request, in the order of reading.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Rejections(Vec<RejectedField>);

impl From<RejectedField> for Rejections {
    fn from(rejection: RejectedField) -> Self {
        Self(vec![rejection])
    }
}

impl Rejections {
    /// Whether no field was rejected.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The rejections, one by one.
    #[must_use]
    pub fn as_slice(&self) -> &[RejectedField] {
        &self.0
    }

    /// All of them in one line; empty if there are none: the `status` of the response.
    #[must_use]
    pub fn status(&self) -> String {
        let sentences: Vec<String> = self.0.iter().map(RejectedField::to_string).collect();
        text::shortened(&sentences.join("; "), MAX_STATUS)
    }

    /// Rejects a field. The reason continues the sentence after the field's name.
    pub fn refuse(&mut self, field: &str, reason: &impl fmt::Display) {
        self.0.push(RejectedField::refused(field, reason));
    }

    /// Replaces a field's name by the sender's name for it, also before the index of an entry.
    pub fn rename(&mut self, field: &str, name: &str) {
        for rejection in &mut self.0 {
            let rest = rejection.field.strip_prefix(field);
            if let Some(index) = rest.filter(|rest| rest.is_empty() || rest.starts_with('[')) {
                rejection.field = format!("{name}{index}");
            }
        }
    }

    /// Appends the rejections of `later`.
    pub fn append(&mut self, mut later: Self) {
        self.0.append(&mut later.0);
    }
}

impl fmt::Display for Rejections {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.status())
    }
}

impl RejectedField {
    /// A rejected field. `reason` continues the sentence after the field's name.
    #[must_use]
    pub fn refused(field: &str, reason: &impl fmt::Display) -> Self {
        Self {
            field: field.to_owned(),
            reason: text::shortened(&reason.to_string(), MAX_REASON),
        }
    }
}

/// The reason why a required field is rejected that is not there.
pub(crate) const MISSING: &str = "is required";

/// The reason why a value of another kind is rejected.
pub(crate) fn mistyped(expected: &str, raw: &RawValue) -> String {
    format!("must be {expected}, got {}", text::found(raw))
}

/// The reason why an array of `got` entries is rejected.
pub(crate) fn too_many(limit: usize, got: usize) -> String {
    let entries = if limit == 1 { "entry" } else { "entries" };
    format!("must have at most {limit} {entries}, got {got}")
}

/// The reason why an array is rejected that does not have `expected` entries.
pub(crate) fn wrong_length(expected: usize, got: usize) -> String {
    format!("must have {expected} entries, got {got}")
}

/// The finite number of a value, within `bound`, or the reason why it is rejected.
pub(crate) fn finite(raw: &RawValue, bound: Bound) -> Result<f64, String> {
    let value = json::number(raw).ok_or_else(|| mistyped("a number", raw))?;
    if !value.is_finite() {
        return Err(mistyped("a finite number", raw));
    }
    if !bound.holds(value) {
        return Err(mistyped(&bound.to_string(), raw));
    }
    Ok(value)
}
