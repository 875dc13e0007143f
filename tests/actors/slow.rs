//! Slow clients: timeouts of a client whose frames are not read, and the places of many clients. `exchanges/frames.txt`
//! has the times of frames.
//!
//! **Invariant:** virtual time, so a minute here is exactly that.

use std::time::Duration;

use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, Held, Node, Peer, WIDE, assert_elapsed, settle};
use pendularm::actors::gateway::limits::{FRAME_TIME, KEPT_PLACES};
use pendularm::actors::gateway::registry::Nodes;
use pendularm::options::DEFAULT_CLIENTS;
use pendularm::protocol::catalog::Service;
use tokio::time::{Instant, sleep};

const SECOND: Duration = Duration::from_secs(1);

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
