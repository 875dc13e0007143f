//! A connection to a running pendularm: rosbridge over TCP, one JSON object per line.
//!
//! **Invariant:** frames are read line by line, each of bounded length. A refusal ends the command with the runtime's
//! text.

use std::collections::BTreeMap;
use std::io::{self, ErrorKind};
use std::net::ToSocketAddrs as _;
use std::time::Duration;

use clap::Args;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::value::RawValue;
use serde_json::{Value, json};
use tokio::io::{AsyncBufReadExt as _, AsyncReadExt as _, AsyncWriteExt as _, BufReader};
use tokio::net::TcpStream;
use tokio::time::{Instant, timeout_at};

use super::output::{CommandError, plain, print};
use super::yaml::{json_line, write_yaml};
use crate::address;
use crate::output::print_error;
use crate::protocol::catalog::rosapi::PREFIX;
use crate::protocol::names::{are_same, same_type};
use crate::protocol::op::token::Token;
use crate::protocol::outbox::MAX_MESSAGE;
use crate::value::{ValueReader, needed, within};

/// Longest time for each address of the host to accept the connection.
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
    #[arg(
        long,
        global = true,
        value_name = "ADDRESS",
        default_value = "127.0.0.1:9095"
    )]
    #[arg(value_parser = ValueReader(read_address))]
    connect: String,
    /// Longest wait for an answer or message, in seconds; without it only connecting has a limit, 5 s
    #[arg(long, global = true, value_name = "SECONDS", value_parser = ValueReader(read_positive))]
    timeout: Option<f64>,
    /// The runtime's token; safer in the variable, since users can see options
    #[arg(long, global = true, value_name = "TOKEN", env = "ARM_SIM_TOKEN")]
    #[arg(value_parser = ValueReader(|text| Token::new(text).map_err(|why| why.to_string())))]
    token: Option<Token>,
}

/// An address with a port. Its name is resolved later.
fn read_address(text: &str) -> Result<String, String> {
    let needs = "a port, a host, both or a URL without TLS, such as 9095, 127.0.0.1:9095 or ws://127.0.0.1:9095/";
    needed(address::read(text), needs, text)
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
    patience: Option<Duration>,
    /// Deadline of the next awaited frame.
    deadline: Instant,
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
    status: Option<Box<RawValue>>,
}

impl Received {
    /// The reason of a refusal: `status`, or a text in place of the values.
    pub(super) fn refusal(&self, name: &str) -> CommandError {
        let status: Option<String> = read_as(self.status.as_deref());
        let status = status.filter(|status| !status.is_empty());
        let why = status.or_else(|| read_as(self.values.as_deref()));
        CommandError::refused(&why.unwrap_or_else(|| format!("{name} failed without a reason")))
    }

    /// The number of an action's status.
    pub(super) fn status_number(&self) -> Option<usize> {
        read_as(self.status.as_deref())
    }
}

fn read_as<T: DeserializeOwned>(raw: Option<&RawValue>) -> Option<T> {
    serde_json::from_str(raw?.get()).ok()
}

impl RuntimeOptions {
    /// Connects. The first frame has the token and marks a command, which may use a kept place.
    pub(super) async fn open(&self) -> Result<Session, CommandError> {
        let patience = self.timeout.map(Duration::from_secs_f64);
        let stream = dial(&self.connect, patience.unwrap_or(CONNECT).min(CONNECT))
            .await
            .map_err(|why| CommandError::NoConnection(self.connect.clone(), why))?;
        let mut session = Session {
            stream: BufReader::new(stream),
            line: Vec::new(),
            calls: 0,
            patience,
            deadline: Instant::now(),
            is_json: self.json,
        };
        let mut opening = json!({"op": "auth", "command": true});
        if let (Some(token), Some(members)) = (&self.token, opening.as_object_mut()) {
            members.insert("token".to_owned(), token.reveal().into());
        }
        session.send(&opening).await?;
        Ok(session)
    }
}

async fn dial(address: &str, patience: Duration) -> io::Result<TcpStream> {
    let mut why = io::Error::new(ErrorKind::NotFound, "that name has no address");
    for one in address.to_socket_addrs()? {
        match in_time(Instant::now() + patience, TcpStream::connect(one)).await {
            Ok(stream) => return stream.set_nodelay(true).map(|()| stream),
            Err(error) => why = error,
        }
    }
    Err(why)
}

/// Runs `work` until the deadline.
async fn in_time<T>(deadline: Instant, work: impl Future<Output = io::Result<T>>) -> io::Result<T> {
    let outcome = timeout_at(deadline, work).await;
    outcome.unwrap_or_else(|_| Err(ErrorKind::TimedOut.into()))
}

impl Session {
    /// Sets the deadline of the next awaited frame to `--timeout` from now.
    pub(super) fn await_next(&mut self) {
        self.deadline = Instant::now() + self.patience.unwrap_or(NO_LIMIT);
    }

    /// Sends a frame, and sets the deadline of its answer.
    pub(super) async fn send(&mut self, frame: &Value) -> Result<(), CommandError> {
        self.await_next();
        let line = format!("{frame}\n");
        if in_time(self.deadline, self.stream.write_all(line.as_bytes()))
            .await
            .is_err()
        {
            // The runtime has closed the connection. Its reason can still be read.
            loop {
                self.receive().await?;
            }
        }
        Ok(())
    }

