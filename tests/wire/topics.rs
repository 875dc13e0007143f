//! `advertise`, `unadvertise`, `publish`, `subscribe`, `unsubscribe`, and ops that are none.
//!
//! **Invariant:** whether a message comes is told without waiting: after its sender has been answered, and then its
//! receiver, nothing is still on its way.

use std::time::{Duration, Instant};

use crate::common::{Client, Runtime};
use pendularm::protocol::catalog::{Direction, Topic};
use serde_json::{Value, json};

fn publish(topic: &str, data: impl Into<Value>) -> Value {
    json!({"op": "publish", "topic": topic, "msg": {"data": data.into()}})
}

/// The data of all messages that have come to `receiver`, once `sender`'s have all been handled.
fn delivered(sender: &mut Client, receiver: &mut Client) -> Vec<Value> {
    sender.settle();
    received(receiver)
}

fn received(receiver: &mut Client) -> Vec<Value> {
    receiver.settle();
    let kept = std::mem::take(&mut receiver.kept);
    let messages = kept.into_iter().filter(|frame| frame["op"] == "publish");
    messages
        .map(|mut frame| frame["msg"]["data"].take())
        .collect()
}

fn error(client: &mut Client, frame: &Value) -> String {
    client.send(frame);
    let status = client.receive();
    assert_eq!(status["op"], "status", "{status}");
    assert_eq!(status["level"], "error", "{status}");
    assert_eq!(status["id"], frame["id"], "{status}");
    status["msg"].as_str().expect("a text").to_owned()
}

/// A publisher that has advertised `/t`, and a subscriber to it.
fn pair(runtime: &Runtime) -> (Client, Client) {
    let (mut publisher, mut subscriber) = (runtime.connect(), runtime.connect());
    publisher.send(&json!({"op": "advertise", "topic": "/t", "type": "std_msgs/msg/String"}));
    subscriber.subscribe("/t");
    (publisher, subscriber)
}

#[test]
fn a_message_reaches_every_subscriber_and_the_publisher_itself_if_it_subscribed() {
    let runtime = Runtime::start();
    let (mut publisher, mut first) = pair(&runtime);
    let mut second = runtime.connect();
    second.subscribe("/t");
    publisher.subscribe("/t");
    publisher.send(&publish("/t", 1));
    assert_eq!(received(&mut publisher), [1]);
    assert_eq!(received(&mut first), [1]);
    assert_eq!(received(&mut second), [1]);
}

#[test]
fn advertise_publish_unadvertise_and_unsubscribe_have_no_reply() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for op in [
        "advertise",
        "advertise",
        "unadvertise",
        "unadvertise",
        "unsubscribe",
    ] {
        client.send(&json!({"op": op, "topic": "/t", "id": op}));
    }
    client.send(&publish("/t", 1));
    client.settle();
    assert!(client.kept.is_empty(), "{:?}", client.kept);
}

#[test]
fn a_publish_without_an_advertisement_is_silently_dropped() {
    let runtime = Runtime::start();
    let (mut advertiser, mut subscriber) = pair(&runtime);
    let mut other = runtime.connect();
    other.send(&publish("/t", "not advertised by this connection"));
    assert!(delivered(&mut other, &mut subscriber).is_empty());
    assert!(other.kept.is_empty(), "{:?}", other.kept);
    advertiser.send(&publish("/t", 2));
    assert_eq!(delivered(&mut advertiser, &mut subscriber), [2]);
}

#[test]
fn unadvertise_silences_this_connection_until_it_advertises_again() {
    let runtime = Runtime::start();
    let (mut publisher, mut subscriber) = pair(&runtime);
    let mut other = runtime.connect();
    other.send(&json!({"op": "advertise", "topic": "/t"}));
    publisher.send(&json!({"op": "unadvertise", "topic": "/t"}));
    publisher.send(&publish("/t", 1));
    assert!(delivered(&mut publisher, &mut subscriber).is_empty());
    other.send(&publish("/t", 2));
    assert_eq!(delivered(&mut other, &mut subscriber), [2]);
    publisher.send(&json!({"op": "advertise", "topic": "/t"}));
    publisher.send(&publish("/t", 3));
    assert_eq!(delivered(&mut publisher, &mut subscriber), [3]);
}

