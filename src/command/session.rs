//! A connection to a running pendularm: rosbridge over TCP, one JSON object per line.
//!
//! **Invariant:** frames are read line by line, each of bounded length. A refusal ends the command with the runtime's
//! text.

use std::collections::BTreeMap;
use std::io;
use std::time::Duration;

use clap::Args;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::value::RawValue;
use serde_json::{Value, json};
use tokio::io::{AsyncBufReadExt as _, AsyncReadExt as _, AsyncWriteExt as _, BufReader};
use tokio::net::TcpStream;
use tokio::time::{Instant, timeout, timeout_at};

use super::output::{CommandError, Outcome, plain, print};
use super::values::{json_line, write_yaml};
use crate::address;
use crate::output::print_error;
use crate::protocol::catalog::rosapi::PREFIX;
use crate::protocol::names::{are_same, same_type};
use crate::protocol::op::token::Token;
use crate::protocol::wire::text::excerpt;
use crate::value::{ValueReader, needed, within};

/// Longest time for connecting, and then for the first answer, which the runtime gives at once.
const CONNECT: Duration = Duration::from_secs(5);
/// Without `--timeout`: longer than any command runs.
const NO_LIMIT: Duration = Duration::from_secs(100 * 365 * 24 * 60 * 60);

/// Longest frame that is read \[bytes\]. The runtime's longest answer is a trajectory of a million steps. Each has
/// three numbers of 25 bytes with their commas, 75 MB together.
const MAX_ANSWER: usize = 80 * 1024 * 1024;

/// The options that all commands have.
#[derive(Debug, Clone, PartialEq, Args)]
#[command(next_help_heading = "The runtime")]
pub struct RuntimeOptions {
    /// Print JSON, one object or value per line, instead of YAML
    #[arg(long, global = true)]
    json: bool,
    /// Address of the runtime: a port, a host, both, or a URL
    #[arg(long, global = true, value_name = "ADDRESS")]
    #[arg(default_value = "127.0.0.1:9095", value_parser = ValueReader(read_address))]
    connect: String,
    /// Longest wait for an answer or message, in seconds; by default no limit, but 5 s for connecting
    #[arg(long, global = true, value_name = "SECONDS", value_parser = ValueReader(read_positive))]
    timeout: Option<f64>,
    /// Token of the runtime; prefer the variable: other users can see options
    #[arg(long, global = true, value_name = "TOKEN", env = "ARM_SIM_TOKEN")]
    #[arg(value_parser = ValueReader(Token::read))]
    token: Option<Token>,
}

/// An address with a port. Its name is resolved later.
fn read_address(text: &str) -> Result<String, String> {
    let needs = "a port, a host, both or a URL without TLS, such as 9095, 127.0.0.1:9095 or ws://127.0.0.1:9095/";
    needed(address::read_url(text), needs, text)
}

/// A number from 1e-6 to 1e6.
pub(super) fn read_positive(text: &str) -> Result<f64, String> {
    within(&(1e-6..=1e6), "a number", text)
}

/// A connection.
pub(super) struct Session {
    stream: BufReader<TcpStream>,
    /// The beginning of an incomplete frame.
    line: Vec<u8>,
    calls: u64,
    /// Longest wait for an awaited frame.
    patience: Duration,
    /// Deadline of the next awaited frame.
    deadline: Instant,
    /// Deadline of the first frame; `None` once it has arrived.
    first_due: Option<Instant>,
    /// Whether JSON is printed.
    pub(super) is_json: bool,
}

/// The parts of a frame that commands need. Values stay as text, because a tree of them takes seventy times the memory.
#[derive(Debug, Deserialize)]
pub(super) struct Received {
    pub(super) op: String,
    id: Option<Box<RawValue>>,
    #[serde(default)]
    topic: String,
    #[serde(default)]
    level: String,
    msg: Option<Box<RawValue>>,
    pub(super) values: Option<Box<RawValue>>,
    #[serde(default)]
    pub(super) result: bool,
    /// A text, or the number of an action's status.
    pub(super) status: Option<Box<RawValue>>,
}

impl Received {
    /// The reason of a refusal: `status`, or a text in place of the values.
    pub(super) fn refusal(&self, name: &str) -> CommandError {
        let status: Option<String> = read_as(self.status.as_deref());
        let status = status.filter(|status| !status.is_empty());
        let why = status.or_else(|| read_as(self.values.as_deref()));
        CommandError::Refused(why.unwrap_or_else(|| format!("{name} failed without a reason")))
    }
}

