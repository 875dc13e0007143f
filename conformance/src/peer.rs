//! One connection to the server: frames out, frames in, each with a deadline.
//!
//! Nothing here panics, waits without a limit, or keeps more than a limited number of bytes. Errors are: no server at the
//! address, no answer in time, and a closed connection. A malformed answer becomes an error that quotes it.

use std::collections::{BTreeSet, VecDeque};
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::run::{Run, Side};

/// The longest wait for a connection.
const CONNECTING: Duration = Duration::from_secs(2);
/// The time between two looks at the end of the run.
const SLICE: Duration = Duration::from_millis(200);
/// An answer with the id of an earlier call is used if no other answer comes within this time.
const GRACE: Duration = Duration::from_millis(300);
/// The first bytes of an alert of TLS.
const TLS_ALERT: [u8; 2] = [0x15, 3];
/// The longest line that is read. No answer to a request of a rule is nearly as long.
const LONGEST_LINE: usize = 1 << 20;
/// Frames kept for later reading, and their bytes; the oldest is dropped beyond it.
const KEPT: usize = 4096;
const KEPT_BYTES: usize = 2 << 20;

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
    id: Value,
}

impl Answer {
    /// Passes if the answer has the id of its call.
    pub fn has_id(&self) -> Result<&Value, String> {
        match self.frame.get("id") {
            Some(id) if *id == self.id => Ok(id),
            Some(id) => Err(format!("an answer came, but with id {id} instead of {}", self.id)),
            None => Err("an answer came, but without id".to_owned()),
        }
    }
}

/// A connection.
#[derive(Debug)]
pub struct Peer {
    /// What it shares with the other connections of the run.
    pub run: Arc<Run>,
    stream: TcpStream,
    bytes: Vec<u8>,
    /// The number of `bytes` that are known to have no end of a line.
    scanned: usize,
    kept: VecDeque<(Value, usize)>,
    kept_bytes: usize,
    calls: u64,
    /// Calls that were given up. Their answers may still come.
    given_up: BTreeSet<u64>,
    has_strays: bool,
}

impl Peer {
    /// Connects to `address`, for example `127.0.0.1:9095`.
    pub fn connect(address: &str, run: &Arc<Run>) -> Result<Self, String> {
        let mut last = format!("{address} is no address");
        for one in address.to_socket_addrs().map_err(|error| format!("{address}: {error}"))? {
            let opened = TcpStream::connect_timeout(&one, CONNECTING)
                .and_then(|stream| stream.set_nodelay(true).map(|()| stream))
                .and_then(|stream| stream.set_write_timeout(Some(run.patience)).map(|()| stream));
            match opened {
                Ok(stream) => {
                    return Ok(Self {
                        run: Arc::clone(run),
                        stream,
                        bytes: Vec::new(),
                        scanned: 0,
                        kept: VecDeque::new(),
                        kept_bytes: 0,
                        calls: 0,
                        given_up: BTreeSet::new(),
                        has_strays: false,
                    });
                }
                Err(error) => last = format!("no connection to {address}: {error}"),
            }
        }
        Err(last)
    }

    /// The server's address.
    pub fn address(&self) -> Result<String, String> {
        let address = self.stream.peer_addr();
        address.map(|address| address.to_string()).map_err(|error| format!("the connection has ended: {error}"))
    }

    /// Sends one frame and a newline.
    pub fn send(&mut self, frame: &Value) -> Result<(), String> {
        self.send_line(&frame.to_string())
    }

    /// Sends one line as it is.
    pub fn send_line(&mut self, line: &str) -> Result<(), String> {
        self.run.exchanged(Side::Client, line, "");
        self.stream.write_all(format!("{line}\n").as_bytes()).map_err(|error| format!("the server closed the connection: {error}"))
    }

    /// Calls a service and returns its answer; other frames are kept. An answer without an id, or with the id of no call, is
    /// the answer to this call.
    pub fn call(&mut self, service: &str, args: &Value) -> Result<Answer, String> {
        for _ in 0..if self.has_strays { 64 } else { 0 } {
            // A second answer without an id would be taken for the next one.
            let Ok(frame) = self.receive(Instant::now() + Duration::from_millis(2)) else { break };
            self.keep(frame);
        }
        self.calls += 1;
        let id = json!(format!("call-{}", self.calls));
        self.send(&json!({"op": "call_service", "service": service, "args": args, "id": id}))?;
        let patience = self.run.patience_for(service);
        let (mut until, mut instead) = (Instant::now() + patience, None);
        let frame = loop {
            let frame = match self.receive(until) {
                Ok(frame) => frame,
                Err(Trouble::Broken(why)) => return Err(why),
                Err(Trouble::Silence) => match instead.take() {
                    Some(frame) => break frame,
                    None => {
                        self.given_up.insert(self.calls);
                        self.run.was_silent(service);
                        return Err(format!("{service} gave no answer within {} s", patience.as_secs_f64()));
                    }
                },
            };
            if is_response_to(&frame, &id) {
                break frame;
            }
            let is_of = frame.get("service").is_none_or(|name| name == service);
            if frame.get("op").and_then(Value::as_str) != Some("service_response") || !is_of {
                self.keep(frame);
                continue;
            }
            let number = frame.get("id").and_then(Value::as_str).and_then(|id| id.strip_prefix("call-")?.parse().ok());
            match number.filter(|number| *number < self.calls) {
                Some(earlier) if self.given_up.remove(&earlier) => {}
                Some(_) => {
                    until = until.min(Instant::now() + GRACE);
                    instead = Some(frame.clone());
                    self.keep(frame);
                }
                None => {
                    self.has_strays = true;
                    break frame;
                }
            }
        };
        self.run.spoke(service);
        Ok(Answer {
            values: frame.get("values").cloned().unwrap_or_default(),
            result: frame.get("result").and_then(Value::as_bool).unwrap_or_default(),
            status: frame.get("status").and_then(Value::as_str).unwrap_or_default().to_owned(),
            frame,
            id,
        })
    }

