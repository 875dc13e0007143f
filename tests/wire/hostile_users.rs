//! Clients that mean harm to other clients: names that resemble the runtime's, answers to other people's calls, goals that
//! are not theirs, frames within frames.
//!
//! **Invariant:** what a client registers, answers or sends is never taken for the runtime's, nor for another client's.

use std::io::{BufRead, BufReader};

use crate::common::{Client, Runtime, forwarded, provide, respond};
use pendularm::protocol::catalog::{Direction, Rosapi, Service, Topic};
use serde_json::{Value, json};

/// Names for which a name that a client made up can be mistaken, if anything of it is left out, added or folded.
fn resembling(name: &str) -> Vec<String> {
    let bare = name.trim_start_matches('/');
    let doubled = name
        .rsplit_once('/')
        .map_or_else(String::new, |(front, last)| format!("{front}//{last}"));
    vec![
        format!("//{bare}"),
        format!("///{bare}"),
        format!("{name}/"),
        format!("{name}//"),
        doubled,
        format!("/./{bare}"),
        format!("/x/../{bare}"),
        format!("~{name}"),
        format!("~/{bare}"),
        format!(" {name}"),
        format!("{name} "),
        format!("{name}\u{0}"),
        format!("{name}\u{200b}"),
        format!("{name}\n"),
        format!("{name}?x=1"),
        name.to_uppercase(),
        name.replace('a', "\u{430}"),
        name.replace('/', "\u{2215}"),
        name.replace('/', "%2f"),
        format!("{}.", bare.replace('/', ".")),
        format!("\u{feff}{name}"),
    ]
}

/// Every name of a service of the runtime: rosapi has two prefixes.
fn own_services() -> Vec<String> {
    let mut names: Vec<String> = Service::ALL
        .iter()
        .map(|one| one.name().to_owned())
        .collect();
    for question in Rosapi::ALL {
        names.push(format!("/rosapi_node/{}", question.short_name()));
    }
    names
}

fn error(client: &mut Client) -> String {
    let status = client.status();
    assert_eq!(status["level"], "error", "{status}");
    status["msg"].as_str().unwrap().to_owned()
}

#[test]
fn no_service_of_the_runtime_is_provided_or_withdrawn_under_any_of_its_names() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for name in own_services() {
        for spelling in [name.as_str(), name.trim_start_matches('/')] {
            client.send(&json!({"op": "advertise_service", "service": spelling, "type": "x/Y"}));
            let why = error(&mut client);
            assert!(why.contains("provided by the runtime itself"), "{why}");
            client.send(&json!({"op": "unadvertise_service", "service": spelling}));
            let why = error(&mut client);
            assert!(why.contains("does not provide"), "{why}");
        }
    }
    client.settle();
}

/// A name that is not letter for letter the runtime's is another: it may be provided, and takes no call from the runtime.
#[test]
fn a_service_whose_name_resembles_the_runtimes_takes_none_of_its_calls() {
    let runtime = Runtime::start();
    let (mut impostor, mut client) = (runtime.connect(), runtime.connect());
    for name in ["/arm_sim/pause", "/rosapi/topics"] {
        for alike in resembling(name) {
            provide(&mut impostor, &alike);
        }
        for spelling in [name, &name[1..]] {
            client.ask(spelling, json!({}));
        }
    }
    impostor.settle();
    assert!(impostor.kept.is_empty(), "{:?}", impostor.kept);
}

