//! Messages in the forms that subscribers ask for, and frames that are read on another thread, in virtual time.
//!
//! **Invariant:** what is made elsewhere comes in its place: order is checked with every message.

use std::fmt::Write as _;
use std::time::Duration;

use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, Held, Node, Peer, WIDE};
use pendularm::actors::gateway::limits::{MAX_FRAGMENT_SIZES, READ_HERE};
use pendularm::actors::gateway::registry::Nodes;
use pendularm::actors::resources::aside::{Errand, PlaceAside};
use pendularm::protocol::catalog::Service;
use pendularm::protocol::op::MAX_ARGS;
use serde_json::{Value, json};
use tokio::time::{Instant, sleep};

async fn subscribe_in_pieces(peer: &mut Peer, size: usize) -> Value {
    peer.send(json!({"op": "subscribe", "topic": "/t", "fragment_size": size}))
        .await;
    peer.receive().await
}

/// The next message, put together if it comes in pieces; and the number of its fragments' id, 0 where there are none.
async fn next_message(peer: &mut Peer) -> (Value, u64) {
    let mut text = String::new();
    loop {
        let frame = peer.receive().await;
        if frame["op"] != "fragment" {
            assert!(text.is_empty(), "nothing comes between two pieces");
            return (frame, 0);
        }
        text.push_str(frame["data"].as_str().unwrap());
        if frame["num"].as_u64().unwrap() + 1 == frame["total"].as_u64().unwrap() {
            let id = frame["id"].as_str().unwrap();
            let number = id.strip_prefix("pendularm:").unwrap().parse().unwrap();
            return (serde_json::from_str(&text).unwrap(), number);
        }
    }
}

async fn publish_long(peer: &mut Peer, topic: &str) {
    let msg = json!({"pad": "x".repeat(2000)});
    peer.send(json!({"op": "publish", "topic": topic, "msg": msg}))
        .await;
}

/// Bytes of the pieces that the next message comes in.
async fn piece_of(peer: &mut Peer) -> usize {
    let first = peer.receive().await;
    for _ in 1..first["total"].as_u64().unwrap() {
        peer.receive().await;
    }
    first["data"].as_str().unwrap().len()
}

#[test]
fn a_topic_is_cut_up_in_so_many_sizes_and_one_more_counts_as_the_power_of_two_below() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut peers = Vec::new();
        for n in 0..MAX_FRAGMENT_SIZES {
            let mut peer = gateway.connect(WIDE);
            assert_eq!(
                subscribe_in_pieces(&mut peer, 100 + n).await["level"],
                "info"
            );
            peers.push(peer);
        }
        let mut publisher = gateway.connect(WIDE);
        publisher.advertise("/t").await;
        let mut late = [99, 110, 127, 128, 500, 99, 600].map(|size| (size, gateway.connect(WIDE)));
        for (size, late) in &mut late {
            assert_eq!(subscribe_in_pieces(late, *size).await["level"], "info");
        }
        publish_long(&mut publisher, "/t").await;
        let cut_in = [64, 110, 64, 128, 256, 64, 512];
        for ((_, late), piece) in late.iter_mut().zip(cut_in) {
            assert_eq!(piece_of(late).await, piece);
        }
        assert_eq!(piece_of(&mut peers[5]).await, 105);
        let (_, late) = &mut late[0];
        late.send(json!({"op": "subscribe", "topic": "/other", "fragment_size": 99}))
            .await;
        late.receive().await;
        publisher.advertise("/other").await;
        publish_long(&mut publisher, "/other").await;
        assert_eq!(piece_of(late).await, 99, "another topic has its own");
    });
}

/// Another size under the same id takes the place of the one before, also where all are in use.
#[test]
fn a_subscription_changes_its_own_size_where_all_are_in_use() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut peers = Vec::new();
        for n in 0..MAX_FRAGMENT_SIZES {
            let mut peer = gateway.connect(WIDE);
            subscribe_in_pieces(&mut peer, 100 + n).await;
            peers.push(peer);
        }
        let mut second = gateway.connect(WIDE);
        subscribe_in_pieces(&mut second, 100).await;
        // Another has the size that it gives up.
        subscribe_in_pieces(&mut second, 99).await;
        let last = peers.last_mut().unwrap();
        for size in [300, 256, 200] {
            subscribe_in_pieces(last, size).await;
        }
        let mut publisher = gateway.connect(WIDE);
        publisher.advertise("/t").await;
        publish_long(&mut publisher, "/t").await;
        assert_eq!(piece_of(&mut second).await, 64);
        assert_eq!(piece_of(last).await, 200);
    });
}

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

/// Hears messages, numbered from 0, up to the last: in order, each of the others counted as dropped. Gives how many came,
/// and the number of the last one that was cut up.
async fn hear_what_was_kept(gateway: &Gateway, peer: &mut Peer, messages: u64) -> (u64, u64) {
    let (mut came, mut cut_up, mut last) = (0, 0, 0);
    while last + 1 < messages {
        let (message, number) = next_message(peer).await;
        let n = message["msg"]["n"].as_u64().unwrap();
        assert!(came == 0 || n > last, "{n} behind {last}");
        last = n;
        came += 1;
        cut_up = cut_up.max(number);
    }
    let dropped = gateway.gauges.messages_dropped();
    assert_eq!(came + dropped, messages, "each has come or is counted");
    assert!(dropped > messages / 4, "{dropped} were too many to be kept");
    (came, cut_up)
}

