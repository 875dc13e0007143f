//! Fields are read one by one, and rejected by name: refused by another layer, and bounded in length. Bad literals are the rows of `tests/actors/refusals/`.
//!
//! **Invariant:** statuses are compared in full, because a client receives only them.

use pendularm::protocol::catalog::Service;
use pendularm::protocol::op::Arguments;
use pendularm::protocol::op::fields::{Bound, Fields};
use serde_json::value::RawValue;

fn args(text: &str) -> Arguments {
    let raw = RawValue::from_string(text.to_owned()).expect("valid JSON");
    raw.into()
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
    let is_accepted = fields.accepted();
    let status = fields.finish().status();
    assert_eq!(is_accepted, status.is_empty());
    (value, status)
}

#[test]
fn another_layer_may_refuse_a_field_or_a_member_in_its_own_words() {
    let (_, status) = reading(Service::Rollout, r#"{"gains":{}}"#, |fields| {
        fields.refuse("samples", &"is not to be trusted");
        fields.object("gains", |gains| gains.refuse("kp", &"is not to my taste"));
    });
    assert_eq!(
        status,
        "samples is not to be trusted; gains.kp is not to my taste"
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
