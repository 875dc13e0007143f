//! A client that reads, and so waits over and over: for its answers, for a status, for the end.
//!
//! **Invariant:** a call that is not answered in time, or before the end of the stream, is a fault that names it.

use std::time::Instant;

use serde_json::{Value, json};

use crate::wire::{Came, Client};
use crate::world::{Fault, PATIENCE};

impl Client {
    /// Sends what was appended, then reads until every call is answered; other frames go to `on_other`.
    pub async fn settle(
        &mut self,
        mut on_other: impl FnMut(&Value) -> Result<(), String>,
    ) -> Result<(), Fault> {
        self.flush().await?;
        let mut deadline = Instant::now() + PATIENCE;
        while self.ledger.waiting() > 0 {
            match self
                .next(deadline.saturating_duration_since(Instant::now()))
                .await?
            {
                // As long as answers come, more may.
                Came::Answer(_) => deadline = Instant::now() + PATIENCE,
                Came::Other(frame) => on_other(&frame).map_err(|why| self.fault(why))?,
                Came::Binary => {}
                Came::End => return Err(self.unanswered("the stream ended")),
                Came::Nothing => return Err(self.unanswered("nothing came for too long")),
            }
        }
        Ok(())
    }

    fn unanswered(&self, why: &str) -> Fault {
        let (count, some) = (self.ledger.waiting(), self.ledger.unanswered());
        self.fault(format!("{why}, with {count} calls unanswered: {some:?}"))
    }

    /// The next status that answers the frame with this id.
    pub async fn status(&mut self, id: &Value) -> Result<Value, Fault> {
        let deadline = Instant::now() + PATIENCE;
        loop {
            match self
                .next(deadline.saturating_duration_since(Instant::now()))
                .await?
            {
                Came::Other(frame) if frame["op"] == "status" && frame["id"] == *id => {
                    return Ok(frame);
                }
                Came::Other(_) | Came::Answer(_) | Came::Binary => {}
                Came::End | Came::Nothing => return Err(self.fault(format!("no status for {id}"))),
            }
        }
    }

    /// Subscribes and waits for the confirmation; `extra` are further fields of the frame.
    pub async fn subscribe(&mut self, topic: &str, extra: Value) -> Result<(), Fault> {
        let id = json!(format!("sub {}", self.world.number()));
        let mut frame = json!({"op": "subscribe", "topic": topic, "id": id});
        if let (Some(frame), Some(extra)) = (frame.as_object_mut(), extra.as_object()) {
            frame.extend(extra.clone());
        }
        self.push(&frame);
        self.flush().await?;
        let status = self.status(&id).await?;
        if status["level"] != "info" {
            return Err(self.fault(format!("not subscribed: {status}")));
        }
        Ok(())
    }

    /// Reads to the end of the stream, which has to come in time.
    pub async fn read_to_end(&mut self) -> Result<(), Fault> {
        let deadline = Instant::now() + PATIENCE;
        loop {
            match self
                .next(deadline.saturating_duration_since(Instant::now()))
                .await?
            {
                Came::End if self.ledger.waiting() > 0 => {
                    return Err(self.unanswered("the stream ended"));
                }
                Came::End => return Ok(()),
                Came::Nothing => return Err(self.fault("the stream does not end")),
                Came::Answer(_) | Came::Other(_) | Came::Binary => {}
            }
        }
    }
}
