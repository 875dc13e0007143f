//! Messages that a throttle holds back, and those that a response of the arm discards.

use super::*;
use crate::virtual_time::{Peer, assert_elapsed};
use tokio::time::Instant;

/// A publisher and a subscriber of `/t`, which has messages every `throttle_rate` ms at most.
async fn throttled(gateway: &Gateway, throttle_rate: u64, queue_length: u64) -> (Peer, Peer) {
    let (mut publisher, mut subscriber) = (gateway.connect(WIDE), gateway.connect(WIDE));
    publisher.advertise("/t").await;
    subscriber
        .send(
            json!({"op": "subscribe", "topic": "/t", "throttle_rate": throttle_rate,
            "queue_length": queue_length}),
        )
        .await;
    subscriber.receive().await;
    (publisher, subscriber)
}

#[test]
fn a_throttled_topic_comes_at_its_rate_and_the_newest_are_kept() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut publisher, mut subscriber) = throttled(&gateway, 100, 2).await;
        let began = Instant::now();
        for n in 0..100 {
            publisher.publish("/t", n).await;
            sleep(Duration::from_millis(10)).await;
        }
        // Message n at 10 n ms. At 100 k ms the older of the two newest goes: 10 k - 2 or 10 k - 1, by which of two
        // timers of the same instant is first.
        let mut came = vec![];
        while came.len() < 13 {
            came.push((
                subscriber.receive().await["msg"]["n"].as_u64().unwrap(),
                began.elapsed(),
            ));
            if came.last().unwrap().0 == 99 {
                break;
            }
        }
        assert_eq!(came[0].0, 0);
        assert_eq!(came.last().unwrap().0, 99);
        assert!(came.len() >= 11, "about ten a second: {came:?}");
        for pair in came.windows(2) {
            assert!(pair[0].0 < pair[1].0, "{came:?}");
        }
        assert!(subscriber.hears_nothing_for(Duration::from_secs(5)).await);
    });
}

/// Messages can be late by what was read at once; the last of n can't come before (n - 1) intervals.
#[test]
fn no_more_messages_come_than_the_interval_allows() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut publisher, mut subscriber) = throttled(&gateway, 1000, 5).await;
        let began = Instant::now();
        for n in 0..10 {
            publisher.publish("/t", n).await;
        }
        for (intervals, n) in [(0, 0), (1, 5), (2, 6), (3, 7), (4, 8), (5, 9)] {
            assert_eq!(subscriber.receive().await["msg"]["n"], n);
            assert_elapsed(began, Duration::from_secs(intervals));
        }
    });
}

#[test]
fn after_an_unsubscription_nothing_that_was_held_back_comes() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut publisher, mut subscriber) = (gateway.connect(WIDE), gateway.connect(WIDE));
        publisher.advertise("/t").await;
        subscriber
            .send(json!({"op": "subscribe", "topic": "/t", "throttle_rate": 1000}))
            .await;
        subscriber.receive().await;
        publisher.publish("/t", 0).await;
        publisher.publish("/t", 1).await;
        assert_eq!(subscriber.receive().await["msg"]["n"], 0);
        subscriber
            .send(json!({"op": "unsubscribe", "topic": "/t"}))
            .await;
        assert!(subscriber.hears_nothing_for(Duration::from_secs(9)).await);
    });
}

#[test]
fn a_response_of_the_arm_discards_what_throttling_holds_back_of_its_state() {
    in_virtual_time(async {
        let (gateway, _, calls) = held_back().await;
        let mut client = gateway.connect(WIDE);
        client
            .send(json!({"op": "subscribe", "topic": "/joint_states", "throttle_rate": 1000}))
            .await;
        client.receive().await;
        let publish = |n: u64| Publish {
            topic: Topic::JointStates,
            frame: messages::publish("/joint_states", &json!({"n": n})).into(),
        };
        for n in 0..2 {
            gateway.registry.do_send(publish(n));
        }
        assert_eq!(client.receive().await["msg"]["n"], 0);
        client.call(PARAMS, 7).await;
        settle().await;
        calls.answer();
        assert_eq!(client.receive().await["id"], 7);
        assert!(client.hears_nothing_for(Duration::from_secs(5)).await);
        gateway.registry.do_send(publish(2));
        assert_eq!(
            client.receive().await["msg"]["n"],
            2,
            "1 is from before the response"
        );
    });
}
