//! Numbers and counts that are taken; the table of refusals is in `tests/actors/refusals/`.

use pendularm::protocol::catalog::Service;
use pendularm::protocol::op::fields::Bound;
use proptest::prelude::*;

use super::reading;

/// Reads a number as `timestep`, an optional field of a service that takes fields one by one.
fn number(text: &str, bound: Bound) -> (Option<f64>, String) {
    let request = format!(r#"{{"timestep":{text}}}"#);
    reading(Service::SetIntegrator, &request, |fields| {
        fields.number("timestep", bound)
    })
}

fn steps(text: &str) -> (Option<u64>, String) {
    let request = format!(r#"{{"steps":{text}}}"#);
    reading(Service::IntegrationStep, &request, |fields| {
        fields.count("steps", 1000)
    })
}

fn rejected<T>(message: &str) -> (Option<T>, String) {
    (None, message.to_owned())
}

fn accepted<T>(value: T) -> (Option<T>, String) {
    (Some(value), String::new())
}

#[test]
fn a_number_within_its_bound_is_taken() {
    assert_eq!(number("0.5", Bound::Positive), accepted(0.5));
    assert_eq!(number("2", Bound::Positive), accepted(2.0));
    assert_eq!(number("0", Bound::NonNegative), accepted(0.0));
    assert_eq!(number("-1e-3", Bound::Finite), accepted(-0.001));
}

#[test]
fn a_count_is_a_whole_number_within_its_limit() {
    assert_eq!(steps("1"), accepted(1));
    assert_eq!(steps("10.0"), accepted(10));
    assert_eq!(steps("1e3"), accepted(1000));
    for text in ["0", "-1", "1.5", "true", "\"1\"", "null"] {
        assert_eq!(
            steps(text),
            rejected(&format!("steps must be an integer, at least 1, got {text}"))
        );
    }
    for text in ["1001", "1e300", "99999999999999999999999"] {
        assert_eq!(
            steps(text),
            rejected(&format!("steps must be at most 1000, got {text}"))
        );
    }
    assert_eq!(steps("1e999"), rejected("steps must be a finite number"));
}

proptest! {
    /// The text that a double prints as is read as that double.
    #[test]
    fn every_finite_number_is_read_exactly(value in any::<f64>().prop_filter("finite", |value| value.is_finite())) {
        let (read, _) = number(&serde_json::to_string(&value).unwrap(), Bound::Finite);
        prop_assert_eq!(read.map(f64::to_bits), Some(value.to_bits()));
    }
}
