//! The rejected fields of a request, with reasons.
//!
//! **Invariant:** they are reported in one line of bounded length.

use std::borrow::Cow;
use std::fmt;

use crate::protocol::wire::text;

/// Longest `status` in characters: room for every field of the largest service.
const MAX_STATUS: usize = 2048;
/// Longest reason from another layer, in characters.
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
    pub(in crate::protocol::op) fn holds(self, value: f64) -> bool {
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
    /// The fault.
    pub reason: Reason,
}

/// Why a field was rejected.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Reason {
    /// A required field is missing.
    #[error("is required")]
    Missing,
    /// Another type or value was expected.
    #[error("must be {expected}, got {found}")]
    Mistyped {
        /// The expected kind of value.
        expected: Cow<'static, str>,
        /// The received value, shortened.
        found: String,
    },
    /// `NaN`, infinite, or a literal that overflows.
    #[error("must be a finite number")]
    NotFinite,
    /// Out of bounds.
    #[error("must be {bound}, got {found}")]
    OutOfBounds {
        /// The bound.
        bound: Bound,
        /// The client's number, shortened.
        found: String,
    },
    /// Above a limit.
    #[error("must be at most {limit}, got {found}")]
    TooLarge {
        /// The limit.
        limit: u64,
        /// The client's number, shortened.
        found: String,
    },
    /// An array of the wrong length.
    #[error("must have {expected} entries, got {got}")]
    Length {
        /// The expected number of entries.
        expected: usize,
        /// The received number of entries.
        got: usize,
    },
    /// An array with too many entries. A positional array has at most one for each field of the service.
    #[error("must have at most {limit} entries, got {got}")]
    TooMany {
        /// Most entries.
        limit: usize,
        /// Entries of the array.
        got: usize,
    },
    /// Another layer refuses the value, for this reason.
    #[error("{0}")]
    Refused(String),
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

    /// Rejects a field for a reason from another layer. The reason continues the sentence after the field's name.
    pub fn refuse(&mut self, field: &str, reason: &impl fmt::Display) {
        self.push(RejectedField::refused(field, reason));
    }

    pub(super) fn push(&mut self, rejection: RejectedField) {
        self.0.push(rejection);
    }

    /// Replaces a field's name by the sender's name for it.
    pub fn rename(&mut self, field: &str, name: &str) {
        for rejection in self.0.iter_mut().filter(|one| one.field == field) {
            name.clone_into(&mut rejection.field);
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
    /// A field that another layer rejects. `reason` continues the sentence after the field's name.
    #[must_use]
    pub fn refused(field: &str, reason: &impl fmt::Display) -> Self {
        Self {
            field: field.to_owned(),
            reason: Reason::Refused(text::shortened(&reason.to_string(), MAX_REASON)),
        }
    }
}
