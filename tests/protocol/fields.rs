//! The status of rejected fields is bounded in length. Bad literals are the rows of `tests/actors/refusals/`.

use pendularm::protocol::catalog::Service;
use pendularm::protocol::op::Arguments;
use pendularm::protocol::op::fields::{Bound, Fields};
use serde_json::value::RawValue;

#[test]
fn a_status_is_bounded_however_long_the_request_was() {
    let long = "x".repeat(1_000_000);
    let text = format!(r#"{{"method":"{long}","timestep":"{long}"}}"#);
    let raw = RawValue::from_string(text).expect("valid JSON");
    let args = Arguments::Object(raw.into());
    let mut fields = Fields::read(&args, Service::SetIntegrator).expect("arguments that fit");
    let _ = fields.choice("method", &[1], |_| "rk4");
    let _ = fields.number("timestep", Bound::Positive);
    for _ in 0..1000 {
        fields.refuse("method", &long);
    }
    let length = fields.status().chars().count();
    assert!(length < 2100, "{length} characters");
}
