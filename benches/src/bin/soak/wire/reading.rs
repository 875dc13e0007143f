//! Reading: whole frames, sips of what has come, or all of it thrown away up to the end.
//!
//! **Invariant:** a response is in the ledger before anybody else has it.

use std::io::ErrorKind;
use std::time::{Duration, Instant};

use pendularm_client::codec::Event;
use pendularm_client::websocket::{LAST, append, opcode};
use serde_json::Value;
use tokio::time::timeout_at;

use super::{Came, Client};
use crate::world::Fault;

impl Client {
    pub(super) fn take_in(&mut self) {
        match self.stream.try_read(&mut self.chunk) {
            Ok(0) => self.ended = true,
            Ok(read) => {
                self.codec.push(&self.chunk[..read]);
                self.world.count("bytes received", read as u64);
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(_) => self.ended = true,
        }
    }

    /// Waits for bytes; false if none came until `deadline`.
    pub(super) async fn wait_readable(&mut self, deadline: Instant) -> Result<bool, Fault> {
        let readable = self.is_readable(deadline).await?;
        if readable {
            self.take_in();
        }
        Ok(readable)
    }

    /// Waits for bytes and leaves them where they are; false if none came until `deadline`.
    pub async fn is_readable(&mut self, deadline: Instant) -> Result<bool, Fault> {
        match timeout_at(deadline.into(), self.stream.readable()).await {
            Ok(Ok(())) => Ok(true),
            Ok(Err(error)) => Err(self.fault(format!("cannot read: {error}"))),
            Err(_) => Ok(false),
        }
    }

    /// At most so many bytes of what has come so far, thrown away: a slow reader reads like that.
    pub fn sip(&mut self, most: usize) -> usize {
        let mut buffer = vec![0; most];
        match self.stream.try_read(&mut buffer) {
            Ok(0) => {
                self.ended = true;
                0
            }
            Ok(read) => {
                buffer.truncate(read);
                self.world.count("bytes received", read as u64);
                self.codec.push(&buffer);
                read
            }
            Err(error) => {
                self.ended |= error.kind() != ErrorKind::WouldBlock;
                0
            }
        }
    }

    /// Whether the stream has ended, with all of it read.
    pub fn is_over(&self) -> bool {
        self.ended
    }

    /// The next frame within `patience`; responses are settled on the way.
    pub async fn next(&mut self, patience: Duration) -> Result<Came, Fault> {
        let deadline = Instant::now() + patience;
        loop {
            if let Some(came) = self.take_frame().await? {
                return Ok(came);
            }
            if self.ended {
                return Ok(Came::End);
            }
            if !self.wait_readable(deadline).await? {
                return Ok(Came::Nothing);
            }
        }
    }

    /// A frame of what has come already.
    async fn take_frame(&mut self) -> Result<Option<Came>, Fault> {
        let text = loop {
            let next = self.codec.next_event();
            match next.map_err(|why| self.fault(why.to_string()))? {
                None => return Ok(None),
                Some(Event::Text(text)) => break text,
                Some(Event::Binary(_)) => return Ok(Some(Came::Binary)),
                Some(Event::Ping(payload)) => {
                    let mut pong = Vec::new();
                    append(&mut pong, LAST | opcode::PONG, [0, 0, 0, 7], &payload);
                    self.send_bytes(&pong).await?;
                    self.world.count("pings answered", 1);
                }
                Some(Event::Pong(_)) => {}
                Some(Event::Close(..)) => self.ended = true,
            }
        };
        self.came.keep(&text);
        self.world.count("frames received", 1);
        let frame: Value = serde_json::from_str(&text).map_err(|error| {
            self.fault(format!("{} bytes that are no JSON: {error}", text.len()))
        })?;
        if frame["op"] != "service_response" {
            return Ok(Some(Came::Other(frame)));
        }
        self.ledger.settle(&frame).map_err(|why| self.fault(why))?;
        self.world.count("calls answered and checked", 1);
        Ok(Some(Came::Answer(frame)))
    }

    /// Throws away what comes; the number of bytes up to the end, or an error where neither a byte nor the end comes
    /// for so long. Megabytes through a small buffer take their time on a busy machine.
    pub async fn swallow(&mut self, patience: Duration) -> Result<usize, Fault> {
        let mut swallowed = 0;
        loop {
            swallowed += self.codec.discard();
            if self.ended {
                return Ok(swallowed);
            }
            if !self.wait_readable(Instant::now() + patience).await? {
                let why = format!("no end of the connection after {swallowed} bytes");
                return Err(self.fault(why));
            }
        }
    }
}
