//! The record's own channels and their types. They are not topics, and have no subscribers.
//!
//! **Invariant:** a number keeps its 64 bits: in CDR, or as the shortest text that is read back as the same number.

use crate::protocol::catalog::types::Type;
use crate::protocol::catalog::{fields, message};

/// The channel of inputs to the arm.
pub const INPUTS: &str = "/recorder/inputs";
/// The channel of the arm's states.
pub const STATES: &str = "/recorder/states";
/// The channel of calls and their answers.
pub const CALLS: &str = "/recorder/calls";

/// An input with the number of steps before it.
pub(super) const INPUT: Type = message(
    "pendularm_interfaces/msg/RecordedInput",
    fields!["uint64 step", "string input"],
);

/// The arm's state after a number of steps.
pub(super) const STATE: Type = message(
    "pendularm_interfaces/msg/RecordedState",
    fields![
        "uint64 step",
        "float64[] position  # rad",
        "float64[] velocity  # rad/s",
        "float64[] effort  # N m",
    ],
);

/// A call, or an answer. In an answer `content` is `values`.
pub(super) const CALL: Type = message(
    "pendularm_interfaces/msg/RecordedCall",
    fields![
        "uint64 client",
        "string id",
        "string service",
        "string type",
        "bool is_answer",
        "string content",
        "bool result",
        "string status",
    ],
);
