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
