//! Messages that are partly cut into fragments on another thread arrive in order and in time.

use super::*;
use pendularm::actors::resources::long_work::{WorkKind, WorkPermit};
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

/// A long message in pieces delays only its publisher, and publishers of longer ones.
#[test]
fn only_its_publisher_waits_for_a_message_that_is_cut_up() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut peer = gateway.connect(WIDE);
        subscribe_in_pieces(&mut peer, 100_000).await;
        for topic in ["/plain", "/shorter"] {
            peer.send(json!({"op": "subscribe", "topic": topic, "fragment_size": 20_000}))
                .await;
            peer.receive().await;
        }
        let mut publishers = [gateway.connect(WIDE), gateway.connect(WIDE)];
        for publisher in &mut publishers {
            for topic in ["/t", "/plain", "/shorter"] {
                publisher.advertise(topic).await;
            }
        }
        let [slow, quick] = &mut publishers;
        let places = [
            WorkPermit::take(WorkKind::Long).await,
            WorkPermit::take(WorkKind::Long).await,
        ];
        let publish =
            |topic, text: String| json!({"op": "publish", "topic": topic, "msg": {"data": text}});
        slow.send(publish("/t", "x".repeat(300_000))).await;
        slow.send(publish("/t", "2".into())).await;
        quick.send(publish("/shorter", "y".repeat(60_000))).await;
        quick.send(publish("/plain", "1".into())).await;
        for topic in ["/shorter", "/plain"] {
            assert_eq!(next_message(&mut peer).await.0["topic"], topic);
        }
        drop(places);
        let (long, _) = next_message(&mut peer).await;
        assert_eq!(long["msg"]["data"].as_str().unwrap().len(), 300_000);
        let (short, _) = next_message(&mut peer).await;
        assert_eq!(short["msg"]["data"], "2");
    });
}

/// They may be held back for hours, but not for a client that has disconnected.
#[test]
fn a_throttled_message_delays_no_other_message_and_no_end() {
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
        subscriber.finish().await;
        subscriber.rest().await;
        assert!(began.elapsed() < Duration::from_secs(2));
    });
}
