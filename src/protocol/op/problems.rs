//! The faults of operations, as their senders read them.
//!
//! **Invariant:** every sentence begins with the operation and its field, if both are known.

use crate::protocol::wire::text;

/// Longest part of the JSON parser's message in an answer, in characters. It may quote the client.
const MAX_PARSER_MESSAGE: usize = 160;

/// Why a frame is not a valid operation, and the form of the answer.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum OpError {
    /// A fault that gets an error `status`.
    #[error(transparent)]
    Status(#[from] Problem),
    /// A faulty call of a known service. It gets a `service_response` with `result: false`.
    #[error("{problem}")]
    Call {
        /// The service that was called.
        service: String,
        /// The fault.
        problem: Problem,
    },
    /// A faulty goal of a named action. It gets an `action_result` with `result: false`.
    #[error("{problem}")]
    Goal {
        /// The action of the goal.
        action: String,
        /// The fault.
        problem: Problem,
    },
}

/// A fault of an operation.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Problem {
    /// Not a frame; holds the reason.
    #[error("{0}")]
    NotAFrame(String),
    /// Not a JSON object; holds the parser's message, shortened.
    #[error("malformed frame: {0}")]
    NotJson(String),
    /// There is no `op`.
    #[error("malformed frame: op is required")]
    NoOp,
    /// `op` is not a string; holds its value.
    #[error("malformed frame: op must be a string, got {0}")]
    OpNotText(String),
    /// An unknown operation; holds its name, shortened.
    #[error("unknown op \"{0}\"")]
    UnknownOp(String),
    /// A required field is absent.
    #[error("{op}: {field} is required")]
    Missing {
        /// The operation.
        op: &'static str,
        /// The field.
        field: &'static str,
    },
    /// A field is rejected.
    #[error("{op}: {field} must be {expected}, got {found}")]
    Mistyped {
        /// The operation.
        op: &'static str,
        /// The field.
        field: &'static str,
        /// The expected kind of value.
        expected: &'static str,
        /// The received value, shortened.
        found: String,
    },
    /// A name is longer than it may be: [`MAX_NAME`](super::MAX_NAME).
    #[error("{op}: {field} must be at most {limit} bytes long, got {length}")]
    TooLong {
        /// The operation.
        op: &'static str,
        /// The field.
        field: &'static str,
        /// Its limit in bytes.
        limit: usize,
        /// Its length in bytes.
        length: usize,
    },
}

impl Problem {
    /// A frame that the JSON parser rejects for this reason.
    pub(super) fn not_json(error: &serde_json::Error) -> Self {
        Self::NotJson(text::shortened(&error.to_string(), MAX_PARSER_MESSAGE))
    }
}
