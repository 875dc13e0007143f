//! Stored reference values: the files of `tests/data`, and the members that most of their cases have.
//!
//! **Invariant:** a value of another kind fails the test that expects it, and is shown.

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::pid::Gains;
use serde_json::Value;

/// The entries of a list of the file.
pub(crate) fn entries(file: &str, name: &str) -> Vec<Value> {
    let mut file: Value = serde_json::from_str(file).unwrap();
    let Value::Array(entries) = file[name].take() else {
        panic!("no list {name}");
    };
    assert!(!entries.is_empty(), "{name} is empty");
    entries
}

pub(crate) fn number(value: &Value) -> f64 {
    let number = value.as_f64();
    number.unwrap_or_else(|| panic!("not a number: {value}"))
}

/// A number, a list of numbers or a matrix, as one list.
pub(crate) fn list(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(values) => values.iter().flat_map(list).collect(),
        value => vec![number(value)],
    }
}

pub(crate) fn array<const N: usize>(value: &Value) -> [f64; N] {
    let list = list(value).try_into();
    list.unwrap_or_else(|_| panic!("not {N} numbers: {value}"))
}

/// The arm of a case.
pub(crate) fn arm<const N: usize>(case: &Value) -> Arm<N> {
    let (lengths, masses) = (array(&case["lengths"]), array(&case["masses"]));
    Arm::new(lengths, masses, number(&case["gravity"])).unwrap()
}

/// The initial state of a case.
pub(crate) fn start<const N: usize>(case: &Value) -> State<N> {
    State {
        position: array(&case["q0"]),
        velocity: array(&case["qdot0"]),
    }
}

/// The method of a case.
pub(crate) fn method(case: &Value) -> Method {
    case["method"].as_str().unwrap().parse().unwrap()
}

pub(crate) const fn gains<const N: usize>(kp: [f64; N], ki: [f64; N], kd: [f64; N]) -> Gains<N> {
    Gains { kp, ki, kd }
}

/// A call of a function for the number of links of a case.
macro_rules! for_links {
    ($case:expr, $check:ident($($argument:expr),*)) => {
        match $case["n"].as_u64().unwrap() {
            2 => $check::<2>($($argument),*),
            3 => $check::<3>($($argument),*),
            n => panic!("{n} links"),
        }
    };
}
pub(crate) use for_links;