#[test]
fn advertising_twice_is_advertising_once() {
    let runtime = Runtime::start();
    let (mut publisher, mut subscriber) = pair(&runtime);
    publisher.send(&json!({"op": "advertise", "topic": "/t"}));
    publisher.send(&publish("/t", 1));
    publisher.send(&json!({"op": "unadvertise", "topic": "/t"}));
    publisher.send(&publish("/t", 2));
    assert_eq!(delivered(&mut publisher, &mut subscriber), [1]);
}

#[test]
fn nothing_is_kept_for_later_subscribers() {
    let runtime = Runtime::start();
    let mut publisher = runtime.connect();
    publisher.send(&json!({"op": "advertise", "topic": "/t", "latch": true}));
    publisher.send(&publish("/t", 1));
    publisher.settle();
    let mut late = runtime.connect();
    late.subscribe("/t");
    assert!(received(&mut late).is_empty());
}

#[test]
fn the_runtimes_own_topics_can_be_neither_advertised_nor_published() {
    let runtime = Runtime::start();
    let (mut client, mut subscriber) = (runtime.connect(), runtime.connect());
    for topic in Topic::ALL {
        if topic.direction() == Direction::Subscribed {
            continue;
        }
        let name = topic.name();
        // The message would be the first there with this field.
        subscriber.send(&json!({"op": "subscribe", "topic": name}));
        let text = error(
            &mut client,
            &json!({"op": "advertise", "topic": name, "id": 1}),
        );
        assert!(text.contains(name), "{text}");
        let text = error(
            &mut client,
            &json!({"op": "publish", "topic": name, "id": 2, "msg": {"forged": true}}),
        );
        assert!(text.contains(name), "{text}");
    }
    client.settle();
    subscriber.settle();
    assert!(
        subscriber
            .kept
            .iter()
            .all(|frame| frame["msg"]["forged"].is_null())
    );
}

#[test]
fn a_trajectory_needs_no_advertisement_and_other_subscribers_see_it_as_it_came() {
    let runtime = Runtime::start();
    let (mut sender, mut watcher) = (runtime.connect(), runtime.connect());
    watcher.subscribe("/joint_trajectory");
    let msg = r#"{"points": [ {"positions":[0.10, 0.2],"zzz":NaN} ]}"#;
    sender.send_bytes(
        format!("{{\"op\":\"publish\",\"topic\":\"/joint_trajectory\",\"msg\":{msg}}}").as_bytes(),
    );
    let line = watcher.receive_text();
    assert!(line.contains(&msg.replace("NaN", "null")), "{line}");
    assert!(sender.so_far().is_empty());
}

#[test]
fn a_bad_trajectory_is_an_error_to_its_sender_alone_and_other_subscribers_still_see_it() {
    let runtime = Runtime::start();
    let (mut sender, mut watcher) = (runtime.connect(), runtime.connect());
    watcher.subscribe("/joint_trajectory");
    for (id, msg) in [
        json!({}),
        json!({"points": []}),
        json!({"points": [{"positions": [1]}]}),
        json!({"points": [{"positions": [1, "2"]}]}),
        json!({"joint_names": ["joint1"], "points": [{"positions": [1]}]}),
    ]
    .into_iter()
    .enumerate()
    {
        let frame = json!({"op": "publish", "topic": "/joint_trajectory", "msg": msg, "id": id});
        let text = error(&mut sender, &frame);
        assert!(text.contains("/joint_trajectory"), "{text}");
        if frame["msg"].get("joint_names").is_some() {
            assert!(
                text.contains("joint2"),
                "the missing joint is named: {text}"
            );
        }
        assert_eq!(watcher.receive()["msg"], frame["msg"]);
    }
}

#[test]
fn after_an_explicit_unadvertise_trajectories_are_dropped_too() {
    let runtime = Runtime::start();
    let (mut sender, mut watcher) = (runtime.connect(), runtime.connect());
    watcher.subscribe("/joint_trajectory");
    sender.send(&json!({"op": "unadvertise", "topic": "/joint_trajectory"}));
    // Neither the subscribers nor the arm, which would complain, hear of it.
    sender.send(&publish("/joint_trajectory", 1));
    assert!(delivered(&mut sender, &mut watcher).is_empty());
    assert!(sender.kept.is_empty(), "{:?}", sender.kept);
    sender.send(&json!({"op": "advertise", "topic": "/joint_trajectory"}));
    sender.send(&publish("/joint_trajectory", 2));
    assert_eq!(sender.status()["level"], "error");
    assert_eq!(delivered(&mut sender, &mut watcher), [2]);
    // Another connection was never concerned.
    let mut other = runtime.connect();
    other.send(&publish("/joint_trajectory", 3));
    assert_eq!(other.status()["level"], "error");
}

