//! Calls that a client has asked and what must come back; each response settles exactly one of them.
//!
//! **Invariant:** a response is right only for the call whose id it carries, once, with that call's service and content.

use std::collections::HashMap;

use serde_json::Value;

/// The response that a call must have, beyond its shape.
pub type Check = Box<dyn Fn(&Value) -> Result<(), String>>;

/// Calls that wait for their response.
#[derive(Default)]
pub struct Ledger {
    /// By the id's text, exactly as it was sent.
    waiting: HashMap<String, Pending>,
    asked: u64,
    /// The latest of the ordered calls that was answered.
    latest: u64,
}

struct Pending {
    service: String,
    /// Its place among the calls that are answered in the order asked; none for those that need not be.
    place: Option<u64>,
    check: Check,
}

impl Ledger {
    /// Notes a call; the runtime's own services, computations apart, answer in the order asked.
    pub fn ask(&mut self, id: &Value, service: &str, ordered: bool, check: Check) {
        self.asked += 1;
        let place = ordered.then_some(self.asked);
        let pending = Pending {
            service: service.to_owned(),
            place,
            check,
        };
        self.waiting.insert(id.to_string(), pending);
    }

    /// Calls without a response so far.
    pub fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// Some of them, for a report.
    pub fn unanswered(&self) -> Vec<String> {
        let some = self.waiting.iter().take(5);
        some.map(|(id, pending)| format!("{} as {id}", pending.service))
            .collect()
    }

    /// Settles the call that the response answers.
    pub fn settle(&mut self, response: &Value) -> Result<(), String> {
        let id = response.get("id").map(Value::to_string).unwrap_or_default();
        let Some(pending) = self.waiting.remove(&id) else {
            return Err(format!(
                "a response to {id}, which is answered already or was never asked"
            ));
        };
        if response["service"] != pending.service.as_str() {
            return Err(format!(
                "{id} asked {}, answered by {}",
                pending.service, response["service"]
            ));
        }
        // Over WebSocket a refusal has its text there.
        let values = &response["values"];
        let is_refusal = response["result"] == false && values.is_string();
        let shaped = (values.is_object() || is_refusal) && response["result"].is_boolean();
        if !shaped || !response["status"].is_string() {
            return Err(format!(
                "{id} of {}: not the shape of a response",
                pending.service
            ));
        }
        if let Some(place) = pending.place {
            if place < self.latest {
                return Err(format!(
                    "{id} of {}: answered after a later call",
                    pending.service
                ));
            }
            self.latest = place;
        }
        (pending.check)(response).map_err(|why| format!("{id} of {}: {why}", pending.service))
    }
}

/// Any response will do.
pub fn anything() -> Check {
    Box::new(|_| Ok(()))
}

/// Nothing but success, with no more said.
pub fn success() -> Check {
    Box::new(succeeded)
}

/// An error unless the response says success.
pub fn succeeded(response: &Value) -> Result<(), String> {
    if response["result"] == true && response["status"] == "" {
        return Ok(());
    }
    Err(format!("failed: {}", response["status"]))
}

/// A refusal that names `named`.
pub fn refusal(named: String) -> Check {
    Box::new(move |response| {
        let said = response["status"].as_str().unwrap_or_default();
        if response["result"] == false && said.contains(&named) {
            return Ok(());
        }
        Err(format!(
            "expected a refusal that says {named:?}, got {} and {said:?}",
            response["result"]
        ))
    })
}
