//! rosapi: its answers name everything that there is, and they are true.
//!
//! **Invariant:** the expected lists come from the catalog, values from the services that set them.

use crate::common::{Client, Runtime};
use pendularm::protocol::catalog::{Rosapi, Service, Topic};
use serde_json::{Value, json};

fn texts(list: &Value) -> Vec<&str> {
    let entries = list.as_array().expect("a list").iter();
    entries.map(|one| one.as_str().expect("text")).collect()
}

/// `get_param` of a parameter that exists: its value, as the JSON text says.
fn parameter(client: &mut Client, name: &str) -> Value {
    let answer = client.ask("/rosapi/get_param", json!({"name": name}));
    assert_eq!(answer["successful"], true, "{name}: {answer}");
    serde_json::from_str(answer["value"].as_str().expect("text")).expect("JSON text")
}

#[test]
fn every_question_is_answered_under_both_prefixes_with_the_fields_of_the_catalog() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for question in Rosapi::ALL {
        let service = Service::Rosapi(question);
        let argument = match question {
            Rosapi::MessageDetails => "sensor_msgs/msg/JointState",
            Rosapi::ServiceRequestDetails | Rosapi::ServiceResponseDetails => {
                "pendularm_interfaces/srv/SetParams"
            }
            Rosapi::ActionGoalDetails
            | Rosapi::ActionResultDetails
            | Rosapi::ActionFeedbackDetails => "pendularm_interfaces/action/MoveTo",
            _ => "/x",
        };
        let mut args = json!({});
        for field in service.fields().iter().filter(|field| field.required) {
            args[field.name] = json!(argument);
        }
        for prefix in ["/rosapi/", "/rosapi_node/", "rosapi/", "rosapi_node/"] {
            let values = client.ask(&format!("{prefix}{}", question.short_name()), args.clone());
            let mut given: Vec<&str> = values
                .as_object()
                .unwrap()
                .keys()
                .map(String::as_str)
                .collect();
            let mut listed: Vec<&str> = service
                .response_fields()
                .iter()
                .map(|one| one.name)
                .collect();
            given.sort_unstable();
            listed.sort_unstable();
            assert_eq!(given, listed, "{question:?}");
        }
    }
}

#[test]
fn topics_are_the_catalogs_and_the_clients_as_long_as_they_use_them() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let topics = client.ask("/rosapi/topics", json!({}));
    let own: Vec<&str> = Topic::ALL.iter().map(|topic| topic.name()).collect();
    let types: Vec<&str> = Topic::ALL.iter().map(|topic| topic.type_name()).collect();
    assert_eq!(texts(&topics["topics"]), own);
    assert_eq!(texts(&topics["types"]), types);

    let mut other = runtime.connect();
    other.send(&json!({"op": "advertise", "topic": "/chat", "type": "std_msgs/String"}));
    other.subscribe("/chat");
    other.settle();
    let topics = client.ask("/rosapi/topics", json!({}));
    assert_eq!(texts(&topics["topics"]).last(), Some(&"/chat"));
    assert_eq!(texts(&topics["types"]).last(), Some(&"std_msgs/String"));
    let of_type = json!({"type": "std_msgs/msg/String"});
    assert!(texts(&client.ask("/rosapi/topics_for_type", of_type)["topics"]).contains(&"/chat"));
    for (question, list) in [("publishers", "publishers"), ("subscribers", "subscribers")] {
        let answer = client.ask(&format!("/rosapi/{question}"), json!({"topic": "chat"}));
        assert_eq!(answer[list], json!(["/gateway"]));
    }
    let answer = client.ask("/rosapi/topic_type", json!({"topic": "/chat"}));
    assert_eq!(answer["type"], "std_msgs/String");
    other.send(&json!({"op": "advertise", "topic": "/said", "type": "std_msgs/String"}));
    other.subscribe("/heard");
    other.settle();
    for (topic, publishers, subscribers) in [
        ("/said", json!(["/gateway"]), json!([])),
        ("/heard", json!([]), json!(["/gateway"])),
    ] {
        let answer = client.ask("/rosapi/publishers", json!({"topic": topic}));
        assert_eq!(answer["publishers"], publishers, "{topic}");
        let answer = client.ask("/rosapi/subscribers", json!({"topic": topic}));
        assert_eq!(answer["subscribers"], subscribers, "{topic}");
    }

    drop(other);
    let deadline = std::time::Instant::now() + crate::common::PATIENCE;
    while texts(&client.ask("/rosapi/topics", json!({}))["topics"]).contains(&"/chat") {
        assert!(std::time::Instant::now() < deadline, "the topic stays");
    }
    let answer = client.ask("/rosapi/topic_type", json!({"topic": "/chat"}));
    assert_eq!(answer["type"], "");
}

