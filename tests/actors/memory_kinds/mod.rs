//! Each kind of memory that a client can make the program hold: all of it is counted, and all of it is given back. In
//! virtual time.
//!
//! **Invariant:** what is counted is at least what is allocated; the test says how much that is.

mod registrations;
mod unfinished;
mod unread;
mod waiting;

use std::time::Duration;

use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, Node, Peer, WIDE, settle};
use pendularm::actors::gateway::limits::STALL_LIMIT;
use pendularm::actors::gateway::registry::Nodes;
use pendularm::actors::resources::budget::Memory;
use pendularm::protocol::catalog::Service;
use serde_json::json;
use tokio::time::sleep;

const KIB: usize = 1024;
const MIB: usize = 1024 * KIB;

/// A gateway, what it holds, and a client whose pipe holds so much.
struct Scene {
    gateway: Gateway,
    memory: Memory,
    client: Peer,
    /// Bytes that were held before anything was done.
    before: usize,
}

impl Scene {
    async fn new(room: usize, nodes: Nodes) -> Self {
        let memory = Memory::default();
        let gateway = Gateway::within(memory.clone(), nodes).await;
        let client = gateway.connect(room);
        settle().await;
        let before = memory.held();
        Self {
            gateway,
            memory,
            client,
            before,
        }
    }

    /// Sends text as far as it is read.
    async fn flood(&mut self, text: &str) {
        self.client.offer(text).await;
        settle().await;
    }

    fn held(&self) -> usize {
        self.memory.held() - self.before
    }

    /// At least so much is counted now, and at most twice that and what a connection's buffers may take.
    fn holds(&self, bytes: usize) {
        let held = self.held();
        assert!(held >= bytes, "{held} counted of {bytes}");
        assert!(held <= 2 * bytes + MIB, "{held} counted for {bytes}");
    }

    /// The client leaves: nothing is held for it any more.
    async fn end(self) {
        let (memory, gateway) = (self.memory.clone(), self.gateway);
        drop(self.client);
        settle().await;
        for _ in 0..3 {
            if memory.held() > 0 {
                sleep(STALL_LIMIT + Duration::from_secs(20)).await;
            }
        }
        assert_eq!((gateway.gauges.connections(), memory.held()), (0, 0));
    }
}
