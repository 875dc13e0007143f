//! Clients that take for ever: a frame that has begun has a minute, over every transport; a silent client may stay.
//!
//! **Invariant:** virtual time, so a minute here is exactly that.

use std::time::Duration;

use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, Held, Node, Peer, WIDE, assert_elapsed, settle};
use pendularm::actors::gateway::limits::{FRAME_TIME, KEPT_PLACES};
use pendularm::actors::gateway::registry::Nodes;
use pendularm::options::DEFAULT_CLIENTS;
use pendularm::protocol::catalog::Service;
use pendularm::protocol::limits::MAX_FRAME;
use serde_json::json;
use tokio::time::{Instant, sleep};

const SECOND: Duration = Duration::from_secs(1);

#[test]
fn a_client_that_sends_a_byte_per_second_is_told_after_a_minute_and_closed() {
    in_virtual_time(async {
        // A line that is no frame is refused after 32 bytes, and from then on has its time to end.
        for (opening, time) in [
            ("{\"op\":\"publish\",\"topic\":\"/t\",\"msg\":{", FRAME_TIME),
            ("nonsense", 24 * SECOND + FRAME_TIME),
        ] {
            let gateway = Gateway::bare().await;
            let mut slow = gateway.connect(WIDE);
            slow.send_text(opening).await;
            let began = Instant::now();
            for _ in 0..FRAME_TIME.as_secs() - 1 {
                sleep(SECOND).await;
                slow.send_text("x").await;
            }
            let frames = slow.rest().await;
            assert_elapsed(began, time);
            let last = frames.last().unwrap();
            assert_eq!(last["level"], "error");
            assert!(
                last["msg"].as_str().unwrap().contains("within a minute"),
                "{last}"
            );
            settle().await;
            assert_eq!(gateway.gauges.connections(), 0);
        }
    });
}

#[test]
fn a_frame_that_comes_in_time_is_served_and_the_next_has_its_own_time() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut slow = gateway.connect(WIDE);
        for id in 0..3 {
            let frame = json!({"op": "call_service", "service": "/none", "id": id}).to_string();
            let (head, tail) = frame.split_at(10);
            slow.send_text(head).await;
            sleep(FRAME_TIME - SECOND).await;
            slow.send_text(tail).await;
            assert_eq!(slow.receive().await["id"], id);
        }
        // Between frames there is no hurry, nor for white space.
        for _ in 0..10 {
            slow.send_text("\n ").await;
            sleep(10 * FRAME_TIME).await;
        }
        slow.call("/none", 9).await;
        assert_eq!(slow.receive().await["id"], 9);
    });
}

/// A line that is longer than a frame may be is skipped to its end: it has a minute for every 4 MiB.
#[test]
fn a_frame_that_is_skipped_has_time_by_its_length() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut client = gateway.connect(WIDE);
        client.send_text("{\"op\":\"publish\",\"msg\":\"").await;
        let quarter = "x".repeat(MAX_FRAME / 4);
        for _ in 0..20 {
            client.send_text(&quarter).await;
            sleep(FRAME_TIME / 5).await;
        }
        client.send_text("\"}\n").await;
        assert!(
            client.receive().await["msg"]
                .as_str()
                .unwrap()
                .contains("longer than")
        );
        client.call("/none", 1).await;
        assert_eq!(client.receive().await["id"], 1);
    });
}

/// The time counts only while the client is waited for: here its own call takes an hour.
#[test]
fn a_client_that_is_not_read_meanwhile_loses_no_time() {
    in_virtual_time(async {
        let held = Held::default();
        let mut nodes = Nodes::default();
        Node::holding(&held).attach(&mut nodes, &[Service::Pause], &[]);
        let gateway = Gateway::with(nodes).await;
        let mut client = gateway.connect(WIDE);
        client.call("/arm_sim/pause", 1).await;
        client
            .send_text("{\"op\":\"call_service\",\"service\":\"/none\",")
            .await;
        sleep(60 * FRAME_TIME).await;
        held.answer();
        assert_eq!(client.receive().await["id"], 1);
        sleep(FRAME_TIME - SECOND).await;
        client.send_text("\"id\":2}\n").await;
        assert_eq!(client.receive().await["id"], 2);
    });
}

/// As many as there are places: a minute later all of them are free again.
#[test]
fn slow_clients_are_bounded_in_number_and_give_their_places_back() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let began = Instant::now();
        let mut slow: Vec<Peer> = (0..DEFAULT_CLIENTS - KEPT_PLACES)
            .map(|_| gateway.connect(1024))
            .collect();
        for client in &mut slow {
            client.send_text("{\"op\"").await;
        }
        settle().await;
        let told = gateway.connect(1024).rest().await;
        assert!(
            told[0]["msg"]
                .as_str()
                .unwrap()
                .contains("too many connections")
        );
        for client in &mut slow {
            assert_eq!(client.rest().await.len(), 1);
        }
        assert_elapsed(began, FRAME_TIME);
        settle().await;
        assert_eq!(gateway.gauges.connections(), 0);
    });
}
