//! Two nodes that keep their calls until an exchange decides about them, and the counts of a gateway.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

use pendularm::actors::gateway::registry::Nodes;
use pendularm::actors::node::{Caller, ServiceCall};
use pendularm::actors::resources::memory::Memory;
use pendularm::protocol::catalog::Service;
use pendularm::protocol::limits::MAX_FRAME;
use serde_json::Value;

use super::patterns::{expand, range};
use crate::virtual_time::{Gateway, route, settle};

/// Calls that a node has received and not answered, the oldest first.
type Held = Rc<RefCell<Vec<ServiceCall>>>;

/// The calls of `/arm_sim/integration_step` and of `/arm_sim/set_params`.
#[derive(Default)]
pub(super) struct KeptCalls {
    steps: Held,
    params: Held,
    /// A call that was answered and has not ended.
    answered: Option<Caller>,
}

impl KeptCalls {
    /// A gateway with these nodes, whose clients share this memory.
    pub(super) async fn gateway(&self, memory: Memory) -> Gateway {
        let mut nodes = Nodes::default();
        for (held, service) in [
            (&self.steps, Service::IntegrationStep),
            (&self.params, Service::SetParams),
        ] {
            let held = Rc::clone(held);
            let hold = route(move |call| held.borrow_mut().push(call));
            nodes.services.insert(service, hold);
        }
        Gateway::within(memory, nodes).await
    }

    /// Whether the count of this name equals the number after ` = `.
    pub(super) fn count(&self, gateway: &Gateway, what: &str, wanted: &str) -> Result<(), String> {
        let gauges = Arc::clone(&gateway.gauges);
        let count = match what {
            "connections" => gauges.connections() as usize,
            "dropped" => gauges.messages_dropped() as usize,
            "taken" => gauges.memory().taken().div_ceil(MAX_FRAME),
            "steps" => self.steps.borrow().len(),
            _ => self.params.borrow().len(),
        };
        let wanted = wanted.strip_prefix("= ").and_then(range);
        let (low, high) = wanted.ok_or("no count")?;
        let is_right = (low..=high).contains(&count);
        is_right.then_some(()).ok_or(format!("{count}"))
    }

    /// Decides about the oldest call of a node: `steps` or `params`, and the text of the answer or of the refusal.
    pub(super) async fn decide(&mut self, how: &str, rest: &str) -> Result<(), String> {
        let (node, text) = rest.split_once(' ').unwrap_or((rest, "{}"));
        let node = if node == "steps" {
            &self.steps
        } else {
            &self.params
        };
        if node.borrow().is_empty() {
            return Err("no call".to_owned());
        }
        let mut caller = node.borrow_mut().remove(0).caller;
        match how {
            "answer" | "reply" => {
                let values = serde_json::from_str::<Value>(&expand(text, &Default::default()));
                caller.succeed(&values.map_err(|error| error.to_string())?);
            }
            "refuse" => caller.refuse(text),
            "gone" if !caller.is_gone() => return Err("it is waited for".to_owned()),
            _ => {}
        }
        if how == "reply" {
            self.answered = Some(caller);
        } else {
            drop(caller);
        }
        settle().await;
        Ok(())
    }

    /// Ends the call that was answered.
    pub(super) async fn release(&mut self) {
        self.answered = None;
        settle().await;
    }
}
