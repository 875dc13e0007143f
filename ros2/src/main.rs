//! `pendularm-ros2`: joins a running pendularm to a ROS 2 graph, on Zenoh, by the wire conventions of `rmw_zenoh`.
//!
//! [`convention`], [`interfaces`] and [`translation`] are pure; [`actors`] joins the two sides. Types, their CDR and
//! the list of all that there is come from pendularm itself.
//!
//! **Invariant:** the program connects, and never listens.

mod actors;
mod convention;
mod interfaces;
mod options;
mod report;
mod translation;

use actix::{Actor, System};

use crate::actors::graph::Graph;

fn main() -> std::io::Result<()> {
    let options = options::read();
    let system = System::new();
    system.block_on(async { Graph::new(options).start() });
    system.run()
}
