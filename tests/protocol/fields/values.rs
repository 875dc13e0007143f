//! The value of a field: numbers, arrays, truth values, counts, choices and text, each within its bounds.

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

fn masses(text: &str) -> (Option<Vec<f64>>, String) {
    let request = format!(r#"{{"masses":{text}}}"#);
    reading(Service::SetParams, &request, |fields| {
        fields.numbers("masses", 2, Bound::Positive)
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
fn a_number_out_of_bounds_is_rejected_with_the_bound_and_the_number() {
    assert_eq!(
        number("-2", Bound::Positive),
        rejected("timestep must be greater than 0, got -2")
    );
    assert_eq!(
        number("0", Bound::Positive),
        rejected("timestep must be greater than 0, got 0")
    );
    assert_eq!(
        number("-0.5", Bound::NonNegative),
        rejected("timestep must be at least 0, got -0.5")
    );
}

#[test]
fn a_number_that_is_not_finite_is_rejected_by_name() {
    for text in ["9e999", "1e999", "-1e999", "1e400"] {
        assert_eq!(
            number(text, Bound::Finite),
            rejected("timestep must be a finite number"),
            "{text}"
        );
    }
}

#[test]
fn booleans_text_and_null_are_no_numbers() {
    for text in ["true", "false", "null", "\"1\""] {
        let message = format!("timestep must be a number, got {text}");
        assert_eq!(number(text, Bound::Finite), rejected(&message));
    }
    assert_eq!(
        number("[1]", Bound::Finite),
        rejected("timestep must be a number, got an array")
    );
    assert_eq!(
        number("{}", Bound::Finite),
        rejected("timestep must be a number, got an object")
    );
}

#[test]
fn an_array_has_the_right_length() {
    assert_eq!(masses("[1, 2.5]"), accepted(vec![1.0, 2.5]));
    assert_eq!(masses("[]"), rejected("masses must have 2 entries, got 0"));
    assert_eq!(
        masses("[1,2,3]"),
        rejected("masses must have 2 entries, got 3")
    );
    assert_eq!(
        masses("1"),
        rejected("masses must be an array of 2 numbers, got 1")
    );
    assert_eq!(
        masses("{}"),
        rejected("masses must be an array of 2 numbers, got an object")
    );
}

#[test]
fn a_bad_entry_of_an_array_is_named() {
    assert_eq!(
        masses("[1,-2]"),
        rejected("masses[1] must be greater than 0, got -2")
    );
    assert_eq!(
        masses("[null,1e999]"),
        rejected("masses[0] must be a number, got null; masses[1] must be a finite number")
    );
    assert_eq!(
        masses("[true,1]"),
        rejected("masses[0] must be a number, got true")
    );
}

#[test]
fn a_truth_value_is_true_or_false() {
    let data = |text: &str| {
        let request = format!(r#"{{"data":{text}}}"#);
        reading(Service::Pause, &request, |fields| fields.boolean("data"))
    };
    assert_eq!(data("true"), accepted(true));
    assert_eq!(data("false"), accepted(false));
    for text in ["1", "0", "null", "\"true\""] {
        assert_eq!(
            data(text),
            rejected(&format!("data must be true or false, got {text}"))
        );
    }
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

#[test]
fn a_choice_is_one_of_the_names() {
    let method = |text: &str| {
        let request = format!(r#"{{"method":{text}}}"#);
        reading(Service::SetIntegrator, &request, |fields| {
            fields.choice(
                "method",
                &[2, 4],
                |order| if order == 2 { "verlet" } else { "rk4" },
            )
        })
    };
    assert_eq!(method("\"rk4\""), accepted(4));
    assert_eq!(method("\"rk\\u0034\""), accepted(4));
    for text in ["\"RK4\"", "\"\"", "4", "null"] {
        assert_eq!(
            method(text),
            rejected(&format!("method must be one of verlet, rk4, got {text}"))
        );
    }
}

#[test]
fn text_is_a_string() {
    let function = |text: &str| {
        let request = format!(r#"{{"function":{text}}}"#);
        reading(Service::IntegrationStep, &request, |fields| {
            fields.text("function").map(std::borrow::Cow::into_owned)
        })
    };
    assert_eq!(function("\"sin(t)\""), accepted("sin(t)".to_owned()));
    assert_eq!(function("\"\""), accepted(String::new()));
    assert_eq!(function("3"), rejected("function must be a string, got 3"));
}

proptest! {
    /// The text that a double prints as is read as that double.
    #[test]
    fn every_finite_number_is_read_exactly(value in any::<f64>().prop_filter("finite", |value| value.is_finite())) {
        let (read, _) = number(&serde_json::to_string(&value).unwrap(), Bound::Finite);
        prop_assert_eq!(read.map(f64::to_bits), Some(value.to_bits()));
    }
}