#[test]
fn a_subscription_is_confirmed_and_one_delivery_comes_however_often_it_is_repeated() {
    let runtime = Runtime::start();
    let (mut publisher, mut subscriber) = pair(&runtime);
    for id in [json!("a"), json!("a"), json!("b"), json!({"c": 1})] {
        subscriber.send(&json!({"op": "subscribe", "topic": "/t", "type": "x/Y", "id": id}));
        assert_eq!(
            subscriber.receive(),
            json!({"op": "status", "level": "info", "msg": "subscribed to /t", "id": id})
        );
    }
    publisher.send(&publish("/t", 1));
    assert_eq!(delivered(&mut publisher, &mut subscriber), [1]);
}

#[test]
fn a_subscription_with_a_bad_optional_value_is_an_error_and_no_subscription() {
    let runtime = Runtime::start();
    let mut publisher = runtime.connect();
    publisher.send(&json!({"op": "advertise", "topic": "/t"}));
    let mut client = runtime.connect();
    let bad = [
        ("throttle_rate", "\"fast\""),
        ("throttle_rate", "-1"),
        ("throttle_rate", "NaN"),
        ("throttle_rate", "1e999"),
        ("throttle_rate", "null"),
        ("throttle_rate", "true"),
        ("queue_length", "-1"),
        ("queue_length", "1.5"),
        ("queue_length", "\"1\""),
        ("queue_length", "Infinity"),
        ("queue_length", "[1]"),
        ("type", "7"),
    ];
    for (field, value) in bad {
        client.send_bytes(
            format!("{{\"op\":\"subscribe\",\"topic\":\"/t\",\"{field}\":{value},\"id\":9}}\n")
                .as_bytes(),
        );
        let status = client.receive();
        assert_eq!(status["level"], "error", "{field} {value}: {status}");
        assert_eq!(status["id"], 9);
        assert!(status["msg"].as_str().unwrap().contains(field), "{status}");
    }
    publisher.send(&publish("/t", 1));
    assert!(delivered(&mut publisher, &mut client).is_empty());
}

#[test]
fn unsubscribe_without_an_id_withdraws_all_and_with_an_id_that_one() {
    let runtime = Runtime::start();
    let (mut publisher, mut subscriber) = pair(&runtime);
    for id in ["a", "b"] {
        subscriber.send(&json!({"op": "subscribe", "topic": "/t", "id": id}));
    }
    let mut still_subscribed = |subscriber: &mut Client| {
        publisher.send(&publish("/t", 1));
        !delivered(&mut publisher, subscriber).is_empty()
    };
    for id in ["no such", "a", "a", "b"] {
        subscriber.send(&json!({"op": "unsubscribe", "topic": "/t", "id": id}));
        subscriber.settle();
        assert!(
            still_subscribed(&mut subscriber),
            "after {id}: one without an id is left"
        );
    }
    subscriber.send(&json!({"op": "subscribe", "topic": "/t", "id": "c"}));
    for _ in 0..2 {
        subscriber.send(&json!({"op": "unsubscribe", "topic": "/t"}));
        subscriber.settle();
        assert!(!still_subscribed(&mut subscriber));
    }
    subscriber.send(&json!({"op": "subscribe", "topic": "/t", "id": "d"}));
    subscriber.settle();
    assert!(still_subscribed(&mut subscriber));
    subscriber.send(&json!({"op": "unsubscribe", "topic": "/t", "id": "d"}));
    subscriber.settle();
    assert!(
        !still_subscribed(&mut subscriber),
        "the last one is withdrawn by its id"
    );
}

