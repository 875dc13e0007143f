//! One connection to the server: frames out, frames in, each with a deadline.
//!
//! Nothing here panics. Errors are: no server at the address, no answer in time, and a closed connection. A malformed
//! answer becomes an error that quotes it.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// The longest wait for an answer to one call.
pub const PATIENCE: Duration = Duration::from_secs(3);
/// Frames kept for later reading; the oldest is dropped beyond it.
const KEPT: usize = 4096;
/// Bytes of one frame; a longer one is an error.
const LONGEST: usize = 64 << 20;

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
    stream: TcpStream,
    unread: Vec<u8>,
    kept: VecDeque<Value>,
    calls: u64,
}

impl Peer {
    /// Connects to `address`, for example `127.0.0.1:9095`.
    pub fn connect(address: &str) -> Result<Self, String> {
        let mut last = format!("{address} is no address");
        for one in address.to_socket_addrs().map_err(|error| format!("{address}: {error}"))? {
            match TcpStream::connect_timeout(&one, PATIENCE) {
                Ok(stream) => {
                    let set = stream.set_nodelay(true).and_then(|()| stream.set_write_timeout(Some(PATIENCE)));
                    set.map_err(|error| format!("{address}: {error}"))?;
                    return Ok(Self { stream, unread: Vec::new(), kept: VecDeque::new(), calls: 0 });
                }
                Err(error) => last = format!("no connection to {address}: {error}"),
            }
        }
        Err(last)
    }

    /// The server's address.
    pub fn address(&self) -> Result<String, String> {
        self.stream.peer_addr().map(|address| address.to_string()).map_err(|error| format!("the connection has ended: {error}"))
    }

    /// Sends one frame and a newline.
    pub fn send(&mut self, frame: &Value) -> Result<(), String> {
        self.send_line(&frame.to_string())
    }

    /// Sends one line as it is.
    pub fn send_line(&mut self, line: &str) -> Result<(), String> {
        self.stream.write_all(format!("{line}\n").as_bytes()).map_err(|error| format!("the server closed the connection: {error}"))
    }

    /// Calls a service and returns its answer; other frames are kept.
    pub fn call(&mut self, service: &str, args: &Value) -> Result<Answer, String> {
        let id = self.ask(service, args)?;
        let until = Instant::now() + PATIENCE;
        let frame = self.find(until, |frame| is_answer(frame, &id)).map_err(|trouble| match trouble {
            Trouble::Silence => {
                format!("{service} gave no answer within {} s", PATIENCE.as_secs())
            }
            Trouble::Broken(why) => why,
        })?;
        Ok(Answer {
            values: frame.get("values").cloned().unwrap_or_default(),
            result: frame.get("result").and_then(Value::as_bool).unwrap_or_default(),
            status: frame.get("status").and_then(Value::as_str).unwrap_or_default().to_owned(),
            frame,
        })
    }

    /// Sends a call without waiting for its answer; returns its id.
    pub fn ask(&mut self, service: &str, args: &Value) -> Result<String, String> {
        self.calls += 1;
        let id = format!("call-{}", self.calls);
        self.send(&json!({"op": "call_service", "id": id, "service": service, "args": args}))?;
        Ok(id)
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
        let mut chunk = [0; 1 << 16];
        loop {
            if let Some(end) = self.unread.iter().position(|byte| *byte == b'\n') {
                let line: Vec<u8> = self.unread.drain(..=end).collect();
                let text = String::from_utf8_lossy(&line);
                if text.trim().is_empty() {
                    continue;
                }
                return parse(text.trim()).ok_or_else(|| Trouble::Broken(format!("a line is no JSON object: {}", beginning(&text))));
            }
            if self.unread.len() > LONGEST {
                return Err(Trouble::Broken(format!("a frame is longer than {LONGEST} bytes")));
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(Trouble::Silence);
            }
            let read = self.stream.set_read_timeout(Some(left)).and_then(|()| self.stream.read(&mut chunk));
            match read {
                Ok(0) => {
                    return Err(Trouble::Broken("the server closed the connection".to_owned()));
                }
                Ok(count) => self.unread.extend(chunk.iter().take(count)),
                Err(error) if [ErrorKind::WouldBlock, ErrorKind::TimedOut, ErrorKind::Interrupted].contains(&error.kind()) => {}
                Err(error) => {
                    return Err(Trouble::Broken(format!("the server closed the connection: {error}")));
                }
            }
        }
    }
}

/// Whether a frame answers the call with this id.
#[must_use]
pub fn is_answer(frame: &Value, id: &str) -> bool {
    frame.get("op").and_then(Value::as_str) == Some("service_response") && frame.get("id").and_then(Value::as_str) == Some(id)
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
    let mut out = String::with_capacity(text.len());
    for (at, piece) in text.split('"').enumerate() {
        if at > 0 {
            out.push('"');
        }
        // Every second piece is inside a string, except at escaped quotes, which are never next to a number in this
        // protocol.
        if at % 2 == 0 {
            out.push_str(&piece.replace("-Infinity", "null").replace("Infinity", "null").replace("NaN", "null"));
        } else {
            out.push_str(piece);
        }
    }
    out
}
