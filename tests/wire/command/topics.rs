//! `topic echo`, `topic hz` and `topic pub`.

use serde_json::{Value, json};

use super::{Going, said};
use crate::common::{self, Client, Runtime};

#[test]
fn text_of_other_clients_is_escaped_without_loss() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let msg = json!({"data": "\u{1b}[2J\u{202e}\u{9b}31m\r\n---\n", "ok": "\u{e9} yes: no", "\u{1b}": [[], {}, [1, [2]]]});
    client.send(&json!({"op": "advertise", "topic": "/hostile", "type": "std_msgs/msg/String"}));
    client.settle();
    for line in [
        "topic echo /hostile --once",
        "topic echo /hostile --once --json",
    ] {
        let child = Going::start(&runtime, line);
        wait_for_subscriber(&mut client, "/hostile", 1);
        client.send(&json!({"op": "publish", "topic": "/hostile", "msg": msg}));
        let (status, text, complaint) = child.end();
        assert_eq!((status, complaint.as_str()), (Some(0), ""));
        let acts = |one: char| one != '\n' && (one.is_control() || one == '\u{202e}');
        assert!(!text.contains(acts), "{text:?}");
        if line.contains("--json") {
            assert_eq!(serde_json::from_str::<Value>(&text).unwrap(), msg);
        } else {
            assert!(text.contains("ok: \"\u{e9} yes: no\"\n"), "{text}");
            assert!(
                text.contains("\"\\u001b\":\n- []\n- {}\n- - 1\n  - - 2\n"),
                "{text}"
            );
        }
        wait_for_subscriber(&mut client, "/hostile", 0);
    }
}

/// Waits until this many nodes subscribe to the topic: all clients count as one node.
fn wait_for_subscriber(client: &mut Client, topic: &str, count: usize) {
    let deadline = std::time::Instant::now() + common::PATIENCE;
    loop {
        let nodes = client.ask("/rosapi/subscribers", json!({"topic": topic}));
        if nodes["subscribers"].as_array().unwrap().len() == count {
            return;
        }
        assert!(std::time::Instant::now() < deadline, "{topic}: {nodes}");
    }
}

/// The rate is asked for by two independent numbers: it is the inverse of the mean, which lies between the extremes.
#[test]
fn a_rate_is_printed_every_second_until_a_signal() {
    let runtime = Runtime::start();
    let mut child = Going::start(&runtime, "topic hz /clock --json");
    let first: Value = serde_json::from_str(&child.line()).unwrap();
    let second: Value = serde_json::from_str(&child.line()).unwrap();
    let number = |name: &str| second[name].as_f64().unwrap();
    assert!(number("window") > first["window"].as_f64().unwrap());
    assert!(number("min") <= number("rate").recip() && number("rate").recip() <= number("max"));
    assert!(number("std_dev") >= 0.0 && number("std_dev") <= number("max") - number("min"));
    child.terminate();
    let (status, _, complaint) = child.end();
    assert_eq!((status, complaint.as_str()), (None, ""));
    let mut child = Going::start(&runtime, "topic hz -w 2 /clock");
    assert!(child.line().starts_with("average rate: "));
    let details = child.line();
    assert!(
        details.starts_with("\tmin: ") && details.ends_with("window: 2\n"),
        "{details}"
    );
    child.terminate();
    assert_eq!(child.end().0, None);
}

#[test]
fn messages_are_published_once_n_times_or_until_a_signal() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask("/pid_controller/enable", json!({"data": true}));
    client.subscribe("/joint_trajectory");
    let once = "topic pub -1 /joint_trajectory 'points: [{positions: [0.3, -0.5]}]'";
    let line = "publishing #1: {\"points\":[{\"positions\":[0.3,-0.5]}]}\n";
    assert_eq!(said(&runtime, once), line);
    let received = client.message("/joint_trajectory");
    assert_eq!(received, json!({"points": [{"positions": [0.3, -0.5]}]}));
    let fast = "topic pub /chatter std_msgs/msg/String '{data: hi}' -r 200 -t 3";
    let lines = said(&runtime, fast);
    assert_eq!(
        lines.lines().last(),
        Some("publishing #3: {\"data\":\"hi\"}")
    );
    let mut child = Going::start(&runtime, "topic pub /chatter 'data: hi' -r 100");
    child.line();
    assert!(child.line().starts_with("publishing #2"));
    child.terminate();
    assert_eq!(child.end().0, None);
}