    pub(super) async fn receive(&mut self) -> Result<Received, CommandError> {
        self.receive_within(MAX_ANSWER).await
    }

    /// The next frame that is not a status, of at most `longest` bytes. An error status ends the command. A caller
    /// that stops waiting loses no bytes.
    async fn receive_within(&mut self, longest: usize) -> Result<Received, CommandError> {
        loop {
            // One more byte detects a longer frame.
            let room = (longest + 1).saturating_sub(self.line.len());
            let mut bounded = (&mut self.stream).take(room as u64);
            let read = in_time(self.deadline, bounded.read_until(b'\n', &mut self.line)).await;
            let received = match (read, self.patience) {
                (Ok(_), _) => frame(&std::mem::take(&mut self.line), longest)?,
                (Err(error), Some(patience)) if error.kind() == ErrorKind::TimedOut => {
                    return Err(CommandError::Late(patience));
                }
                (Err(error), _) => return Err(CommandError::Lost(error.to_string())),
            };
            if received.op != "status" {
                return Ok(received);
            }
            let text: String = read_as(received.msg.as_deref()).unwrap_or_default();
            match received.level.as_str() {
                "error" => return Err(CommandError::refused(&text)),
                "warning" => print_error(&text),
                _ => {}
            }
        }
    }

    /// Calls a service, and returns the values of its answer.
    pub(super) async fn call(
        &mut self,
        service: &str,
        args: &Value,
    ) -> Result<Box<RawValue>, CommandError> {
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

    /// One member of the answer of a rosapi service.
    pub(super) async fn ask<T: DeserializeOwned>(
        &mut self,
        question: &str,
        args: &Value,
        member: &str,
    ) -> Result<T, CommandError> {
        let service = format!("{PREFIX}{question}");
        let values = self.call(&service, args).await?;
        let values: BTreeMap<String, &RawValue> =
            serde_json::from_str(values.get()).unwrap_or_default();
        serde_json::from_str(values.get(member).map_or("null", |value| value.get()))
            .map_err(|error| CommandError::refused(&format!("{service} answered: {error}")))
    }

    /// The type of a topic, service or action; empty if it is unknown. A given type must be the same.
    pub(super) async fn type_of(
        &mut self,
        kind: &str,
        name: &str,
        given: Option<&str>,
    ) -> Result<String, CommandError> {
        let known: String = self
            .ask(&format!("{kind}_type"), &json!({kind: name}), "type")
            .await?;
        match given {
            Some(given) if known.is_empty() => Ok(given.to_owned()),
            Some(given) if !same_type(given, &known) => Err(CommandError::refused(&format!(
                "{name} is of type {known}, not {given}"
            ))),
            _ => Ok(known),
        }
    }

    /// Subscribes to a topic that exists or whose type is given.
    pub(super) async fn subscribe(
        &mut self,
        topic: &str,
        given: Option<&str>,
    ) -> Result<(), CommandError> {
        let type_name = self.type_of("topic", topic, given).await?;
        let topics: Vec<String> = match type_name.is_empty() {
            true => self.ask("topics", &json!({}), "topics").await?,
            false => vec![topic.to_owned()],
        };
        if !topics.iter().any(|one| are_same(one, topic)) {
            return Err(CommandError::refused(&format!(
                "there is no topic {topic} yet; `pendularm topic list` lists all, and with a TYPE the command waits"
            )));
        }
        // Without a type the messages have the form of ROS 2, also if the given type is one of ROS 1.
        self.send(&json!({"op": "subscribe", "topic": topic})).await
    }

    /// The next message of a subscribed topic.
    pub(super) async fn message(&mut self, topic: &str) -> Result<Box<RawValue>, CommandError> {
        self.await_next();
        loop {
            let said = self.receive_within(MAX_MESSAGE).await?;
            if let (true, Some(msg)) = (said.op == "publish" && said.topic == topic, said.msg) {
                return Ok(msg);
            }
        }
    }

    /// Prints an answer, in YAML with `end` after it: each of several answers ends with `---`.
    pub(super) fn show(&self, raw: &RawValue, end: &str) -> Result<(), CommandError> {
        match self.is_json {
            true => print(&json_line(raw)),
            false => write_yaml(raw, end, io::stdout().lock()),
        }
    }

    /// Prints a line for each entry of a list: the object, or the same as text.
    pub(super) fn show_list(&self, entries: &[(Value, String)]) -> Result<(), CommandError> {
        let line = |(object, text): &(Value, String)| match self.is_json {
            true => format!("{object}\n"),
            false => plain(text) + "\n",
        };
        print(&entries.iter().map(line).collect::<String>())
    }
}

/// Reads a line of at most `longest` bytes.
fn frame(line: &[u8], longest: usize) -> Result<Received, CommandError> {
    let lost = |why: String| Err(CommandError::Lost(why));
    match (line.len(), serde_json::from_slice(line)) {
        (0, _) => lost("the runtime closed it".to_owned()),
        (length, _) if length > longest => lost(format!("a frame is longer than {longest} bytes")),
        (_, Err(error)) if line.ends_with(b"\n") => lost(format!("cannot read a frame: {error}")),
        (_, Err(error)) => lost(format!("within a frame: {error}")),
        (_, Ok(received)) => Ok(received),
    }
}
