//! Reading answers and comparing numbers. An error is a sentence: it names the member that is missing or of another type, or the
//! first entry that differs.

use serde_json::Value;

use crate::peer::beginning;

/// The member at a path such as `points/0/positions`.
pub fn member<'a>(value: &'a Value, path: &str) -> Result<&'a Value, String> {
    value.pointer(&format!("/{path}")).ok_or_else(|| format!("no {path} in {}", beginning(&value.to_string())))
}

/// Sets a member of an object.
pub fn set(object: &mut Value, name: &str, value: Value) {
    if let Some(members) = object.as_object_mut() {
        members.insert(name.to_owned(), value);
    }
}

/// The value at a path as `read` has it.
fn as_kind<'a, T>(value: &'a Value, path: &str, kind: &str, read: impl FnOnce(&'a Value) -> Option<T>) -> Result<T, String> {
    let found = member(value, path)?;
    read(found).ok_or_else(|| format!("{path} is no {kind}: {}", beginning(&found.to_string())))
}

fn finite(value: &Value) -> Option<f64> {
    value.as_f64().filter(|number| number.is_finite())
}

/// The finite number at a path.
pub fn number(value: &Value, path: &str) -> Result<f64, String> {
    as_kind(value, path, "number", finite)
}

/// The boolean at a path.
pub fn boolean(value: &Value, path: &str) -> Result<bool, String> {
    as_kind(value, path, "boolean", Value::as_bool)
}

/// The text at a path.
pub fn text<'a>(value: &'a Value, path: &str) -> Result<&'a str, String> {
    as_kind(value, path, "text", Value::as_str)
}

/// The array of finite numbers at a path.
pub fn numbers(value: &Value, path: &str) -> Result<Vec<f64>, String> {
    let entries = as_kind(value, path, "array", Value::as_array)?;
    (0..entries.len()).map(|at| number(value, &format!("{path}/{at}"))).collect()
}

/// The array of `count` finite numbers at a path.
pub fn numbers_of(value: &Value, path: &str, count: usize) -> Result<Vec<f64>, String> {
    let found = numbers(value, path)?;
    if found.len() == count { Ok(found) } else { Err(format!("{path} has {} entries instead of {count}", found.len())) }
}

/// Passes if both have one length and no entry differs by more than `tolerance`, relative to 1 plus its size.
pub fn near(name: &str, got: &[f64], expected: &[f64], tolerance: f64) -> Result<(), String> {
    if got.len() != expected.len() {
        return Err(format!("{name} has {} entries instead of {}", got.len(), expected.len()));
    }
    for (at, (one, other)) in got.iter().zip(expected).enumerate() {
        // `NaN` is not near to anything.
        let is_near = (one - other).abs() <= tolerance * (1.0 + other.abs());
        if !is_near {
            return Err(format!("{name}[{at}] is {one:?} instead of {other:?}"));
        }
    }
    Ok(())
}

/// Passes if the condition holds.
pub fn must(holds: bool, otherwise: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(otherwise()) }
}

/// The largest absolute value; infinite if one is not a number.
#[must_use]
pub fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |largest: f64, value| if value.is_nan() { f64::INFINITY } else { largest.max(value.abs()) })
}

/// Entry by entry.
#[must_use]
pub fn minus(left: &[f64], right: &[f64]) -> Vec<f64> {
    left.iter().zip(right).map(|(left, right)| left - right).collect()
}

/// A number for a reader. A small one, and one of an arm that diverged, has an exponent.
#[must_use]
pub fn plain(value: f64) -> String {
    if value == 0.0 || (0.01..1e6).contains(&value.abs()) { format!("{value:.4}") } else { format!("{value:.3e}") }
}

/// Numbers for a reader.
#[must_use]
pub fn list(values: &[f64]) -> String {
    let shown: Vec<String> = values.iter().copied().map(plain).collect();
    format!("[{}]", shown.join(", "))
}
