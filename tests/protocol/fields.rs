//! Fields are read one by one, and rejected by name.
//!
//! **Invariant:** a message is compared whole: it is what the sender of a request has to go by.

use pendularm::protocol::catalog::Service;
use pendularm::protocol::op::Arguments;
use pendularm::protocol::op::fields::{Bound, Fields, Reason, RejectedField};
use proptest::prelude::*;
use serde_json::value::RawValue;

fn args(text: &str) -> Arguments {
    let raw = RawValue::from_string(text.to_owned()).expect("valid JSON");
    if text.starts_with('[') {
        Arguments::Positional(raw.into())
    } else {
        Arguments::Object(raw.into())
    }
}

/// The values that `read` takes from a request, and the status.
fn reading<T>(
    service: Service,
    text: &str,
    read: impl FnOnce(&mut Fields<'_>) -> T,
) -> (T, String) {
    let args = args(text);
    let mut fields = Fields::read(&args, service).expect("arguments that fit");
    let value = read(&mut fields);
    assert_eq!(fields.accepted(), fields.status().is_empty());
    (value, fields.status())
}

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
fn an_absent_optional_field_is_no_rejection() {
    let (value, status) = reading(Service::SetIntegrator, "{}", |fields| {
        (
            fields.number("timestep", Bound::Positive),
            fields.boolean("method"),
        )
    });
    assert_eq!((value, status.as_str()), ((None, None), ""));
}

#[test]
fn an_absent_required_field_is_rejected() {
    let (value, status) = reading(Service::Solve, r#"{"x":1}"#, |fields| {
        let finite = Bound::Finite;
        (
            fields.number("x", finite),
            fields.number("y", finite),
            fields.number("phi", finite),
        )
    });
    assert_eq!(value, (Some(1.0), None, None));
    assert_eq!(status, "y is required");
}

#[test]
fn null_means_absent_only_in_optional_fields_of_services_that_take_all_or_nothing() {
    let (value, status) = reading(Service::Solve, r#"{"x":null,"y":1,"phi":null}"#, |fields| {
        (
            fields.number("phi", Bound::Finite),
            fields.number("x", Bound::Finite),
        )
    });
    assert_eq!(value, (None, None));
    assert_eq!(status, "x must be a number, got null");
    let (value, status) = reading(Service::CancelGoal, r#"{"goal_id":null}"#, |fields| {
        fields.text("goal_id").map(std::borrow::Cow::into_owned)
    });
    assert_eq!((value, status.as_str()), (None, ""));
    let (_, status) = reading(Service::SetParams, r#"{"gravity":null}"#, |fields| {
        fields.number("gravity", Bound::NonNegative)
    });
    assert_eq!(status, "gravity must be a number, got null");
}

