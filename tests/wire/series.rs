//! Floods of messages between clients, which go through as they are.
//!
//! **Invariant:** every message is numbered, and every subscriber is told each number once, in order.

use std::io::Write;

use crate::common::{Client, Runtime};
use serde_json::json;

const MESSAGES: u64 = 10_000;
/// Few enough that they fit into an outbox, whoever is slow: none may be dropped.
const AT_ONCE: u64 = 1000;

fn line(topic: &str, n: u64) -> String {
    format!(
        "{{\"op\":\"publish\",\"topic\":\"{topic}\",\"msg\":{{\"n\":{n},\"data\":[0.5,\"abc\"]}}}}\n"
    )
}

/// The same message spelled so that it has to be read.
fn other_spelling(topic: &str, n: u64) -> String {
    format!(
        "{{\"msg\": {{\"n\":{n},\"data\":[5e-1,\"abc\"]}}, \"topic\": \"{topic}\", \"op\": \"publish\"}}\r\n"
    )
}

fn advertise(client: &mut Client, topic: &str) {
    client.send(&json!({"op": "advertise", "topic": topic}));
}

#[test]
fn a_flood_arrives_whole_and_in_order_however_it_is_spelled_and_cut() {
    let runtime = Runtime::start();
    let (mut full, mut short, mut twice) =
        (runtime.connect(), runtime.connect(), runtime.connect());
    full.subscribe("/flood");
    short.subscribe("flood");
    twice.subscribe("/flood");
    twice.subscribe("/flood");
    let mut publisher = runtime.connect();
    advertise(&mut publisher, "/flood");
    for first in (0..MESSAGES).step_by(AT_ONCE as usize) {
        let mut stream = String::new();
        for n in first..first + AT_ONCE {
            match n % 100 {
                98 => stream.push_str(&other_spelling("/flood", n)),
                // To nobody: not advertised.
                99 => stream.push_str(&(line("/nobody", n) + &line("/flood", n))),
                _ => stream.push_str(&line("/flood", n)),
            }
        }
        // Cut at lengths that have nothing to do with those of the messages.
        for piece in stream.as_bytes().chunks(7919) {
            publisher.send_bytes(piece);
        }
        for n in first..first + AT_ONCE {
            for (client, topic) in [
                (&mut full, "/flood"),
                (&mut twice, "/flood"),
                (&mut short, "flood"),
            ] {
                let message = client.message(topic);
                assert_eq!(message["n"], n);
                assert_eq!(message["data"], json!([0.5, "abc"]));
            }
        }
    }
    // Nothing comes behind the last.
    for client in [&mut full, &mut short, &mut twice] {
        assert_eq!(client.call("/arm_sim/pause", json!({}))["result"], true);
    }
}

#[test]
fn what_a_client_sends_between_messages_takes_effect_between_them() {
    let runtime = Runtime::start();
    let mut subscriber = runtime.connect();
    subscriber.subscribe("/x");
    let mut publisher = runtime.connect();
    let toggle = |op: &str| format!("{{\"op\":\"{op}\",\"topic\":\"/x\"}}\n");
    let (open, close) = (toggle("advertise"), toggle("unadvertise"));
    let on = |n| line("/x", n);
    let text = [on(0), open.clone(), on(1), on(2), close, on(3), open, on(4)].concat();
    publisher.send_bytes(text.as_bytes());
    for n in [1, 2, 4] {
        assert_eq!(subscriber.message("/x")["n"], n);
    }
    publisher
        .send_bytes((toggle("subscribe") + &on(5) + &toggle("unsubscribe") + &on(6)).as_bytes());
    assert_eq!(publisher.message("/x")["n"], 5, "its own, too");
    assert_eq!(
        publisher.call("/arm_sim/pause", json!({}))["result"],
        true,
        "and none behind it"
    );
}

#[test]
fn a_subscriber_that_pauses_gets_the_rest_of_what_it_had_begun_to_read_whole() {
    let runtime = Runtime::start();
    let mut slow = runtime.connect();
    slow.subscribe("/x");
    let mut publisher = runtime.connect();
    advertise(&mut publisher, "/x");
    publisher.subscribe("/x");
    // More than the sockets' buffers hold, all while the slow one reads nothing.
    let blob = "x".repeat(1000);
    let message = |n: u64| {
        format!(
            "{{\"op\":\"publish\",\"topic\":\"/x\",\"msg\":{{\"n\":{n},\"blob\":\"{blob}\"}}}}\n"
        )
    };
    let count = 20_000;
    for from in (0..count).step_by(100) {
        let burst: String = (from..from + 100).map(message).collect();
        publisher.stream().write_all(burst.as_bytes()).unwrap();
        for n in from..from + 100 {
            assert_eq!(publisher.message("/x")["n"], n);
        }
    }
    // Some in the middle were dropped; the others are whole, in order, and end with the newest.
    let mut last = None;
    while last != Some(count - 1) {
        let message = slow.message("/x");
        assert_eq!(message["blob"].as_str().unwrap().len(), blob.len());
        let n = message["n"].as_u64();
        assert!(n > last, "{n:?} after {last:?}");
        last = n;
    }
}
