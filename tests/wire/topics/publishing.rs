//! `advertise`, `unadvertise` and `publish`: the publishers of messages, their receivers, and the
//! topics.

use super::{delivered, error, pair, publish, received};
use crate::common::Runtime;
use pendularm::protocol::catalog::{Direction, Topic};
use serde_json::json;

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