pub(super) fn read_as<'a, T: Deserialize<'a>>(raw: Option<&'a RawValue>) -> Option<T> {
    serde_json::from_str(raw?.get()).ok()
}

/// The member of an object.
pub(super) fn member_of<'a>(object: &'a RawValue, name: &str) -> Option<&'a RawValue> {
    let members: BTreeMap<String, &RawValue> = read_as(Some(object))?;
    members.get(name).copied()
}

/// The member of an object, which must be of this type.
pub(super) fn read_member<T: DeserializeOwned>(object: &RawValue, name: &str) -> Outcome<T> {
    let value = member_of(object, name).map_or("null", RawValue::get);
    Ok(serde_json::from_str(value)?)
}

impl RuntimeOptions {
    /// Connects. The first frame has the token and marks a command, which may use a kept place.
    pub(super) async fn open(&self) -> Outcome<Session> {
        let patience = self.timeout.map_or(NO_LIMIT, Duration::from_secs_f64);
        let connecting = timeout(patience.min(CONNECT), TcpStream::connect(&self.connect));
        let stream = connecting.await.unwrap_or_else(|late| Err(late.into()));
        let stream = stream.map_err(|why| {
            CommandError::Lost(format!(
                "cannot connect to {}: {why}; start pendularm there, or name its address with --connect",
                self.connect
            ))
        })?;
        stream.set_nodelay(true).map_err(CommandError::lost)?;
        let mut session = Session {
            stream: BufReader::new(stream),
            line: Vec::new(),
            calls: 0,
            patience,
            deadline: Instant::now(),
            first_due: Some(Instant::now() + CONNECT),
            is_json: self.json,
        };
        let opening = match &self.token {
            Some(token) => json!({"op": "auth", "command": true, "token": token.reveal()}),
            None => json!({"op": "auth", "command": true}),
        };
        session.send(&opening).await?;
        Ok(session)
    }
}

impl Session {
    /// Sets the deadline of the next awaited frame to `--timeout` from now.
    pub(super) fn await_next(&mut self) {
        self.deadline = Instant::now() + self.patience;
    }

    /// Sends a frame, and sets the deadline of its answer.
    pub(super) async fn send(&mut self, frame: &Value) -> Outcome {
        self.await_next();
        let line = format!("{frame}\n");
        let written = timeout_at(self.deadline, self.stream.write_all(line.as_bytes())).await;
        if !matches!(written, Ok(Ok(()))) {
            // The runtime has closed the connection. Its reason can still be read.
            loop {
                self.receive().await?;
            }
        }
        Ok(())
    }

    /// The next frame that is not a status. An error status ends the command. A caller that stops waiting loses no
    /// bytes.
    pub(super) async fn receive(&mut self) -> Outcome<Received> {
        loop {
            // One more byte detects a longer frame.
            let room = (MAX_ANSWER + 1).saturating_sub(self.line.len());
            let mut bounded = (&mut self.stream).take(room as u64);
            let read = bounded.read_until(b'\n', &mut self.line);
            let due = self
                .first_due
                .map_or(self.deadline, |due| due.min(self.deadline));
            let Ok(read) = timeout_at(due, read).await else {
                if self.first_due.is_some() && (due < self.deadline || !self.line.is_empty()) {
                    self.know_server()?;
                    continue;
                }
                let seconds = self.patience.as_secs_f64();
                let why = format!("no answer or message within {seconds} s");
                return Err(CommandError::Lost(why));
            };
            read.map_err(CommandError::lost)?;
            if !self.line.is_empty() {
                self.know_server()?;
            }
            let line = std::mem::take(&mut self.line);
            if !line.ends_with(b"\n") {
                return Err(CommandError::lost(match line.len() {
                    0 => "the runtime closed it".to_owned(),
                    1..=MAX_ANSWER => "the runtime closed it within a frame".to_owned(),
                    _ => format!("a frame is longer than {MAX_ANSWER} bytes"),
                }));
            }
            let received: Received = serde_json::from_slice(&line)?;
            if received.op != "status" {
                return Ok(received);
            }
            let text: String = read_as(received.msg.as_deref()).unwrap_or_default();
            match received.level.as_str() {
                "error" => return Err(CommandError::Refused(text)),
                "warning" => print_error(&text),
                _ => {}
            }
        }
    }

