//! Numbers from JSON.
//!
//! **Invariant:** any other value fails the test that expects a number, and is shown.

use serde_json::Value;

/// The number.
pub(crate) fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("not a number: {value}"))
}

/// The numbers of an array.
pub(crate) fn numbers(value: &Value) -> Vec<f64> {
    let entries = value.as_array();
    let entries = entries.unwrap_or_else(|| panic!("not an array: {value}"));
    entries.iter().map(number).collect()
}
