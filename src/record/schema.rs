//! The record's own channels and their types. They are not topics, and have no subscribers.
//!
//! **Invariant:** a number keeps its 64 bits: in CDR, or as the shortest text that is read back as the same number.

use crate::protocol::catalog::Field;
use crate::protocol::catalog::types::Type;

/// The channel of inputs to the arm.
pub const INPUTS: &str = "/recorder/inputs";
/// The channel of the arm's states.
pub const STATES: &str = "/recorder/states";
/// The channel of calls and their answers.
pub const CALLS: &str = "/recorder/calls";

const fn field(name: &'static str, kind: &'static str, unit: &'static str) -> Field {
    Field {
        name,
        kind,
        unit,
        required: true,
    }
}

/// An input with the number of steps before it.
pub(super) const INPUT: Type = Type {
    name: "pendularm_interfaces/msg/RecordedInput",
    fields: &[field("step", "uint64", ""), field("input", "string", "")],
    constants: &[],
};

/// The arm's state after a number of steps.
pub(super) const STATE: Type = Type {
    name: "pendularm_interfaces/msg/RecordedState",
    fields: &[
        field("step", "uint64", ""),
        field("position", "float64[]", "rad"),
        field("velocity", "float64[]", "rad/s"),
        field("effort", "float64[]", "N m"),
    ],
    constants: &[],
};

/// A call, or an answer. In an answer `content` is `values`.
pub(super) const CALL: Type = Type {
    name: "pendularm_interfaces/msg/RecordedCall",
    fields: &[
        field("client", "uint64", ""),
        field("id", "string", ""),
        field("service", "string", ""),
        field("type", "string", ""),
        field("is_answer", "bool", ""),
        field("content", "string", ""),
        field("result", "bool", ""),
        field("status", "string", ""),
    ],
    constants: &[],
};
