//! `/arm_sim/integration_step` from outside: what it computes, what it refuses, and that it hinders nobody.

mod expressions;
mod refusals;
mod results;
mod turns;

use crate::common::Client;
use serde_json::{Value, json};

const SERVICE: &str = "/arm_sim/integration_step";

/// A good request with one field replaced.
fn with(field: &str, value: Value) -> Value {
    let mut request = json!({"function": "t", "x0": 0.0, "xdot0": 0.0, "dt": 0.1, "steps": 10, "integrator": "rk4"});
    request[field] = value;
    request
}

fn without(field: &str) -> Value {
    let mut request = with("x0", json!(0));
    request.as_object_mut().unwrap().remove(field);
    request
}

fn response(client: &mut Client) -> Value {
    client.receive_where("response", |frame| frame["op"] == "service_response")
}