/// Twenty messages at once, with these `(throttle_rate, queue_length)` subscriptions; what comes and after how long.
fn throttled(subscriptions: &[(u64, Option<u64>)], expected: usize) -> Vec<(Value, Duration)> {
    let runtime = Runtime::start();
    let (mut publisher, mut subscriber) = (runtime.connect(), runtime.connect());
    publisher.send(&json!({"op": "advertise", "topic": "/t"}));
    publisher.settle();
    for (id, (throttle_rate, queue_length)) in subscriptions.iter().enumerate() {
        let mut frame =
            json!({"op": "subscribe", "topic": "/t", "id": id, "throttle_rate": throttle_rate});
        if let Some(length) = queue_length {
            frame["queue_length"] = json!(length);
        }
        subscriber.send(&frame);
        assert_eq!(subscriber.status()["level"], "info");
    }
    let began = Instant::now();
    let messages: String = (0..20)
        .map(|data| format!("{}\n", publish("/t", data)))
        .collect();
    publisher.send_bytes(messages.as_bytes());
    (0..expected)
        .map(|_| (subscriber.message("/t")["data"].take(), began.elapsed()))
        .collect()
}

/// Lower bounds only: however slow the machine, a message never comes before its time. The rate is long beside the
/// milliseconds in which the twenty are taken.
#[test]
fn throttle_rate_is_the_least_time_between_deliveries_and_queue_length_keeps_the_newest() {
    let came = throttled(&[(700, Some(2))], 3);
    let data: Vec<&Value> = came.iter().map(|(data, _)| data).collect();
    assert_eq!(data, [0, 18, 19]);
    assert!(came[1].1 >= Duration::from_millis(700), "{came:?}");
    assert!(came[2].1 >= Duration::from_millis(1400), "{came:?}");
}

#[test]
fn a_queue_length_of_zero_counts_as_one_and_one_is_the_default() {
    for queue_length in [Some(0), Some(1), None] {
        let came = throttled(&[(700, queue_length)], 2);
        let data: Vec<&Value> = came.iter().map(|(data, _)| data).collect();
        assert_eq!(data, [0, 19], "{queue_length:?}");
    }
}

#[test]
fn of_several_subscriptions_the_smallest_of_each_value_counts() {
    // Alone the first would hold back 3 for an hour, the second 9 for 700 ms.
    let came = throttled(&[(3_600_000, Some(3)), (700, Some(9))], 4);
    let data: Vec<&Value> = came.iter().map(|(data, _)| data).collect();
    assert_eq!(data, [0, 17, 18, 19]);
    // One without a throttle lifts it.
    assert_eq!(throttled(&[(3_600_000, None), (0, None)], 20).len(), 20);
}

#[test]
fn an_unknown_op_is_one_error_that_names_it() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for op in ["nonsense", "", "Publish", "publish ", "set_levels"] {
        let text = error(&mut client, &json!({"op": op, "id": 1, "topic": "/t"}));
        assert!(text.contains(op), "{text}");
    }
}

#[test]
fn a_required_field_that_is_missing_or_mistyped_is_one_error_that_names_it() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let whole = [
        (json!({"op": "advertise", "topic": "/t"}), vec!["topic"]),
        (json!({"op": "unadvertise", "topic": "/t"}), vec!["topic"]),
        (
            json!({"op": "publish", "topic": "/t", "msg": {}}),
            vec!["topic", "msg"],
        ),
        (json!({"op": "subscribe", "topic": "/t"}), vec!["topic"]),
        (json!({"op": "unsubscribe", "topic": "/t"}), vec!["topic"]),
        (
            json!({"op": "advertise_service", "service": "/s"}),
            vec!["service"],
        ),
        (
            json!({"op": "unadvertise_service", "service": "/s"}),
            vec!["service"],
        ),
        (
            json!({"op": "call_service", "service": "/s"}),
            vec!["service"],
        ),
        (
            json!({"op": "service_response", "service": "/s", "values": {}, "result": true}),
            vec!["service", "values", "result"],
        ),
    ];
    for (frame, fields) in whole {
        for field in fields {
            for value in [None, Some(json!(7)), Some(Value::Null)] {
                if field == "values" && value.is_some() {
                    continue; // any value will do
                }
                let mut bad = frame.clone();
                bad["id"] = json!("pendularm:1");
                match value {
                    None => drop(bad.as_object_mut().unwrap().remove(field)),
                    Some(value) => bad[field] = value,
                }
                let text = error(&mut client, &bad);
                assert!(text.contains(field), "{bad}: {text}");
            }
        }
    }
    let response = json!({"op": "service_response", "service": "/s", "values": {}, "result": true});
    assert!(error(&mut client, &response).contains("id"));
}