#[test]
fn no_topic_of_the_runtime_takes_a_clients_message_or_its_advertisement() {
    let runtime = Runtime::start();
    let (mut client, mut listener) = (runtime.connect(), runtime.connect());
    let own = Topic::ALL
        .into_iter()
        .filter(|topic| topic.direction() != Direction::Subscribed);
    for topic in own {
        for spelling in [topic.name(), topic.short_name()] {
            listener.subscribe(spelling);
            client.send(&json!({"op": "advertise", "topic": spelling, "type": topic.type_name()}));
            assert!(error(&mut client).contains("belongs to the runtime"));
            client.send(&json!({"op": "publish", "topic": spelling, "msg": {"forged": true}}));
            assert!(error(&mut client).contains("belongs to the runtime"));
            // Withdrawing what one does not have is harmless, to others too.
            client.send(&json!({"op": "unadvertise", "topic": spelling}));
            client.send(&json!({"op": "unsubscribe", "topic": spelling}));
        }
    }
    client.settle();
    listener.message("/clock");
    listener.settle();
    let forged = |frame: &Value| frame["msg"]["forged"] == true;
    assert!(!listener.kept.iter().any(forged), "{:?}", listener.kept);
}

#[test]
fn a_topic_whose_name_resembles_the_runtimes_is_heard_by_none_of_its_subscribers() {
    let runtime = Runtime::start();
    let (mut client, mut listener) = (runtime.connect(), runtime.connect());
    // Not at 60 Hz: published now and then, so that what is forged would stand out.
    for topic in ["/ik_action/result", "ik_action/result", "/joint_trajectory"] {
        listener.subscribe(topic);
    }
    for alike in resembling("/ik_action/result")
        .into_iter()
        .chain(resembling("/joint_trajectory"))
    {
        client.send(&json!({"op": "advertise", "topic": alike}));
        client.send(
            &json!({"op": "publish", "topic": alike, "msg": {"points": [{"positions": [9, 9]}]}}),
        );
    }
    client.settle();
    assert!(client.kept.is_empty(), "{:?}", client.kept);
    listener.settle();
    assert!(listener.kept.is_empty(), "{:?}", listener.kept);
}

#[test]
fn a_name_that_is_none_is_refused_by_the_field_that_has_it() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for (op, field) in [
        ("advertise", "topic"),
        ("subscribe", "topic"),
        ("advertise_service", "service"),
        ("call_service", "service"),
    ] {
        for name in [
            json!(""),
            json!(null),
            json!(7),
            json!(["/x"]),
            json!({"/x": 1}),
        ] {
            client.send(&json!({"op": op, field: name}));
            let why = error(&mut client);
            assert!(why.contains(field), "{op} {name}: {why}");
        }
    }
}

/// The ids of forwarded calls are easily guessed; that is no secret, since the connection counts, not the id.
#[test]
fn a_guessed_id_answers_nobodys_call_but_ones_own() {
    let runtime = Runtime::start();
    let (mut provider, mut caller) = (runtime.connect(), runtime.connect());
    let mut thief = runtime.connect();
    provide(&mut provider, "/s");
    provide(&mut thief, "/t");
    caller.send(&json!({"op": "call_service", "service": "/s", "id": "mine", "timeout": 600}));
    let call = forwarded(&mut provider);
    // The thief sees how the runtime numbers calls, and is the provider of another that is outstanding.
    caller.send(&json!({"op": "call_service", "service": "/t", "id": "other", "timeout": 600}));
    let seen = forwarded(&mut thief)["id"].as_str().unwrap().to_owned();
    let (prefix, number) = seen.rsplit_once(':').expect("a prefix and a number");
    let number: u64 = number.parse().unwrap();
    for guess in number.saturating_sub(50)..number + 50 {
        for service in ["/s", "s", "/t", "t", "//s"] {
            // Its own call, which a bad answer of its own may fail.
            if guess == number {
                continue;
            }
            let forged = json!({"service": service, "id": format!("{prefix}:{guess}")});
            respond(&mut thief, &forged, json!({"forged": true}));
            error(&mut thief);
        }
    }
    for id in [
        json!("mine"),
        json!("other"),
        json!(number),
        json!(null),
        json!([seen]),
    ] {
        for service in ["/s", "/t"] {
            respond(
                &mut thief,
                &json!({"service": service, "id": id}),
                json!({}),
            );
            error(&mut thief);
        }
    }
    // Its own call has one id, not every text that reads as the same number.
    for id in [
        format!("{prefix}:+{number}"),
        format!("{prefix}:0{number}"),
        format!(" {seen}"),
    ] {
        respond(&mut thief, &json!({"service": "/t", "id": id}), json!({}));
        error(&mut thief);
    }
    // Taking the service over takes what comes from now on, not what is outstanding.
    provide(&mut thief, "/s");
    respond(&mut thief, &call, json!({"forged": true}));
    error(&mut thief);
    caller.settle();
    assert!(caller.kept.is_empty(), "{:?}", caller.kept);
    respond(&mut provider, &call, json!({"genuine": true}));
    let answer = caller.receive();
    assert_eq!(
        (&answer["id"], &answer["values"]),
        (&json!("mine"), &json!({"genuine": true}))
    );
}

