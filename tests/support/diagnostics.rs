//! Reading `/diagnostics`.

use serde_json::Value;

use crate::common::Client;

/// The status of this name in a message.
pub fn status<'a>(message: &'a Value, name: &str) -> &'a Value {
    let all = message["status"].as_array().unwrap();
    all.iter()
        .find(|status| status["name"] == name)
        .unwrap_or_else(|| panic!("no {name} in {message}"))
}

/// The value of this key in a status.
pub fn text<'a>(status: &'a Value, key: &str) -> &'a str {
    let values = status["values"].as_array().unwrap();
    let entry = values.iter().find(|entry| entry["key"] == key);
    entry
        .and_then(|entry| entry["value"].as_str())
        .unwrap_or_else(|| panic!("no {key} in {status}"))
}

pub fn number(status: &Value, key: &str) -> f64 {
    text(status, key).parse().unwrap()
}

/// The arm's status in the next message.
pub fn arm_status(client: &mut Client) -> Value {
    status(&client.message("/diagnostics"), "arm_sim").clone()
}
