//! `/pid_controller/set_gains` from outside.

use crate::arm::{is_near, let_simulate, numbers, send_trajectory, state, state_where, trajectory};
use crate::common::Runtime;
use serde_json::{Value, json};

const SERVICE: &str = "/pid_controller/set_gains";

#[test]
fn the_default_gains_have_an_integral_as_strong_as_the_contract_asks() {
    for links in [2, 3] {
        let values = Runtime::with_links(links).connect().ask(SERVICE, json!({}));
        let [kp, ki, kd] = ["kp", "ki", "kd"].map(|name| numbers(&values[name]));
        assert_eq!((kp.len(), ki.len(), kd.len()), (links, links, links));
        assert_eq!(values.as_object().unwrap().len(), 3);
        for joint in 0..links {
            assert!(ki[joint] / kp[joint] >= 1.0, "{values}");
            assert!(kd[joint] > 0.0, "{values}");
        }
    }
}

#[test]
fn each_field_is_optional_and_the_answer_echoes_all() {
    for links in [2, 3] {
        let runtime = Runtime::with_links(links);
        let mut client = runtime.connect();
        let mut expected = client.ask(SERVICE, json!({}));
        for (field, value) in [("kp", 7.5), ("ki", 0.0), ("kd", 1e300), ("kp", 0.0)] {
            let value = json!(vec![value; links]);
            let mut request = json!({});
            request[field] = value.clone();
            expected[field] = value;
            assert_eq!(client.ask(SERVICE, request), expected);
        }
        for request in [json!({}), Value::Null, json!([]), json!({"k": 1})] {
            assert_eq!(client.ask(SERVICE, request), expected);
        }
    }
}

#[test]
fn every_bad_field_is_refused_by_name_and_changes_nothing() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let before = client.ask(SERVICE, json!({}));
    for field in ["kp", "ki", "kd"] {
        for literal in [
            "[]",
            "[1]",
            "[1,1,1]",
            "null",
            "1",
            "\"1\"",
            "true",
            "{}",
            "[1,-1]",
            "[-1e-300,1]",
            "[1,null]",
            "[\"1\",1]",
            "[1,false]",
            "[NaN,1]",
            "[1,Infinity]",
            "[1,1e999]",
        ] {
            client.send_bytes(
                format!("{{\"op\":\"call_service\",\"service\":\"{SERVICE}\",\"args\":{{\"{field}\":{literal}}}}}\n").as_bytes(),
            );
            let response = client.receive();
            assert_eq!(response["result"], false, "{field} {literal}");
            assert_eq!(response["values"], before, "{field} {literal}");
            let status = response["status"].as_str().unwrap();
            assert!(status.contains(field), "{field} {literal}: {status}");
        }
    }
}

#[test]
fn valid_fields_take_effect_beside_rejected_ones() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let before = client.ask(SERVICE, json!({}));
    let response = client.call(SERVICE, json!({"kp": [1, 2], "ki": [1, -2], "kd": [1]}));
    assert_eq!(response["result"], false);
    let status = response["status"].as_str().unwrap();
    assert!(
        status.contains("ki[1]") && status.contains("kd") && !status.contains("kp"),
        "{status}"
    );
    assert_eq!(
        response["values"],
        json!({"kp": [1.0, 2.0], "ki": before["ki"], "kd": before["kd"]})
    );
    let response = client.call(SERVICE, json!([[3, 4], [1, 1], [1, 1], [1, 1]]));
    assert_eq!(response["result"], false);
    assert_eq!(
        response["values"]["kp"],
        json!([1.0, 2.0]),
        "refused as a whole, and echoed"
    );
}

/// Once the arm rests at its setpoint, all of the effort is `ki I`: other kp and kd change nothing that can be seen, while with
/// the integral reset the effort of the first step after would be that of the error alone, next to nothing.
#[test]
fn changing_gains_keeps_the_integral() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    client.ask("/pid_controller/enable", json!({"data": true}));
    send_trajectory(&mut client, &trajectory(&[0.4, 0.3]));
    state_where(&mut client, "an arm at its setpoint", |state| {
        is_near(state, &[0.4, 0.3], 0.002)
            && is_near(&json!({"position": state["velocity"]}), &[0.0; 2], 0.002)
    });
    let_simulate(&mut client, 1.5);
    let before = numbers(&state(&mut client)["effort"]);
    client.ask(SERVICE, json!({"kp": [1200, 300], "kd": [120, 25]}));
    let after = numbers(&client.message("/joint_states")["effort"]);
    for (before, after) in before.iter().zip(&after) {
        assert!(
            (before - after).abs() < 0.05 * before.abs(),
            "{before} {after}"
        );
        assert!(before.abs() > 1.0, "nothing to hold");
    }
}
