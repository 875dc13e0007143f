//! One connection to the server: frames out, frames in, each with a deadline.
//!
//! Nothing here panics. Errors are: no server at the address, no answer in time, and a closed connection. A malformed
//! answer becomes an error that quotes it.

use std::collections::VecDeque;
use std::net::ToSocketAddrs;
use std::time::{Duration, Instant};

use pendularm_client::blocking::Client;
use pendularm_client::codec::{Event, Framing};
use pendularm_client::{Error, call, is_response_to};
use serde_json::{Value, json};

/// The longest wait for an answer to one call.
pub const PATIENCE: Duration = Duration::from_secs(3);
/// Frames kept for later reading; the oldest is dropped beyond it.
const KEPT: usize = 4096;

/// The reason for a missing frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Trouble {
    /// The deadline passed.
    Silence,
    /// The connection ended, or a line is not a JSON object.
    Broken(String),
}

/// An answer to a call.
#[derive(Debug, Clone)]
pub struct Answer {
    /// The whole frame.
    pub frame: Value,
    /// Its `values`; `null` if there are none.
    pub values: Value,
    /// Its `result`; `false` if there is none.
    pub result: bool,
    /// Its `status`; empty if there is none.
    pub status: String,
}

/// A connection.
#[derive(Debug)]
pub struct Peer {
    client: Client,
    kept: VecDeque<Value>,
    calls: u64,
}

impl Peer {
    /// Connects to `address`, for example `127.0.0.1:9095`.
    pub fn connect(address: &str) -> Result<Self, String> {
        let mut last = format!("{address} is no address");
        for one in address.to_socket_addrs().map_err(|error| format!("{address}: {error}"))? {
            match Client::connect(Framing::Lines, one, PATIENCE) {
                Ok(client) => return Ok(Self { client, kept: VecDeque::new(), calls: 0 }),
                Err(error) => last = format!("no connection to {address}: {error}"),
            }
        }
        Err(last)
    }

    /// The server's address.
    pub fn address(&self) -> Result<String, String> {
        let address = self.client.stream().peer_addr();
        address.map(|address| address.to_string()).map_err(|error| format!("the connection has ended: {error}"))
    }

    /// Sends one frame and a newline.
    pub fn send(&mut self, frame: &Value) -> Result<(), String> {
        self.send_line(&frame.to_string())
    }

    /// Sends one line as it is.
    pub fn send_line(&mut self, line: &str) -> Result<(), String> {
        self.client.write(format!("{line}\n").as_bytes()).map_err(|error| format!("the server closed the connection: {error}"))
    }

    /// Calls a service and returns its answer; other frames are kept.
    pub fn call(&mut self, service: &str, args: &Value) -> Result<Answer, String> {
        self.calls += 1;
        let id = json!(format!("call-{}", self.calls));
        self.send(&call(service, args, &id))?;
        let until = Instant::now() + PATIENCE;
        let frame = self.find(until, |frame| is_response_to(frame, &id)).map_err(|trouble| match trouble {
            Trouble::Silence => format!("{service} gave no answer with id {id} within {} s", PATIENCE.as_secs()),
            Trouble::Broken(why) => why,
        })?;
        Ok(Answer {
            values: frame.get("values").cloned().unwrap_or_default(),
            result: frame.get("result").and_then(Value::as_bool).unwrap_or_default(),
            status: frame.get("status").and_then(Value::as_str).unwrap_or_default().to_owned(),
            frame,
        })
    }

    /// The first frame, kept or new, for which `is_it` is true. It is removed, and others are kept.
    pub fn find(&mut self, until: Instant, is_it: impl Fn(&Value) -> bool) -> Result<Value, Trouble> {
        if let Some(at) = self.kept.iter().position(&is_it) {
            return self.kept.remove(at).ok_or(Trouble::Silence);
        }
        loop {
            let frame = self.receive(until)?;
            if is_it(&frame) {
                return Ok(frame);
            }
            if self.kept.len() == KEPT {
                self.kept.pop_front();
            }
            self.kept.push_back(frame);
        }
    }

    /// Drops the kept frames for which `is_it` holds.
    pub fn forget(&mut self, is_it: impl Fn(&Value) -> bool) {
        self.kept.retain(|frame| !is_it(frame));
    }

    fn receive(&mut self, until: Instant) -> Result<Value, Trouble> {
        loop {
            match self.client.next_event(until) {
                Ok(Event::Text(line)) if line.trim().is_empty() => {}
                Ok(Event::Text(line)) => {
                    return parse(&line).ok_or_else(|| Trouble::Broken(format!("a line is no JSON object: {}", beginning(&line))));
                }
                Err(Error::Late) => return Err(Trouble::Silence),
                Err(error) => return Err(Trouble::Broken(format!("the server closed the connection: {error}"))),
                Ok(event) => return Err(Trouble::Broken(format!("{event:?} instead of a line"))),
            }
        }
    }
}

/// Whether a frame is a message on this topic.
#[must_use]
pub fn is_message(frame: &Value, topic: &str) -> bool {
    frame.get("op").and_then(Value::as_str) == Some("publish") && frame.get("topic").and_then(Value::as_str) == Some(topic)
}

/// The first characters of a text, on one line.
#[must_use]
pub fn beginning(text: &str) -> String {
    text.chars().take(120).map(|one| if one.is_control() { ' ' } else { one }).collect()
}

/// An object. `NaN` and `Infinity`, as Python's `json` writes them, are read as `null`.
fn parse(text: &str) -> Option<Value> {
    let read = |text: &str| serde_json::from_str(text).ok().filter(Value::is_object);
    read(text).or_else(|| read(&without_non_finite(text)))
}

fn without_non_finite(text: &str) -> String {
    // Every second piece is inside a string, except at escaped quotes, which are never next to a number in this protocol.
    let number = |piece: &str| piece.replace("-Infinity", "null").replace("Infinity", "null").replace("NaN", "null");
    let pieces = text.split('"').enumerate();
    let pieces: Vec<String> = pieces.map(|(at, piece)| if at % 2 == 0 { number(piece) } else { piece.to_owned() }).collect();
    pieces.join("\"")
}