/// Fragments' ids count what has been cut up: no more than has come.
#[test]
fn nothing_is_cut_up_for_a_client_that_does_not_read() {
    const MESSAGES: u64 = 100;
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut publisher, mut subscriber) = (gateway.connect(WIDE), gateway.connect(1024));
        subscribe_in_pieces(&mut subscriber, 65_536).await;
        publisher.advertise("/t").await;
        for n in 0..MESSAGES {
            let msg = json!({"n": n, "pad": "x".repeat(128 * 1024)});
            publisher
                .send(json!({"op": "publish", "topic": "/t", "msg": msg}))
                .await;
        }
        sleep(Duration::from_secs(60)).await;
        let (came, cut_up) = hear_what_was_kept(&gateway, &mut subscriber, MESSAGES).await;
        assert_eq!(cut_up, came, "each that was cut up has come");
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

/// Pieces of 64 bytes have more than as much around them: of 3 MB they are longer than any outbox takes.
#[test]
fn a_message_whose_pieces_no_outbox_takes_is_counted_for_each_who_would_have_had_them() {
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

/// A series waits to be cut up as one piece, and goes as one; each message in it counts.
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

#[test]
fn of_a_series_a_throttled_subscriber_hears_the_first_and_then_the_newest() {
    const MESSAGES: u64 = 1200;
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut publisher, mut subscriber) = (gateway.connect(WIDE), gateway.connect(WIDE));
        let throttled =
            json!({"op": "subscribe", "topic": "/t", "throttle_rate": 1000, "queue_length": 3});
        subscriber.send(throttled).await;
        subscriber.receive().await;
        publisher.advertise("/t").await;
        for round in 0..2 {
            let first = round * MESSAGES;
            let mut lines = String::new();
            for n in first..first + MESSAGES {
                let _ = writeln!(
                    lines,
                    "{{\"op\":\"publish\",\"topic\":\"/t\",\"msg\":{{\"n\":{n}}}}}"
                );
            }
            publisher.send_text(&lines).await;
            let last = first + MESSAGES;
            for n in [first, last - 3, last - 2, last - 1] {
                assert_eq!(subscriber.receive().await["msg"]["n"], n);
            }
            assert!(subscriber.hears_nothing_for(Duration::from_secs(60)).await);
        }
    });
}

/// Everything about a frame that is read elsewhere comes before everything about the next one.
#[test]
fn long_frames_are_answered_in_their_place() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut client = gateway.connect(WIDE);
        let pad = "[1e5,\"\\u00e9\"],".repeat(READ_HERE / 8);
        for id in 0..20 {
            let long = format!(
                "{{\"op\":\"call_service\",\"service\":\"/none\",\"id\":{id},\"pad\":[{pad}0]}}\n"
            );
            client.send_text(&long).await;
            client.call("/none", 100 + id).await;
            // No JSON, though its braces balance.
            client
                .send_text(&format!("{{\"id\":{id},\"pad\":[{pad}]}}\n"))
                .await;
        }
        for id in 0..20 {
            assert_eq!(client.receive().await["id"], id);
            assert_eq!(client.receive().await["id"], 100 + id);
            let status = client.receive().await;
            assert!(
                status["msg"]
                    .as_str()
                    .unwrap()
                    .starts_with("malformed frame"),
                "{status}"
            );
        }
    });
}

/// A node reads its arguments on its own thread, and so never megabytes of them: not even of members that it has no
/// use for.
#[test]
fn a_node_never_gets_long_arguments() {
    in_virtual_time(async {
        let held = Held::default();
        let mut nodes = Nodes::default();
        Node::holding(&held).attach(&mut nodes, &[Service::SetParams], &[]);
        let gateway = Gateway::with(nodes).await;
        let mut client = gateway.connect(WIDE);
        let call = |args: Value| json!({"op": "call_service", "service": "/arm_sim/set_params", "id": 1, "args": args});
        let (few, many) = (vec![1; 10], vec![1; MAX_ARGS]);
        client
            .send(call(json!({"lengths": few, "pad": many})))
            .await;
        sleep(Duration::from_secs(1)).await;
        let arrived = held.0.borrow_mut().remove(0);
        let args: Value = serde_json::from_str(arrived.arguments.payload().get()).unwrap();
        assert_eq!(
            args,
            json!({"lengths": few}),
            "the rest was never the service's"
        );
        drop(arrived);
        assert_eq!(client.receive().await["id"], 1);
        client.send(call(json!({"lengths": many}))).await;
        let response = client.receive().await;
        assert_eq!(
            (&response["id"], &response["result"]),
            (&json!(1), &json!(false))
        );
        assert!(
            response["status"]
                .as_str()
                .unwrap()
                .contains("args must be at most"),
            "{response}"
        );
        assert_eq!(held.count(), 0);
    });
}
