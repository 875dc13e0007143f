//! `/rosout`: the runtime's own warnings and errors.
//!
//! **Invariant:** without subscribers no warning is stored.

use actix::prelude::*;
use serde::Serialize;
use tokio::sync::mpsc;
use tracing::Level;

use crate::actors::arm::sim::SimulationTime;
use crate::actors::node::{Interest, Nodes, Publish};
use crate::logging::{self, Warning};
use crate::protocol::catalog::Topic;
use crate::protocol::messages::Stamp;

/// Most warnings that wait to be published. Others are only in the log.
const MAX_WAITING: usize = 64;

// ---- state ----------------------------------------------------------------------------------------------------------

/// The part of the gateway that publishes warnings.
pub struct Rosout {
    clock: Recipient<SimulationTime>,
    publish: Recipient<Publish>,
    /// Ends with the last subscriber.
    listening: Option<SpawnHandle>,
}

impl Rosout {
    /// Publishes warnings with the time of `clock`.
    #[must_use]
    pub fn new(clock: Recipient<SimulationTime>, publish: Recipient<Publish>) -> Self {
        Self {
            clock,
            publish,
            listening: None,
        }
    }

    /// Adds the topic to the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        let node = address.clone().recipient();
        nodes.publishers.insert(Topic::Rosout, node);
    }
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl Actor for Rosout {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl Handler<Interest> for Rosout {
    type Result = ();

    fn handle(&mut self, interest: Interest, ctx: &mut Context<Self>) {
        if let Some(listening) = self.listening.take() {
            ctx.cancel_future(listening);
        }
        if !interest.wanted {
            return logging::listen_for_warnings(None);
        }
        let (warnings, mut heard) = mpsc::channel(MAX_WAITING);
        logging::listen_for_warnings(Some(warnings));
        let (clock, publish) = (self.clock.clone(), self.publish.clone());
        let report = async move {
            while let Some(warning) = heard.recv().await {
                // Without an arm there is no time.
                let time = clock.send(SimulationTime).await.unwrap_or_default();
                publish.do_send(message(warning, time));
            }
        };
        self.listening = Some(ctx.spawn(report.into_actor(self)));
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

fn message((metadata, msg): Warning, time: f64) -> Publish {
    // The levels are those of ROS.
    let is_error = *metadata.level() == Level::ERROR;
    let level = if is_error { 40 } else { 30 };
    Publish::made(Topic::Rosout, move || LogMessage {
        stamp: Stamp::from_seconds(time),
        level,
        name: node_of(metadata.target()),
        msg,
        file: metadata.file().unwrap_or_default(),
        function: "",
        line: metadata.line().unwrap_or_default(),
    })
}

/// `rcl_interfaces/msg/Log`. The function is not known.
#[derive(Serialize)]
struct LogMessage {
    stamp: Stamp,
    level: u8,
    name: &'static str,
    msg: String,
    file: &'static str,
    function: &'static str,
    line: u32,
}

/// The actor of the reporting module: `registry` for `pendularm::actors::gateway::registry::clients`.
fn node_of(target: &'static str) -> &'static str {
    let modules = target.split("::").skip_while(|part| *part != "actors");
    let modules: Vec<&'static str> = modules.skip(1).take(2).collect();
    match modules[..] {
        ["arm", "sim"] => "arm_sim",
        // The folders of the actors.
        ["arm" | "compute" | "gateway" | "resources" | "ros", actor] | [actor, ..] => actor,
        [] => "pendularm",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_warning_names_the_actor_without_its_folder() {
        for (target, node) in [
            ("pendularm::actors::arm::sim::node", "arm_sim"),
            ("pendularm::actors::arm::ik_action", "ik_action"),
            ("pendularm::actors::gateway::registry::clients", "registry"),
            ("pendularm::actors::gateway::connection", "connection"),
            ("pendularm::actors::compute::workers", "workers"),
            ("pendularm::actors::runtime", "runtime"),
            ("pendularm::logging", "pendularm"),
        ] {
            assert_eq!(node_of(target), node, "{target}");
        }
    }
}
