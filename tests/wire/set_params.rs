//! `/arm_sim/set_params` from outside.

use crate::arm::{numbers, stamp, state, state_where};
use crate::common::Runtime;
use serde_json::{Value, json};

const SERVICE: &str = "/arm_sim/set_params";

fn defaults(links: usize) -> Value {
    json!({"gravity": 9.81, "masses": vec![1.0; links], "lengths": vec![1.0; links]})
}

#[test]
fn the_defaults_are_metres_kilograms_and_the_earth() {
    for links in [2, 3] {
        let runtime = Runtime::with_links(links);
        let mut client = runtime.connect();
        for request in [json!({}), Value::Null, json!([])] {
            assert_eq!(client.ask(SERVICE, request), defaults(links));
        }
    }
}

#[test]
fn each_field_is_optional_and_the_answer_echoes_all() {
    let runtime = Runtime::with_links(3);
    let mut client = runtime.connect();
    let mut expected = defaults(3);
    for (field, value) in [
        ("gravity", json!(1.62)),
        ("masses", json!([3.0, 2.0, 0.5])),
        ("lengths", json!([0.4, 0.3, 0.2])),
        ("gravity", json!(0.0)),
    ] {
        let mut request = json!({});
        request[field] = value.clone();
        expected[field] = value;
        assert_eq!(client.ask(SERVICE, request), expected);
    }
    assert_eq!(client.ask(SERVICE, json!({})), expected);
    let all = json!({"gravity": 5.0, "masses": [1.0, 2.0, 3.0], "lengths": [3.0, 2.0, 1.0]});
    assert_eq!(client.ask(SERVICE, all.clone()), all);
    assert_eq!(client.ask(SERVICE, json!([4, [1, 1, 1]]))["gravity"], 4.0);
}

#[test]
fn every_bad_field_is_refused_by_name_and_changes_nothing() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let lists = [
        "[]",
        "[1]",
        "[1,1,1]",
        "null",
        "1",
        "\"1,1\"",
        "{}",
        "[1,0]",
        "[-2,1]",
        "[1,null]",
        "[1,\"1\"]",
        "[true,1]",
        "[1,NaN]",
        "[1e999,1]",
        "[[1],1]",
        "[0.0,-0.0]",
    ];
    let gravities = [
        "-1", "-1e-300", "null", "\"9.81\"", "true", "[9.81]", "NaN", "Infinity", "1e999",
    ];
    for (field, literals) in [
        ("masses", &lists[..]),
        ("lengths", &lists[..]),
        ("gravity", &gravities[..]),
    ] {
        for literal in literals {
            client.send_bytes(
                format!("{{\"op\":\"call_service\",\"service\":\"{SERVICE}\",\"args\":{{\"{field}\":{literal}}}}}\n").as_bytes(),
            );
            let response = client.receive();
            assert_eq!(response["result"], false, "{field} {literal}");
            assert_eq!(response["values"], defaults(2), "{field} {literal}");
            let status = response["status"].as_str().unwrap();
            assert!(status.contains(field), "{field} {literal}: {status}");
        }
    }
}

#[test]
fn a_bad_entry_is_named_with_its_place_and_value() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let why = client.refusal(SERVICE, json!({"masses": [1, -2]}));
    assert_eq!(why, "masses[1] must be greater than 0, got -2");
    let why = client.refusal(
        SERVICE,
        json!({"gravity": -1, "masses": [0, 1], "lengths": [1]}),
    );
    for part in ["gravity", "masses[0]", "lengths"] {
        assert!(why.contains(part), "{part} is missing in {why}");
    }
}

#[test]
fn valid_fields_take_effect_beside_rejected_ones() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let response = client.call(
        SERVICE,
        json!({"gravity": 2, "masses": [1, -1], "lengths": [0.5, 0.5]}),
    );
    assert_eq!(response["result"], false);
    let expected = json!({"gravity": 2.0, "masses": [1.0, 1.0], "lengths": [0.5, 0.5]});
    assert_eq!(response["values"], expected);
    let response = client.call(
        SERVICE,
        json!({"gravity": -2, "masses": [2, 1], "lengths": [0.5]}),
    );
    assert_eq!(response["result"], false);
    assert_eq!(
        response["values"],
        json!({"gravity": 2.0, "masses": [2.0, 1.0], "lengths": [0.5, 0.5]})
    );
    let response = client.call(SERVICE, json!([1, [1, 1], [1, 1], 1]));
    assert_eq!(response["result"], false);
    assert_eq!(
        response["values"]["gravity"], 2.0,
        "refused as a whole, and echoed"
    );
}