    /// Checks the first bytes of the server: an object has begun.
    fn know_server(&mut self) -> Outcome {
        let Some(first) = self.first_due.take().map(|_| self.line.trim_ascii_start()) else {
            return Ok(());
        };
        let found = match first {
            [b'{', ..] => return Ok(()),
            [] if self.line.is_empty() => format!("it is silent for {} s", CONNECT.as_secs()),
            [0x15 | 0x16, 3, ..] => "it answers in TLS".to_owned(),
            other => format!(
                "it answers \"{}\"",
                excerpt(String::from_utf8_lossy(other).trim_end())
            ),
        };
        Err(CommandError::Lost(format!(
            "this is no rosbridge server: {found}; name the runtime's address with --connect"
        )))
    }

    /// Calls a service, and returns the values of its answer.
    pub(super) async fn call(&mut self, service: &str, args: &Value) -> Outcome<Box<RawValue>> {
        self.calls += 1;
        let id = self.calls;
        self.send(&json!({"op": "call_service", "id": id, "service": service, "args": args}))
            .await?;
        loop {
            let said = self.receive().await?;
            if said.op == "service_response" && read_as(said.id.as_deref()) == Some(id) {
                return match said.values {
                    Some(values) if said.result => Ok(values),
                    _ => Err(said.refusal(service)),
                };
            }
        }
    }

    /// One member of the answer of a service.
    pub(super) async fn ask<T: DeserializeOwned>(
        &mut self,
        service: &str,
        args: &Value,
        member: &str,
    ) -> Outcome<T> {
        read_member(&self.call(service, args).await?, member)
    }

    /// The type of a topic, service or action; empty if it is unknown. A given type must be the same.
    pub(super) async fn type_of(
        &mut self,
        kind: &str,
        name: &str,
        given: Option<&str>,
    ) -> Outcome<String> {
        let service = format!("{PREFIX}{kind}_type");
        let known: String = self.ask(&service, &json!({kind: name}), "type").await?;
        match given {
            Some(given) if known.is_empty() => Ok(given.to_owned()),
            Some(given) if !same_type(given, &known) => Err(CommandError::Refused(format!(
                "{name} is of type {known}, not {given}"
            ))),
            _ => Ok(known),
        }
    }

    /// The names of all topics, services, actions or nodes.
    pub(super) async fn names(&mut self, kind: &str) -> Outcome<Vec<String>> {
        let member = match kind {
            "action" => "action_servers".to_owned(),
            other => format!("{other}s"),
        };
        let service = format!("{PREFIX}{member}");
        self.ask(&service, &json!({}), &member).await
    }

    /// Refuses a name that the runtime does not list.
    pub(super) async fn find(&mut self, kind: &str, name: &str) -> Outcome {
        let names = self.names(kind).await?;
        match names.iter().any(|one| are_same(one, name)) {
            true => Ok(()),
            false => Err(CommandError::Refused(format!(
                "there is no {kind} {name}; `pendularm {kind} list` lists all"
            ))),
        }
    }

    /// Subscribes to a topic that exists or whose type is given.
    pub(super) async fn subscribe(&mut self, topic: &str, given: Option<&str>) -> Outcome {
        match given {
            Some(_) => drop(self.type_of("topic", topic, given).await?),
            None => self.find("topic", topic).await?,
        }
        // Without a type the messages have the form of ROS 2, also if the given type is one of ROS 1.
        self.send(&json!({"op": "subscribe", "topic": topic})).await
    }

    /// The next message of a subscribed topic.
    pub(super) async fn message(&mut self, topic: &str) -> Outcome<Box<RawValue>> {
        self.await_next();
        loop {
            let said = self.receive().await?;
            if let (true, Some(msg)) = (said.op == "publish" && said.topic == topic, said.msg) {
                return Ok(msg);
            }
        }
    }

    /// Prints an answer, in YAML with `end` after it: each of several answers ends with `---`.
    pub(super) fn show(&self, raw: &RawValue, end: &str) -> Outcome {
        match self.is_json {
            true => print(&(json_line(raw.get()) + "\n")),
            false => write_yaml(raw, end, io::stdout().lock()),
        }
    }

    /// Prints a line: the JSON, or the same as text.
    pub(super) fn show_line(&self, json: &Value, text: &str) -> Outcome {
        match self.is_json {
            true => print(&(json_line(&json.to_string()) + "\n")),
            false => print(&(plain(text) + "\n")),
        }
    }
}
