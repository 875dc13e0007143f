//! Dropped messages: the newest ones arrive, and each of the others is counted.

use std::fmt::Write as _;

use super::*;

/// Receives messages, numbered from 0, up to the last one. They are in order, and each missing one is counted as
/// dropped. Returns the number of received messages.
async fn hear_what_was_kept(gateway: &Gateway, peer: &mut Peer, messages: u64) {
    let (mut came, mut last) = (0, 0);
    while last + 1 < messages {
        let (message, _) = next_message(peer).await;
        let n = message["msg"]["n"].as_u64().unwrap();
        assert!(came == 0 || n > last, "{n} behind {last}");
        last = n;
        came += 1;
    }
    let dropped = gateway.gauges.messages_dropped();
    assert_eq!(came + dropped, messages, "each has come or is counted");
    assert!(dropped > messages / 4, "{dropped} were too many to be kept");
}

/// Each piece of 64 bytes has a larger envelope, so the pieces of 3 MB do not fit into an outbox.
#[test]
fn a_message_that_fits_no_outbox_is_counted_for_each_subscriber() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut publisher = gateway.connect(WIDE);
        let mut subscribers = [gateway.connect(WIDE), gateway.connect(WIDE)];
        for subscriber in &mut subscribers {
            subscribe_in_pieces(subscriber, 64).await;
        }
        publisher.advertise("/t").await;
        for (n, length) in [(0, 3_000_000), (1, 100_000)] {
            let msg = json!({"n": n, "pad": "x".repeat(length)});
            publisher
                .send(json!({"op": "publish", "topic": "/t", "msg": msg}))
                .await;
        }
        for subscriber in &mut subscribers {
            assert_eq!(next_message(subscriber).await.0["msg"]["n"], 1);
        }
        assert_eq!(gateway.gauges.messages_dropped(), 2);
    });
}

/// A series waits as one item for its fragmentation, and is dropped as one. Each message in it counts.
#[test]
fn each_message_of_a_series_that_had_to_go_is_counted() {
    const MESSAGES: u64 = 2000;
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut publisher, mut subscriber) = (gateway.connect(WIDE), gateway.connect(1024));
        subscribe_in_pieces(&mut subscriber, 4096).await;
        publisher.advertise("/t").await;
        let pad = "x".repeat(8 * 1024);
        let mut lines = String::new();
        for n in 0..MESSAGES {
            let _ = writeln!(
                lines,
                "{{\"op\":\"publish\",\"topic\":\"/t\",\"msg\":{{\"n\":{n},\"pad\":\"{pad}\"}}}}"
            );
        }
        publisher.send_text(&lines).await;
        sleep(Duration::from_secs(60)).await;
        hear_what_was_kept(&gateway, &mut subscriber, MESSAGES).await;
    });
}