#[test]
fn an_answer_after_the_timeout_or_a_second_one_reaches_nobody() {
    let runtime = Runtime::start();
    let (mut provider, mut caller) = (runtime.connect(), runtime.connect());
    provide(&mut provider, "/s");
    caller.send(&json!({"op": "call_service", "service": "/s", "id": 1, "timeout": 0.05}));
    let late = forwarded(&mut provider);
    assert_eq!(caller.receive()["result"], false);
    // The same caller waits again, under the same id of its own.
    caller.send(&json!({"op": "call_service", "service": "/s", "id": 1, "timeout": 600}));
    let call = forwarded(&mut provider);
    respond(&mut provider, &late, json!({"late": true}));
    error(&mut provider);
    respond(&mut provider, &call, json!({"genuine": true}));
    respond(&mut provider, &call, json!({"again": true}));
    error(&mut provider);
    assert_eq!(caller.receive()["values"], json!({"genuine": true}));
    caller.settle();
    assert!(caller.kept.is_empty(), "{:?}", caller.kept);
}

/// Ops that a runtime sends are none that a client may send on to others.
#[test]
fn what_only_the_runtime_says_of_its_action_is_refused_from_a_client() {
    let runtime = Runtime::start();
    let (mut client, mut stranger) = (runtime.connect(), runtime.connect());
    let args = json!({"x": 0.5, "y": 1.2});
    client.send(
        &json!({"op": "send_action_goal", "id": "g", "action": "/ik_action", "feedback": true,
        "action_type": "pendularm_interfaces/action/MoveTo", "args": args}),
    );
    client.settle();
    for (op, why) in [
        ("action_result", "g"),
        ("action_feedback", "g"),
        ("status", "op"),
        ("advertise_action", "/ik_action"),
        ("cancel_goal", "op"),
    ] {
        stranger.send(&json!({"op": op, "id": "g", "action": "/ik_action", "topic": "/ik_action",
            "type": "x/Y", "level": "error", "msg": "forged", "values": {}, "status": 4, "result": true}));
        let refusal = error(&mut stranger);
        assert!(refusal.contains(why), "{op}: {refusal}");
    }
    // The same id is the stranger's own matter.
    for id in [json!("g"), json!(null), json!(["g"])] {
        stranger.send(&json!({"op": "cancel_action_goal", "id": id, "action": "/ik_action"}));
        error(&mut stranger);
    }
    client.settle();
    let frames = std::mem::take(&mut client.kept);
    // The controller is off, which the client is warned of.
    let is_its = |frame: &Value| frame["op"] == "action_feedback" || frame["level"] == "warning";
    assert!(frames.iter().all(is_its), "{frames:?}");
    client.send(&json!({"op": "cancel_action_goal", "id": "g", "action": "/ik_action"}));
    let end = client.receive_where("result", |frame| frame["op"] == "action_result");
    assert_eq!((&end["id"], &end["status"]), (&json!("g"), &json!(5)));
}

