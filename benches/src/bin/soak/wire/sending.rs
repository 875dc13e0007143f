//! Sending: frames, calls, and bytes as they are, with an end or a reset behind them.
//!
//! **Invariant:** a call that is pushed as one is in the ledger before it goes out.

use std::io::ErrorKind;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tokio::io::{AsyncWriteExt, Interest};
use tokio::time::timeout_at;

use super::Client;
use crate::ledger::Check;
use crate::world::{Fault, PATIENCE};

impl Client {
    /// Appends a frame to what goes out next.
    pub fn push(&mut self, frame: &Value) {
        self.push_text(&frame.to_string());
    }

    /// The same for a frame as text.
    pub fn push_text(&mut self, frame: &str) {
        self.sent.keep(frame);
        self.world.count("frames sent", 1);
        self.codec.write(frame, &mut self.out);
    }

    /// Takes what would go out next.
    pub fn take_out(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.out)
    }

    /// Appends a call and notes what has to come back; `extra` are further fields of the frame, such as `timeout`.
    pub fn push_call(
        &mut self,
        service: &str,
        args: Value,
        extra: Value,
        ordered: bool,
        check: Check,
    ) {
        let number = self.world.number();
        // Ids of every kind: they come back as they went.
        let id = match number % 4 {
            0 => json!(number),
            1 => json!([self.name, number]),
            2 => json!({"n": number}),
            _ => json!(format!("{}/{number}", self.name)),
        };
        let mut frame = json!({"op": "call_service", "service": service, "id": id, "args": args});
        if let (Some(frame), Some(extra)) = (frame.as_object_mut(), extra.as_object()) {
            frame.extend(extra.clone());
        }
        self.ledger.ask(&id, service, ordered, check);
        self.world.count("calls asked", 1);
        self.push(&frame);
    }

    /// Sends what was appended.
    pub async fn flush(&mut self) -> Result<(), Fault> {
        let out = self.take_out();
        self.send_bytes(&out).await
    }

    /// Sends bytes as they are, and takes in what comes meanwhile: the program need not read whoever does not.
    pub async fn send_bytes(&mut self, mut bytes: &[u8]) -> Result<(), Fault> {
        let deadline = Instant::now() + PATIENCE;
        while !bytes.is_empty() {
            let interest = if self.ended {
                Interest::WRITABLE
            } else {
                Interest::READABLE | Interest::WRITABLE
            };
            let ready = timeout_at(deadline.into(), self.stream.ready(interest)).await;
            let Ok(Ok(ready)) = ready else {
                return Err(self.fault("the program takes nothing more"));
            };
            if ready.is_readable() && !self.ended {
                self.take_in();
            }
            if ready.is_writable() {
                match self.stream.try_write(bytes) {
                    Ok(written) => {
                        self.world.count("bytes sent", written as u64);
                        bytes = &bytes[written..];
                    }
                    Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                    Err(error) => return Err(self.fault(format!("cannot send: {error}"))),
                }
            }
        }
        Ok(())
    }

    /// Sends without reading anything; how many bytes were taken within `time`.
    pub async fn send_deaf(&mut self, bytes: &[u8], time: Duration) -> usize {
        let mut written = 0;
        let deadline = Instant::now() + time;
        while written < bytes.len() {
            match timeout_at(deadline.into(), self.stream.write(&bytes[written..])).await {
                Ok(Ok(more)) => written += more,
                Ok(Err(_)) | Err(_) => break,
            }
        }
        self.world.count("bytes sent", written as u64);
        written
    }

    /// Stops sending; waiting answers still come.
    pub async fn shut_down(&mut self) -> Result<(), Fault> {
        self.stream
            .shutdown()
            .await
            .map_err(|error| self.fault(format!("cannot shut down: {error}")))
    }

    /// Goes with a reset instead of an orderly end.
    pub fn reset(self) {
        let _ = self.stream.set_zero_linger();
        self.world.count("connections reset", 1);
    }
}