    /// The first frame, kept or new, for which `is_it` is true. It is removed, and others are kept.
    pub fn find(&mut self, until: Instant, is_it: impl Fn(&Value) -> bool) -> Result<Value, Trouble> {
        if let Some(at) = self.kept.iter().position(|(frame, _)| is_it(frame)) {
            let (frame, bytes) = self.kept.remove(at).ok_or(Trouble::Silence)?;
            self.kept_bytes -= bytes;
            return Ok(frame);
        }
        loop {
            let frame = self.receive(until)?;
            if is_it(&frame) {
                return Ok(frame);
            }
            self.keep(frame);
        }
    }

    /// Drops the kept frames for which `is_it` holds.
    pub fn forget(&mut self, is_it: impl Fn(&Value) -> bool) {
        self.kept.retain(|(frame, _)| !is_it(frame));
        self.kept_bytes = self.kept.iter().map(|(_, bytes)| bytes).sum();
    }

    fn keep(&mut self, frame: Value) {
        let bytes = frame.to_string().len();
        self.kept_bytes += bytes;
        self.kept.push_back((frame, bytes));
        while self.kept.len() > KEPT || self.kept_bytes > KEPT_BYTES {
            let Some((_, bytes)) = self.kept.pop_front() else { break };
            self.kept_bytes -= bytes;
        }
    }

    /// The next frame.
    pub fn receive(&mut self, until: Instant) -> Result<Value, Trouble> {
        loop {
            let line = self.line(until)?;
            if line.trim().is_empty() {
                continue;
            }
            let frame = parse(&line).ok_or_else(|| Trouble::Broken(format!("a line is no JSON object: {}", beginning(&line))))?;
            self.run.exchanged(Side::Server, &line, frame.get("topic").and_then(Value::as_str).unwrap_or_default());
            return Ok(frame);
        }
    }

    /// The end of the connection, with the bytes before it.
    fn ended(&self, why: &str) -> Trouble {
        let rest = beginning(&String::from_utf8_lossy(&self.bytes));
        let behind = if rest.is_empty() { String::new() } else { format!(" after {rest}") };
        Trouble::Broken(format!("the server closed the connection{behind}{why}"))
    }

    /// The next line, without its end.
    fn line(&mut self, until: Instant) -> Result<String, Trouble> {
        let mut chunk = [0; 16 * 1024];
        loop {
            if self.bytes.starts_with(&TLS_ALERT) {
                return Err(Trouble::Broken("the server speaks TLS".to_owned()));
            }
            let new = self.bytes.get(self.scanned..).unwrap_or_default();
            if let Some(at) = new.iter().position(|byte| *byte == b'\n') {
                let rest = self.bytes.split_off(self.scanned + at + 1);
                let line = std::mem::replace(&mut self.bytes, rest);
                self.scanned = 0;
                return Ok(String::from_utf8_lossy(&line).into_owned());
            }
            self.scanned = self.bytes.len();
            if self.scanned > LONGEST_LINE {
                let shown = beginning(&String::from_utf8_lossy(&self.bytes));
                return Err(Trouble::Broken(format!("a line of more than {LONGEST_LINE} bytes: {shown}")));
            }
            if self.run.is_ending() {
                return Err(Trouble::Broken("the run was interrupted".to_owned()));
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(Trouble::Silence);
            }
            let slice = self.stream.set_read_timeout(Some(left.min(SLICE)));
            match slice.and_then(|()| self.stream.read(&mut chunk)) {
                Ok(0) => return Err(self.ended("")),
                Ok(read) => self.bytes.extend(chunk.iter().take(read)),
                Err(error) if matches!(error.kind(), ErrorKind::Interrupted | ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Err(error) => return Err(self.ended(&format!(": {error}"))),
            }
        }
    }
}

/// Whether `frame` is the response to the call with this id.
#[must_use]
pub fn is_response_to(frame: &Value, id: &Value) -> bool {
    frame.get("op").and_then(Value::as_str) == Some("service_response") && frame.get("id") == Some(id)
}

/// Whether a frame is a message on this topic.
#[must_use]
pub fn is_message(frame: &Value, topic: &str) -> bool {
    frame.get("op").and_then(Value::as_str) == Some("publish") && frame.get("topic").and_then(Value::as_str) == Some(topic)
}

/// The first characters of a text, on one line.
#[must_use]
pub fn beginning(text: &str) -> String {
    text.trim_end().chars().take(120).map(|one| if one.is_control() { ' ' } else { one }).collect()
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
