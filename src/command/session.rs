//! A connection to a running pendularm: rosbridge over TCP, one JSON object per line.
//!
//! **Invariant:** what comes is read line by line, each of bounded length, and every refusal ends the command with the
//! runtime's own words.

use std::collections::BTreeMap;
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::process;
use std::thread;
use std::time::{Duration, Instant};

use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::value::RawValue;
use serde_json::{Value, json};
use tokio::runtime::Builder;
use tokio::signal::unix::{SignalKind, signal};

use super::error::CommandError;
use super::output::hint;
use super::timed::TimedStream;
use crate::protocol::catalog::rosapi::PREFIX;
use crate::protocol::names::same_type;
use crate::protocol::op::token::Token;
use crate::protocol::outbox::MAX_TOPIC_BYTES;

/// How long each address of the host may take to accept the connection.
const CONNECT: Duration = Duration::from_secs(5);

/// Longest frame that is read \[bytes\]: the runtime's longest answer is a trajectory of a million steps, each of three
/// numbers of 25 bytes with their commas, 75 MB together.
const MAX_ANSWER: usize = 80 * 1024 * 1024;

/// A connection.
#[derive(Debug)]
pub(super) struct Session {
    lines: BufReader<TimedStream>,
    line: Vec<u8>,
    calls: u64,
    patience: Option<Duration>,
}

/// A frame of the runtime's, as far as a command needs it. The values in it are left as they are spelled: read into a
/// tree they would take seventy times their bytes.
#[derive(Debug, Deserialize)]
pub(super) struct Received {
    pub(super) op: String,
    id: Option<Box<RawValue>>,
    #[serde(default)]
    topic: String,
    #[serde(default)]
    level: String,
    pub(super) msg: Option<Box<RawValue>>,
    pub(super) values: Option<Box<RawValue>>,
    #[serde(default)]
    pub(super) result: bool,
    /// A text, or the number of an action's status.
    status: Option<Box<RawValue>>,
}

impl Received {
    /// Why it was refused: `status`, or a text in place of the values.
    pub(super) fn refusal(&self, name: &str) -> CommandError {
        let status: Option<String> = read_as(self.status.as_deref());
        let status = status.filter(|status| !status.is_empty());
        let why = status.or_else(|| read_as(self.values.as_deref()));
        CommandError::refused(&why.unwrap_or_else(|| format!("{name} failed, and said no more")))
    }

    /// The number of an action's status.
    pub(super) fn status_number(&self) -> Option<usize> {
        read_as(self.status.as_deref())
    }
}

fn read_as<T: DeserializeOwned>(raw: Option<&RawValue>) -> Option<T> {
    serde_json::from_str(raw?.get()).ok()
}

impl Session {
    /// Connects to `address`, and shows the token.
    pub(super) fn open(
        address: &str,
        token: Option<&Token>,
        patience: Option<Duration>,
    ) -> Result<Self, CommandError> {
        let stream = dial(address, patience).map_err(|why| CommandError::NoConnection {
            address: address.to_owned(),
            why,
        })?;
        let timed = TimedStream {
            stream,
            deadline: None,
        };
        let mut session = Self {
            lines: BufReader::new(timed),
            line: Vec::new(),
            calls: 0,
            patience,
        };
        if let Some(token) = token {
            session.send(&json!({"op": "auth", "token": token.reveal()}))?;
        }
        Ok(session)
    }

    /// Has what is awaited next come within `--timeout` from now on.
    pub(super) fn await_next(&mut self) {
        self.lines.get_mut().deadline = self.patience.map(|patience| Instant::now() + patience);
    }

    /// Sends a frame; what answers it is awaited from then on.
    pub(super) fn send(&mut self, frame: &Value) -> Result<(), CommandError> {
        self.await_next();
        let line = format!("{frame}\n");
        let sent = self.lines.get_mut().write_all(line.as_bytes());
        if sent.is_err() {
            // The runtime has closed; its reason is still to be read.
            loop {
                self.receive()?;
            }
        }
        Ok(())
    }

    /// The next frame that is no status. An error ends the command.
    pub(super) fn receive(&mut self) -> Result<Received, CommandError> {
        self.receive_within(MAX_ANSWER)
    }

    /// The same, of at most so many bytes.
    fn receive_within(&mut self, longest: usize) -> Result<Received, CommandError> {
        loop {
            let said = self.read(longest)?;
            if said.op != "status" {
                return Ok(said);
            }
            let msg = said.msg.as_ref().map_or("", |msg| msg.get());
            let text: String = serde_json::from_str(msg).unwrap_or_default();
            match said.level.as_str() {
                "error" => return Err(CommandError::refused(&text)),
                "warning" => hint(&text),
                _ => {}
            }
        }
    }

    fn read(&mut self, longest: usize) -> Result<Received, CommandError> {
        self.line.clear();
        // A byte more tells a frame that is longer.
        let mut bounded = (&mut self.lines).take(longest as u64 + 1);
        match bounded.read_until(b'\n', &mut self.line) {
            Ok(0) => Err(CommandError::Lost("the runtime closed it".to_owned())),
            Ok(length) if length > longest => Err(CommandError::Lost(format!(
                "a frame is longer than {longest} bytes"
            ))),
            Ok(_) => serde_json::from_slice(&self.line).map_err(|error| {
                let whole = self.line.ends_with(b"\n");
                let what = if whole {
                    "no frame came"
                } else {
                    "within a frame"
                };
                CommandError::Lost(format!("{what}: {error}"))
            }),
            Err(error) => Err(match (error.kind(), self.patience) {
                (ErrorKind::WouldBlock | ErrorKind::TimedOut, Some(patience)) => {
                    CommandError::Late(patience)
                }
                _ => CommandError::Lost(error.to_string()),
            }),
        }
    }

