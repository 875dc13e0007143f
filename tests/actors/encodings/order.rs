//! The order of messages of which some are cut up elsewhere, and that each comes in time.

use super::*;
use pendularm::actors::resources::aside::{Errand, PlaceAside};
use tokio::time::Instant;

#[test]
fn messages_keep_their_order_though_long_ones_are_cut_up_elsewhere() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut publisher, mut subscriber) = (gateway.connect(WIDE), gateway.connect(WIDE));
        subscribe_in_pieces(&mut subscriber, 1000).await;
        publisher.advertise("/t").await;
        for n in 0..40 {
            let pad = "x".repeat(if n % 2 == 0 { 100_000 } else { 10 });
            let msg = json!({"n": n, "pad": pad});
            publisher
                .send(json!({"op": "publish", "topic": "/t", "msg": msg}))
                .await;
        }
        for n in 0..40 {
            let (message, number) = next_message(&mut subscriber).await;
            assert_eq!(message["msg"]["n"], n);
            assert_eq!(number > 0, n % 2 == 0, "only the long ones come in pieces");
        }
    });
}

/// A client that asks for long messages in pieces hears of the arm in time all the same, however many others do.
#[test]
fn only_messages_of_its_own_topic_wait_for_one_that_is_cut_up() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut peer = gateway.connect(WIDE);
        subscribe_in_pieces(&mut peer, 100_000).await;
        peer.send(json!({"op": "subscribe", "topic": "/plain"}))
            .await;
        peer.receive().await;
        let mut publisher = gateway.connect(WIDE);
        let places = [
            PlaceAside::take(Errand::WritingLong).await,
            PlaceAside::take(Errand::WritingLong).await,
        ];
        for topic in ["/t", "/plain", "/shorter"] {
            publisher.advertise(topic).await;
        }
        for (topic, text) in [
            ("/t", "x".repeat(300_000)),
            ("/plain", "1".into()),
            ("/t", "2".into()),
        ] {
            publisher
                .send(json!({"op": "publish", "topic": topic, "msg": {"data": text}}))
                .await;
        }
        assert_eq!(peer.receive().await["topic"], "/plain");
        let mut second = gateway.connect(WIDE);
        second
            .send(json!({"op": "subscribe", "topic": "/shorter", "fragment_size": 20_000}))
            .await;
        second.receive().await;
        publisher
            .send(
                json!({"op": "publish", "topic": "/shorter", "msg": {"data": "y".repeat(60_000)}}),
            )
            .await;
        let (shorter, _) = next_message(&mut second).await;
        assert_eq!(
            shorter["topic"], "/shorter",
            "others' long ones have a line of their own"
        );
        drop(places);
        let (long, _) = next_message(&mut peer).await;
        assert_eq!(long["msg"]["data"].as_str().unwrap().len(), 300_000);
        let (short, _) = next_message(&mut peer).await;
        assert_eq!(short["msg"]["data"], "2");
    });
}

/// Other topics bring more than the client takes: it may wait for room for ever.
#[test]
fn a_message_is_cut_up_in_time_however_much_other_topics_bring() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut publisher, mut subscriber) = (gateway.connect(WIDE), gateway.connect(1024));
        subscribe_in_pieces(&mut subscriber, 65_536).await;
        subscriber
            .send(json!({"op": "subscribe", "topic": "/plain"}))
            .await;
        subscriber.receive().await;
        for topic in ["/t", "/plain"] {
            publisher.advertise(topic).await;
        }
        let pad = "x".repeat(128 * 1024);
        for n in 0..100 {
            let topic = if n == 80 { "/t" } else { "/plain" };
            let msg = json!({"n": n, "pad": pad});
            publisher
                .send(json!({"op": "publish", "topic": topic, "msg": msg}))
                .await;
            sleep(Duration::from_millis(100)).await;
        }
        loop {
            let (message, _) = next_message(&mut subscriber).await;
            if message["topic"] == "/t" {
                return;
            }
            assert!(message["msg"]["n"] != 99, "it never came");
        }
    });
}

/// They may be held back for hours, and nobody who has gone waits for them.
#[test]
fn what_a_throttle_holds_back_holds_up_no_other_message_and_no_end() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut publisher, mut subscriber) = (gateway.connect(WIDE), gateway.connect(WIDE));
        subscribe_in_pieces(&mut subscriber, 4096).await;
        subscriber
            .send(
                json!({"op": "subscribe", "topic": "/big", "throttle_rate": 100_000_000,
                "queue_length": 3}),
            )
            .await;
        subscriber.receive().await;
        for (topic, length) in [("/big", 1_100_000), ("/t", 20_000)] {
            publisher.advertise(topic).await;
            let msg = json!({"pad": "x".repeat(length)});
            for _ in 0..if topic == "/big" { 4 } else { 1 } {
                publisher
                    .send(json!({"op": "publish", "topic": topic, "msg": msg}))
                    .await;
            }
        }
        let began = Instant::now();
        for topic in ["/big", "/t"] {
            assert_eq!(next_message(&mut subscriber).await.0["topic"], topic);
        }
        assert!(began.elapsed() < Duration::from_secs(1));
        publish_long(&mut publisher, "/t").await;
        subscriber.half_close().await;
        subscriber.rest().await;
        assert!(began.elapsed() < Duration::from_secs(2));
    });
}