#[test]
fn members_of_an_object_are_read_like_fields_and_named_after_it() {
    let read = |args: &str| {
        reading(Service::Stability, args, |fields| {
            fields.object("params", |params| {
                let gravity = params.number("gravity", Bound::NonNegative);
                (gravity, params.numbers("masses", 2, Bound::Positive))
            })
        })
    };
    let (value, status) = read(r#"{"params":{"gravity":2,"masses":[1,2],"colour":"red"}}"#);
    assert_eq!(value, Some((Some(2.0), Some(vec![1.0, 2.0]))));
    assert_eq!(status, "");
    let (value, status) = read(r#"{"params":{"gravity":-2,"masses":[1,1e999]}}"#);
    assert_eq!(value, Some((None, None)));
    assert_eq!(
        status,
        "params.gravity must be at least 0, got -2; params.masses[1] must be a finite number"
    );
    assert_eq!(read(r#"{"params":{"gravity":null}}"#).0, Some((None, None)));
    for absent in ["{}", r#"{"params":null}"#] {
        assert_eq!(read(absent), (None, String::new()));
    }
    let (value, status) = read(r#"{"params":[1]}"#);
    assert_eq!(
        (value, status.as_str()),
        (None, "params must be an object, got an array")
    );
}

#[test]
fn a_reason_given_from_outside_for_a_member_names_it_with_its_object() {
    let (_, status) = reading(Service::Rollout, r#"{"gains":{}}"#, |fields| {
        fields.object("gains", |gains| gains.refuse("kp", &"is not to my taste"))
    });
    assert_eq!(status, "gains.kp is not to my taste");
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

#[test]
fn the_good_fields_of_a_request_count_though_others_are_bad() {
    let request = r#"{"gravity":-1,"masses":[1,2],"lengths":[1],"extra":null}"#;
    let (value, status) = reading(Service::SetParams, request, |fields| {
        (
            fields.number("gravity", Bound::NonNegative),
            fields.numbers("masses", 2, Bound::Positive),
            fields.numbers("lengths", 2, Bound::Positive),
        )
    });
    assert_eq!(value, (None, Some(vec![1.0, 2.0]), None));
    assert_eq!(
        status,
        "gravity must be at least 0, got -1; lengths must have 2 entries, got 1"
    );
}

#[test]
fn a_positional_array_is_read_in_documented_order() {
    let (value, status) = reading(Service::SendGoal, "[1,2,null,0.5]", |fields| {
        let mut read = |name| fields.number(name, Bound::Finite);
        [
            read("x"),
            read("y"),
            read("phi"),
            read("epsilon"),
            read("success_hold"),
        ]
    });
    assert_eq!(value, [Some(1.0), Some(2.0), None, Some(0.5), None]);
    assert_eq!(status, "");
}

#[test]
fn a_positional_array_may_have_as_many_entries_as_the_service_has_fields() {
    let read = reading(Service::Disturb, "[[1,2],0.5]", |fields| {
        (
            fields.numbers("effort", 2, Bound::Finite),
            fields.number("duration", Bound::Positive),
        )
    });
    assert_eq!(read, ((Some(vec![1.0, 2.0]), Some(0.5)), String::new()));
}

#[test]
fn a_positional_array_with_too_many_entries_is_rejected_naming_args() {
    let args = args("[1,2,3]");
    let rejection = Fields::read(&args, Service::SetIntegrator).unwrap_err();
    assert_eq!(
        rejection.to_string(),
        "args must have at most 2 entries, got 3"
    );
    let args = Arguments::Positional(RawValue::from_string("[1]".to_owned()).unwrap().into());
    assert!(Fields::read(&args, Service::Reset).is_err());
}

#[test]
fn of_a_repeated_field_the_last_counts() {
    let (value, status) = reading(
        Service::SetIntegrator,
        r#"{"timestep":"x","timestep":2}"#,
        |fields| fields.number("timestep", Bound::Positive),
    );
    assert_eq!((value, status.as_str()), (Some(2.0), ""));
}

#[test]
fn another_layer_may_refuse_a_field_in_its_own_words() {
    let args = args("{}");
    let mut fields = Fields::read(&args, Service::SetIntegrator).unwrap();
    fields.refuse("method", &"is not to be trusted");
    assert!(!fields.accepted());
    assert_eq!(fields.status(), "method is not to be trusted");
    assert_eq!(
        fields.rejections(),
        [RejectedField {
            field: "method".to_owned(),
            reason: Reason::Refused("is not to be trusted".to_owned()),
        }]
    );
}

#[test]
fn a_status_is_bounded_however_long_the_request_was() {
    let long = "x".repeat(1_000_000);
    let (_, status) = reading(
        Service::SetIntegrator,
        &format!(r#"{{"method":"{long}","timestep":"{long}"}}"#),
        |fields| {
            let _ = fields.choice("method", &[1], |_| "rk4");
            let _ = fields.number("timestep", Bound::Positive);
            for _ in 0..1000 {
                fields.refuse("method", &long);
            }
        },
    );
    assert!(
        status.chars().count() < 2100,
        "{} characters",
        status.chars().count()
    );
}

proptest! {
    /// The text that a double prints as is read as that double.
    #[test]
    fn every_finite_number_is_read_exactly(value in any::<f64>().prop_filter("finite", |value| value.is_finite())) {
        let (read, _) = number(&serde_json::to_string(&value).unwrap(), Bound::Finite);
        prop_assert_eq!(read.map(f64::to_bits), Some(value.to_bits()));
    }
}
