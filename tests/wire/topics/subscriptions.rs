//! `subscribe` and `unsubscribe`: their ids, how often messages come, and how many wait.

use std::time::{Duration, Instant};

use super::{delivered, pair, publish};
use crate::common::{Client, Runtime};
use serde_json::{Value, json};

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

/// Twenty messages at once, with these `(throttle_rate, queue_length)` subscriptions: the messages that come, and
/// after how long.
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

#[test]
fn of_several_subscriptions_the_smallest_of_each_value_counts() {
    // Alone the first would hold back 3 for an hour, the second 9 for 700 ms.
    let came = throttled(&[(3_600_000, Some(3)), (700, Some(9))], 4);
    let data: Vec<&Value> = came.iter().map(|(data, _)| data).collect();
    assert_eq!(data, [0, 17, 18, 19]);
    // One without a throttle lifts it.
    assert_eq!(throttled(&[(3_600_000, None), (0, None)], 20).len(), 20);
}