#[test]
fn without_gravity_an_arm_at_rest_stays_at_rest() {
    let runtime = Runtime::with_links(3);
    let mut client = runtime.connect();
    client.ask(SERVICE, json!({"gravity": 0}));
    client.subscribe("/joint_states");
    client.ask("/arm_sim/reset", json!({}));
    let later = state_where(&mut client, "half a second", |state| stamp(state) > 0.5);
    assert_eq!(numbers(&later["position"]), [0.0; 3]);
    assert_eq!(numbers(&later["velocity"]), [0.0; 3]);
}

/// From rest along the horizontal a thin rod of length l falls with q̈ = 3g/2l, whatever its mass: the lighter second link
/// is, the nearer the first comes to that. With m₂ = 1e-9 m₁ and after t = 0.1 s the angle is -¾ g t²/l, less 1 % for the cosine.
#[test]
fn new_parameters_move_the_arm_at_once() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    client.ask(
        SERVICE,
        json!({"gravity": 4, "masses": [1, 1e-9], "lengths": [2, 1e-3]}),
    );
    client.ask("/arm_sim/reset", json!({}));
    let fallen = state_where(&mut client, "a tenth of a second", |state| {
        stamp(state) > 0.1
    });
    let t = stamp(&fallen);
    assert!(t < 1.0, "the first state after 0.1 s is from {t} s");
    let expected = -0.75 * 4.0 * t * t / 2.0;
    let is = numbers(&fallen["position"])[0];
    // cos q averages 1 - q²/10 or so on the way: that much, doubled, and 1e-6 for the second link.
    assert!(
        (is - expected).abs() < expected.abs() * (0.2 * expected * expected + 1e-6),
        "{is} {expected} {t}"
    );
}

#[test]
fn extreme_parameters_leave_the_runtime_answering_in_valid_json() {
    for links in [2, 3] {
        let runtime = Runtime::with_links(links);
        let mut client = runtime.connect();
        for topic in ["/joint_states", "/clock", "/diagnostics"] {
            client.subscribe(topic);
        }
        let all = |value: f64| json!(vec![value; links]);
        for (field, value) in [
            ("masses", all(1e-320)),
            ("masses", all(1e308)),
            ("lengths", all(1e-320)),
            ("lengths", all(1e308)),
            ("gravity", json!(1e308)),
            ("gravity", json!(5e-324)),
        ] {
            let mut request = json!({});
            request[field] = value.clone();
            for enabled in [false, true] {
                let values = client.ask(SERVICE, request.clone());
                assert_eq!(values[field], value);
                client.ask("/pid_controller/enable", json!({"data": enabled}));
                client.ask("/arm_sim/reset", json!({}));
                // Each frame is parsed strictly on its way in.
                for topic in ["/joint_states", "/clock", "/joint_states"] {
                    client.message(topic);
                }
                client.ask("/arm_sim/pause", json!({"data": true}));
                client.ask("/arm_sim/pause", json!({"data": false}));
            }
            client.ask(SERVICE, defaults(links));
        }
        // And back in order.
        client.ask("/pid_controller/enable", json!({"data": false}));
        client.ask("/arm_sim/reset", json!({}));
        let fallen = state_where(&mut client, "a falling arm", |state| stamp(state) > 0.3);
        assert!(numbers(&fallen["position"])[0] < -0.05, "{fallen}");
        state(&mut client);
    }
}

#[test]
fn arguments_that_are_no_object_are_refused_by_name_and_the_values_echoed() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for bad in [
        json!(5),
        json!("x"),
        json!(true),
        json!([1.0, [1.0, 1.0], [1.0, 1.0], 4]),
    ] {
        let response = client.call("/arm_sim/set_params", bad.clone());
        assert_eq!(response["result"], false, "{bad}");
        assert!(
            response["status"].as_str().unwrap().starts_with("args "),
            "{response}"
        );
        assert_eq!(response["values"]["lengths"], json!([1.0, 1.0]), "{bad}");
    }
}
