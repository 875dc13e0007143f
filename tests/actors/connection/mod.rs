//! A connection in virtual time: throttling, stalls, order and writes, calls one after the other, the queue of
//! computations, and how it ends.
//!
//! **Invariant:** no test depends on how fast the machine is; times are read from the paused clock.

mod ending;
mod pace;
mod stalls;
mod throttling;
mod writes;

use std::time::Duration;

use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, Held, Node, WIDE, settle};
use pendularm::actors::gateway::messages::Publish;
use pendularm::actors::gateway::registry::Nodes;
use pendularm::protocol::catalog::{Service, Topic};
use pendularm::protocol::messages;
use serde_json::{Value, json};
use tokio::time::{sleep, sleep_until};

const PARAMS: &str = Service::SetParams.name();
const STEP: &str = Service::IntegrationStep.name();

/// A gateway whose computations and whose parameters wait for the test to answer.
async fn held_back() -> (Gateway, Held, Held) {
    let (computations, calls) = (Held::default(), Held::default());
    let mut nodes = Nodes::default();
    Node::holding(&computations).attach(&mut nodes, &[Service::IntegrationStep], &[]);
    Node::holding(&calls).attach(&mut nodes, &[Service::SetParams], &[]);
    (Gateway::with(nodes).await, computations, calls)
}

fn id(frame: &Value) -> u64 {
    frame["id"].as_u64().expect("an id")
}
