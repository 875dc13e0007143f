//! Calls with a number in them that has to come back: the services of the runtime, asked so that nothing changes.
//!
//! **Invariant:** no question here moves the arm or changes a setting, so any client may ask it at any time.

use serde_json::{Value, json};

use crate::ledger::{Check, refusal, succeeded};
use crate::wire::Client;

/// Appends one call, picked at random, whose answer shows that it was this call that was answered.
pub fn push_question(client: &mut Client, rng: &mut fastrand::Rng) {
    // Refusals of targets spell numbers from a hundred thousand on with an exponent.
    let n = 1000 + client.world.number() % 99_000;
    let (service, args, check): (String, Value, Check) = match rng.u8(..10) {
        0 => (
            "/arm_sim/set_params".into(),
            json!({"gravity": -(n as f64)}),
            refused("gravity", n),
        ),
        1 => (
            "/arm_sim/set_integrator".into(),
            json!({"timestep": -(n as f64)}),
            refused("timestep", n),
        ),
        2 => (
            "/pid_controller/set_gains".into(),
            json!({"kp": [-(n as f64), 1]}),
            refused("kp[0]", n),
        ),
        3 => (
            "/ik/solve".into(),
            json!({"x": n, "y": 0}),
            refusal(format!("target ({n}, 0)")),
        ),
        4 => (
            "/ik_action/send_goal".into(),
            json!({"x": 0, "y": n}),
            refusal(format!("(0, {n})")),
        ),
        5 => (
            format!("/soak/nobody/{n}"),
            json!({}),
            refusal(format!("/soak/nobody/{n}")),
        ),
        6 => (
            "/rosapi/get_param".into(),
            json!({"name": "none", "default_value": n.to_string()}),
            value("value", json!(n.to_string())),
        ),
        7 => (
            "/rosapi/service_type".into(),
            json!(["/arm_sim/reset"]),
            value("type", json!("pendularm_interfaces/srv/Reset")),
        ),
        8 => (
            "/rosapi/topics".into(),
            json!({}),
            Box::new(lists_its_topics),
        ),
        _ => (
            "/arm_sim/set_integrator".into(),
            json!({}),
            Box::new(succeeded),
        ),
    };
    client.push_call(&service, args, json!({}), true, check);
}

/// A field that is refused because it is negative, by its name and with its value.
fn refused(field: &str, n: u64) -> Check {
    let (field, got) = (format!("{field} must be"), format!("got -{n}"));
    Box::new(move |response| {
        let said = response["status"].as_str().unwrap_or_default();
        if response["result"] == false && said.contains(&field) && said.contains(&got) {
            return Ok(());
        }
        Err(format!(
            "expected {field:?} and {got:?}, got {} and {said:?}",
            response["result"]
        ))
    })
}

fn value(name: &'static str, expected: Value) -> Check {
    Box::new(move |response| {
        succeeded(response)?;
        if response["values"][name] == expected {
            return Ok(());
        }
        Err(format!(
            "expected {name} {expected}, got {}",
            response["values"]
        ))
    })
}

/// The runtime's topics are there, with as many types as topics, whatever clients have besides.
fn lists_its_topics(response: &Value) -> Result<(), String> {
    succeeded(response)?;
    let list = |key: &str| {
        response["values"][key]
            .as_array()
            .cloned()
            .unwrap_or_default()
    };
    let (topics, types) = (list("topics"), list("types"));
    if topics.contains(&json!("/joint_states")) && topics.len() == types.len() {
        return Ok(());
    }
    Err(format!(
        "{} topics, {} types, /joint_states among them or not",
        topics.len(),
        types.len()
    ))
}