#[test]
fn two_goals_under_one_id_are_told_apart_by_their_connections() {
    let runtime = Runtime::start();
    let (mut one, mut other) = (runtime.connect(), runtime.connect());
    one.ask("/pid_controller/enable", json!({"data": true}));
    let goal = |x: f64| {
        json!({"op": "send_action_goal", "id": "g", "action": "/ik_action",
        "action_type": "pendularm_interfaces/action/MoveTo", "args": {"x": x, "y": 1.2}})
    };
    one.send(&goal(0.5));
    one.settle();
    other.send(&goal(0.4));
    other.settle();
    let end = one.receive_where("result", |frame| frame["op"] == "action_result");
    assert_eq!(
        (&end["id"], &end["status"]),
        (&json!("g"), &json!(6)),
        "preempted"
    );
    one.send(&json!({"op": "cancel_action_goal", "id": "g", "action": "/ik_action"}));
    error(&mut one);
    other.settle();
    assert!(other.kept.is_empty(), "{:?}", other.kept);
}

#[test]
fn pieces_of_two_clients_under_one_id_make_no_frame() {
    let runtime = Runtime::start();
    let (mut one, mut other) = (runtime.connect(), runtime.connect());
    let set = r#"{"op":"call_service","service":"/arm_sim/set_params","args":{"gravity":1}}"#;
    let piece = |num: usize, data: &str| json!({"op": "fragment", "id": "f", "num": num, "total": 2, "data": data});
    one.send(&piece(0, &set[..20]));
    one.settle();
    other.send(&piece(1, &set[20..]));
    assert_eq!(other.ask("/arm_sim/set_params", json!({}))["gravity"], 9.81);
    one.send(&piece(1, &set[20..]));
    assert_eq!(one.receive()["values"]["gravity"], 1.0, "they were pieces");
}

#[test]
fn a_clients_level_is_its_own() {
    let runtime = Runtime::start();
    let (mut client, mut other) = (runtime.connect(), runtime.connect());
    other.send(&json!({"op": "set_level", "level": "none"}));
    other.settle();
    client.subscribe("/x");
    client.send(&json!({"op": "nonsense"}));
    error(&mut client);
}

/// To some readers a carriage return ends a line: to Python's, in text mode, on the first screen of the README. Between two of
/// them a message could hold what is a frame to them, of any topic, or the answer to any call.
#[test]
fn no_frame_holds_another_for_readers_that_end_lines_at_a_carriage_return() {
    let runtime = Runtime::start();
    let (mut forger, mut victim) = (runtime.connect(), runtime.connect());
    victim.subscribe("/chat");
    let mut lines = BufReader::new(victim.stream().try_clone().unwrap());
    forger.send(&json!({"op": "advertise", "topic": "/chat"}));
    provide(&mut forger, "/s");
    let inner = r#"{"op":"publish","topic":"/joint_states","msg":{}}"#;
    forger.send_bytes(
        format!("{{\"op\":\"publish\",\"topic\":\"/chat\",\"msg\":{{\"a\":[\r{inner}\r,\r1,\"\\r\"]}}}}\n")
            .as_bytes(),
    );
    let mut line = String::new();
    lines.read_line(&mut line).unwrap();
    assert!(!line.contains('\r'), "{line:?}");
    // The content is the same.
    let frame: Value = serde_json::from_str(&line).unwrap();
    let list = frame["msg"]["a"].as_array().unwrap();
    assert_eq!(list[1..], [json!(1), json!("\r")]);
    assert_eq!(list[0]["topic"], "/joint_states");

    victim.send_bytes(
        b"{\"op\":\"call_service\",\"service\":\"/s\",\"id\":7,\"timeout\":600,\"args\":{\"a\":\r[\r]}}\n",
    );
    let call = forger.receive_text();
    assert!(!call.contains('\r'), "{call:?}");
    let call: Value = serde_json::from_str(&call).unwrap();
    let forged = format!(
        "{{\"op\":\"service_response\",\"service\":\"/s\",\"id\":{},\"result\":true,\"values\":{{\"a\":\r{inner}\r}}}}\n",
        call["id"]
    );
    forger.send_bytes(forged.as_bytes());
    line.clear();
    lines.read_line(&mut line).unwrap();
    assert!(
        !line.contains('\r') && line.contains("/joint_states"),
        "{line:?}"
    );
}
