//! The parameter services that every node of ROS 2 has, as its tools use them.

use crate::common::{Client, Runtime};
use pendularm::protocol::ros::parameters::MAX_NAMED;
use serde_json::{Value, json};

const NAMES: [&str; 10] = [
    "gravity",
    "masses",
    "lengths",
    "kp",
    "ki",
    "kd",
    "integrator",
    "timestep",
    "control_period",
    "robot_description",
];

fn get(client: &mut Client, names: &[&str]) -> Vec<Value> {
    let values = client.ask("/arm_sim/get_parameters", json!({"names": names}));
    values["values"].as_array().unwrap().clone()
}

fn set(client: &mut Client, parameters: Value) -> Value {
    client.ask("/arm_sim/set_parameters", json!({"parameters": parameters}))["results"].clone()
}

#[test]
fn parameters_are_listed_described_and_told_with_their_types() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let list =
        |client: &mut Client, args| client.ask("/arm_sim/list_parameters", args)["result"].clone();
    let all = json!({"names": NAMES, "prefixes": []});
    assert_eq!(list(&mut client, json!({})), all);
    assert_eq!(list(&mut client, json!({"prefixes": [], "depth": 0})), all);
    let some = list(
        &mut client,
        json!({"prefixes": ["kp", "none", "grav"], "depth": 1}),
    );
    assert_eq!(some["names"], json!(["kp"]));

    let values = get(&mut client, &NAMES);
    let types: Vec<&Value> = values.iter().map(|value| &value["type"]).collect();
    assert_eq!(types, [3, 8, 8, 8, 8, 8, 4, 3, 3, 4]);
    assert_eq!(values[0]["double_value"], 9.81);
    assert_eq!(values[2]["double_array_value"], json!([1.0, 1.0]));
    assert_eq!(values[6]["string_value"], "rk4");
    assert!(
        values[9]["string_value"]
            .as_str()
            .unwrap()
            .starts_with("<?xml")
    );
    assert!(
        values
            .iter()
            .all(|value| value.as_object().unwrap().len() == 10)
    );

    let args = json!({"names": ["timestep", "none", "integrator", "kp"]});
    let types = client.ask("/arm_sim/get_parameter_types", args);
    assert_eq!(types, json!({"types": [3, 0, 4, 8]}));
    let args = json!({"names": ["gravity", "robot_description", "none"]});
    let described = client.ask("/arm_sim/describe_parameters", args);
    let one = |index: usize, field: &str| described["descriptors"][index][field].clone();
    assert_eq!([0, 1, 2].map(|at| one(at, "type")), [3, 4, 0]);
    assert_eq!(
        [0, 1, 2].map(|at| one(at, "read_only")),
        [false, true, false]
    );
    assert_eq!(
        one(0, "description"),
        "gravity of /arm_sim/set_params, in m/s^2"
    );
    assert_eq!(one(2, "name"), "none");
}

#[test]
fn parameters_are_set_one_by_one_and_what_is_wrong_is_told_of_each() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let results = set(
        &mut client,
        json!([
            {"name": "gravity", "value": {"type": 3, "double_value": 1.5}},
            {"name": "masses", "value": {"type": 8, "double_array_value": [1, -2]}},
            {"name": "integrator", "value": {"type": 4, "string_value": "euler"}},
            {"name": "timestep", "value": {"type": 4, "string_value": "0.002"}},
            {"name": "lengths", "value": {"type": 7, "integer_array_value": [2, 1]}},
            {"name": "robot_description", "value": {"type": 4, "string_value": ""}},
            {"name": "none", "value": {"type": 3, "double_value": 1}},
            {"name": "kp", "value": {"type": 8}},
        ]),
    );
    let results = results.as_array().unwrap();
    let successful: Vec<&Value> = results.iter().map(|one| &one["successful"]).collect();
    assert_eq!(
        successful,
        [true, false, true, false, true, false, false, false]
    );
    let reasons: Vec<&str> = results
        .iter()
        .map(|one| one["reason"].as_str().unwrap())
        .collect();
    assert_eq!(reasons[1], "masses[1] must be greater than 0, got -2");
    assert_eq!(reasons[3], "timestep must be a double (type 3), got type 4");
    assert!(reasons[5].contains("made from lengths and masses"));
    assert!(reasons[6].contains("must be that of a parameter"));
    assert!(
        reasons[7].starts_with("kp must be an array"),
        "{}",
        reasons[7]
    );
    let params = client.ask("/arm_sim/set_params", json!({}));
    assert_eq!(
        params,
        json!({"gravity": 1.5, "masses": [1.0, 1.0], "lengths": [2.0, 1.0]})
    );
    let method = client.ask("/arm_sim/set_integrator", json!({}));
    assert_eq!(method, json!({"method": "euler", "timestep": 0.001}));
    let [none] = get(&mut client, &["none"]).try_into().unwrap();
    assert_eq!(
        (none["type"].as_u64(), none["string_value"].as_str()),
        (Some(0), Some(""))
    );
}

#[test]
fn a_question_that_is_none_is_refused_by_its_field_and_changes_nothing() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let many = vec!["gravity"; MAX_NAMED + 1];
    for (args, named) in [
        (json!({}), "names is required"),
        (json!({"names": "gravity"}), "names must be an array"),
        (
            json!({"names": ["kp", 3]}),
            "names[1] must be a string, got 3",
        ),
        (
            json!({"names": many}),
            "names must have at most 64 entries, got 65",
        ),
    ] {
        let why = client.refusal("/arm_sim/get_parameters", args);
        assert!(why.contains(named), "{why}");
    }
    assert_eq!(get(&mut client, &many[1..]).len(), MAX_NAMED);
    let good = json!({"name": "gravity", "value": {"type": 3, "double_value": 0}});
    for bad in [
        json!(7),
        json!({"name": "gravity"}),
        json!({"name": "gravity", "value": 3}),
    ] {
        let args = json!({"parameters": [good, bad]});
        let why = client.refusal("/arm_sim/set_parameters", args);
        assert!(why.starts_with("parameters[1] must be"), "{why}");
    }
    assert_eq!(
        client.ask("/arm_sim/set_params", json!({}))["gravity"],
        9.81
    );
}

/// The questions of a tool that shows a service, beforehand.
#[test]
fn their_types_are_told_to_the_end() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let args = json!({"type": "rcl_interfaces/srv/SetParameters"});
    let details = client.ask("/rosapi/service_request_details", args);
    let names: Vec<&Value> = details["typedefs"]
        .as_array()
        .unwrap()
        .iter()
        .map(|one| &one["type"])
        .collect();
    assert_eq!(
        names,
        [
            "rcl_interfaces/SetParameters_Request",
            "rcl_interfaces/Parameter",
            "rcl_interfaces/ParameterValue"
        ]
    );
}