    /// Calls a service, and gives the values of its answer.
    pub(super) fn call(
        &mut self,
        service: &str,
        args: &Value,
    ) -> Result<Box<RawValue>, CommandError> {
        self.calls += 1;
        let id = self.calls;
        self.send(&json!({"op": "call_service", "id": id, "service": service, "args": args}))?;
        loop {
            let said = self.receive()?;
            if said.op == "service_response" && read_as(said.id.as_deref()) == Some(id) {
                return match said.values {
                    Some(values) if said.result => Ok(values),
                    _ => Err(said.refusal(service)),
                };
            }
        }
    }

    /// One member of what a question of rosapi is answered.
    pub(super) fn ask<T: DeserializeOwned>(
        &mut self,
        question: &str,
        args: &Value,
        member: &str,
    ) -> Result<T, CommandError> {
        let service = format!("{PREFIX}{question}");
        let values = self.call(&service, args)?;
        let values: BTreeMap<String, &RawValue> =
            serde_json::from_str(values.get()).unwrap_or_default();
        serde_json::from_str(values.get(member).map_or("null", |value| value.get()))
            .map_err(|error| CommandError::refused(&format!("{service} answered: {error}")))
    }

    /// The type of a topic or service, empty if the runtime knows none. A type that was given has to be the same.
    pub(super) fn type_of(
        &mut self,
        kind: &str,
        name: &str,
        given: Option<&str>,
    ) -> Result<String, CommandError> {
        let known: String = self.ask(&format!("{kind}_type"), &json!({kind: name}), "type")?;
        match given {
            Some(given) if !known.is_empty() && !same_type(given, &known) => Err(
                CommandError::refused(&format!("{name} is of type {known}, not {given}")),
            ),
            Some(given) if known.is_empty() => Ok(given.to_owned()),
            _ => Ok(known),
        }
    }

    /// Subscribes to a topic that is there, or whose type is given.
    pub(super) fn subscribe(
        &mut self,
        topic: &str,
        given: Option<&str>,
    ) -> Result<(), CommandError> {
        let type_name = self.type_of("topic", topic, given)?;
        let topics: Vec<String> = if type_name.is_empty() {
            self.ask("topics", &json!({}), "topics")?
        } else {
            vec![topic.to_owned()]
        };
        let same = |one: &String| one.trim_start_matches('/') == topic.trim_start_matches('/');
        if !topics.iter().any(same) {
            return Err(CommandError::refused(&format!(
                "{topic} is no topic yet; `pendularm topic list` has those that are, and a TYPE waits for one"
            )));
        }
        // Without a type the messages are as ROS 2 has them, also where the name that was given is one of ROS 1.
        self.send(&json!({"op": "subscribe", "topic": topic}))
    }

    /// The next message on a topic that was subscribed to.
    pub(super) fn message(&mut self, topic: &str) -> Result<Box<RawValue>, CommandError> {
        self.await_next();
        loop {
            let said = self.receive_within(MAX_TOPIC_BYTES)?;
            if let (true, Some(msg)) = (said.op == "publish" && said.topic == topic, said.msg) {
                return Ok(msg);
            }
        }
    }

    /// Another way to send, for [`on_signal`].
    pub(super) fn sender(&self) -> Result<TcpStream, CommandError> {
        let stream = self.lines.get_ref().stream.try_clone();
        stream.map_err(|why| CommandError::System {
            what: "the socket",
            why,
        })
    }
}

fn dial(address: &str, patience: Option<Duration>) -> io::Result<TcpStream> {
    let mut why = io::Error::new(ErrorKind::NotFound, "that name has no address");
    for one in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&one, patience.unwrap_or(CONNECT).min(CONNECT)) {
            Ok(stream) => {
                stream.set_nodelay(true)?;
                return Ok(stream);
            }
            Err(error) => why = error,
        }
    }
    Err(why)
}

/// Has SIGINT and SIGTERM do `first` from now on, and end the process with status 1 the second time.
pub(super) fn on_signal(first: impl FnOnce() + Send + 'static) -> Result<(), CommandError> {
    let heard = || {
        let runtime = Builder::new_current_thread().enable_all().build()?;
        let (mut interrupt, mut terminate) = {
            let _entered = runtime.enter();
            (
                signal(SignalKind::interrupt())?,
                signal(SignalKind::terminate())?,
            )
        };
        let mut wait = move || {
            runtime.block_on(async {
                tokio::select! {
                    _ = interrupt.recv() => {}
                    _ = terminate.recv() => {}
                }
            });
        };
        let hear = move || {
            wait();
            first();
            wait();
            process::exit(1);
        };
        thread::Builder::new().name("signals".into()).spawn(hear)?;
        Ok(())
    };
    heard().map_err(|why| CommandError::System {
        what: "signals",
        why,
    })
}

/// Has SIGINT and SIGTERM end the process, as the end of what has none by itself.
pub(super) fn end_on_signal() -> Result<(), CommandError> {
    on_signal(|| process::exit(0))
}