#[test]
fn services_are_told_with_type_and_node_those_of_clients_too() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let mut provider = runtime.connect();
    provider.send(&json!({"op": "advertise_service", "service": "add", "type": "demo/srv/Add"}));
    provider.status();
    let services = client.ask("/rosapi/services", json!({}));
    let services = texts(&services["services"]);
    for service in Service::ALL {
        assert!(services.contains(&service.name()), "{}", service.name());
    }
    for other in ["/rosapi/topics", "/rosapi_node/topics", "/add"] {
        assert!(services.contains(&other), "{other}");
    }
    for (service, type_name, node) in [
        ("/ik/solve", "pendularm_interfaces/srv/Solve", "/ik"),
        ("rosapi/topics", "rosapi_msgs/srv/Topics", "/rosapi"),
        ("/add", "demo/srv/Add", "/gateway"),
        ("/none", "", ""),
    ] {
        let of = json!({"service": service});
        assert_eq!(
            client.ask("/rosapi/service_type", of.clone())["type"],
            type_name
        );
        assert_eq!(client.ask("/rosapi/service_node", of)["node"], node);
    }
    let of_type = json!({"type": "demo/Add"});
    assert_eq!(
        client.ask("/rosapi/services_for_type", of_type)["services"],
        json!(["/add"])
    );
    let providers = client.ask(
        "/rosapi/service_providers",
        json!({"service": "rosapi/Topics"}),
    );
    assert_eq!(providers["providers"], json!(["/rosapi"]));
}

#[test]
fn a_parameter_is_the_value_that_its_service_shows() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask(
        "/arm_sim/set_params",
        json!({"gravity": 1.5, "masses": [2.0, 3.0]}),
    );
    client.ask("/pid_controller/set_gains", json!({"ki": [7.0, 8.0]}));
    client.ask(
        "/arm_sim/set_integrator",
        json!({"method": "verlet", "timestep": 0.002}),
    );
    for (name, value) in [
        ("gravity", json!(1.5)),
        ("/gravity", json!(1.5)),
        ("arm_sim:masses", json!([2.0, 3.0])),
        ("/arm_sim:ki", json!([7.0, 8.0])),
        ("integrator", json!("verlet")),
        ("timestep", json!(0.002)),
    ] {
        assert_eq!(parameter(&mut client, name), value, "{name}");
    }
    let names = client.ask("/rosapi/get_param_names", json!({}));
    for name in texts(&names["names"]) {
        parameter(&mut client, name);
        assert_eq!(
            client.ask("/rosapi/has_param", json!({"name": name}))["exists"],
            true
        );
    }
}

#[test]
fn a_parameter_that_does_not_exist_reads_as_empty_text_or_as_its_default() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let answer = client.ask("/rosapi/get_param", json!({"name": "/none"}));
    assert_eq!(answer["value"], "\"\"", "clients parse it");
    assert_eq!(answer["successful"], false);
    let args = json!({"name": "/none", "default_value": "5"});
    assert_eq!(client.ask("/rosapi/get_param", args)["value"], "5");
    assert_eq!(
        client.ask("/rosapi/has_param", json!({"name": "/none"}))["exists"],
        false
    );
    let args = json!({"name": "/none", "value": "1"});
    assert_eq!(client.ask("/rosapi/set_param", args)["successful"], false);
}

#[test]
fn setting_a_parameter_is_checked_as_its_service_checks_it() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let mut set = |name: &str, value: &str| {
        client.ask("/rosapi/set_param", json!({"name": name, "value": value}))
    };
    assert_eq!(
        set("/arm_sim:gravity", "3.5"),
        json!({"successful": true, "reason": ""})
    );
    assert_eq!(set("integrator", "\"euler\"")["successful"], true);
    for (name, value, word) in [
        ("gravity", "-1", "gravity"),
        ("gravity", "NaN", "gravity"),
        ("gravity", "1, \"masses\": [5, 5]", "value"),
        ("gravity", "1}", "value"),
        ("gravity", "", "value"),
        ("masses", "[1]", "masses"),
        ("integrator", "\"rk5\"", "integrator must be one of"),
        ("robot_description", "\"<robot/>\"", "robot_description"),
    ] {
        let answer = set(name, value);
        assert_eq!(answer["successful"], false, "{name} {value}: {answer}");
        let reason = answer["reason"].as_str().unwrap();
        assert!(reason.contains(word), "{name} {value}: {reason}");
    }
    let values = client.ask("/arm_sim/set_params", json!({}));
    assert_eq!(
        values,
        json!({"gravity": 3.5, "masses": [1.0, 1.0], "lengths": [1.0, 1.0]})
    );
    let answer = client.ask("/rosapi/delete_param", json!({"name": "gravity"}));
    assert_eq!(answer["successful"], false);
}

#[test]
fn the_description_follows_the_lengths_and_masses() {
    let runtime = Runtime::with_links(3);
    let mut client = runtime.connect();
    client.ask(
        "/arm_sim/set_params",
        json!({"lengths": [0.25, 0.5, 0.75], "masses": [1.0, 2.0, 4.0]}),
    );
    let urdf = parameter(&mut client, "robot_description");
    let urdf = urdf.as_str().unwrap();
    assert!(urdf.starts_with("<?xml"), "{urdf}");
    for part in [
        "<origin xyz=\"0.75 0 0\"/>",
        "<mass value=\"4.0\"/>",
        "<joint name=\"joint3\"",
    ] {
        assert!(urdf.contains(part), "no {part} in {urdf}");
    }
}

#[test]
fn the_time_is_the_simulations_under_the_names_of_both_versions_of_ros() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask("/arm_sim/pause", json!({"data": true}));
    client.subscribe("/clock");
    let clock = client.message("/clock")["clock"].clone();
    let time = client.ask("/rosapi/get_time", json!({}))["time"].clone();
    assert_eq!(
        (&time["sec"], &time["nanosec"]),
        (&clock["sec"], &clock["nanosec"])
    );
    assert_eq!(
        (&time["secs"], &time["nsecs"]),
        (&clock["sec"], &clock["nanosec"])
    );
    assert_eq!(
        client.ask("/rosapi/get_ros_version", json!({}))["version"],
        2
    );
}
