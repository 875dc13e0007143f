//! Refusals of fields by another layer, in its own words. Bad literals are the rows of `tests/actors/refusals/`.

use pendularm::protocol::catalog::Service;
use pendularm::protocol::op::Arguments;
use pendularm::protocol::op::fields::{Bound, Fields};
use serde_json::value::RawValue;

fn args(text: &str) -> Arguments {
    let raw = RawValue::from_string(text.to_owned()).expect("valid JSON");
    raw.into()
}

#[test]
fn a_member_is_refused_under_its_whole_name() {
    let args = args(r#"{"gains":{}}"#);
    let mut fields = Fields::read(&args, Service::Rollout).expect("arguments that fit");
    fields.object("gains", |gains| gains.refuse("kp", &"is not to my taste"));
    assert_eq!(fields.finish().status(), "gains.kp is not to my taste");
}

#[test]
fn a_status_is_bounded_however_long_the_request_was() {
    let long = "x".repeat(1_000_000);
    let args = args(&format!(r#"{{"method":"{long}","timestep":"{long}"}}"#));
    let mut fields = Fields::read(&args, Service::SetIntegrator).expect("arguments that fit");
    let _ = fields.choice("method", &[1], |_| "rk4");
    let _ = fields.number("timestep", Bound::Positive);
    for _ in 0..1000 {
        fields.refuse("method", &long);
    }
    let length = fields.finish().status().chars().count();
    assert!(length < 2100, "{length} characters");
}
