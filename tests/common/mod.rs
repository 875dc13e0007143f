//! What the process-level tests share: the built program on a free port, and a client that speaks rosbridge over TCP.
//!
//! Every wait has a limit, generous because machines are noisy, and fails with what was awaited.

#![allow(
    dead_code,
    unreachable_pub,
    clippy::expect_used,
    clippy::indexing_slicing,
    clippy::needless_pass_by_value,
    clippy::panic,
    clippy::unwrap_used,
    reason = "each test file uses its own part of this, and a helper of a test fails by panicking"
)]
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// How long anything may take before a test gives up.
pub const PATIENCE: Duration = Duration::from_secs(20);

/// A call that shows in the arm's parameters, for whoever tries what must not be executed.
pub const SET_GRAVITY: &str =
    "{\"op\":\"call_service\",\"service\":\"/arm_sim/set_params\",\"args\":{\"gravity\":1}}\n";

/// The program, running; ended with the value.
pub struct Runtime {
    child: Child,
    pub address: SocketAddr,
}

impl Runtime {
    /// Starts the program with 2 links on a free port of the loopback interface.
    pub fn start() -> Self {
        Self::with(&[])
    }

    /// The same with `links` links.
    pub fn with_links(links: usize) -> Self {
        Self::with(&["--links", &links.to_string()])
    }

    /// The same with more arguments.
    pub fn with(arguments: &[&str]) -> Self {
        Self::with_bind("127.0.0.1:0", arguments)
    }

    /// The same at another address.
    pub fn with_bind(bind: &str, arguments: &[&str]) -> Self {
        let program = Command::new(env!("CARGO_BIN_EXE_pendularm"));
        Self::spawn(program, bind, arguments)
    }

    /// The same, started by a shell that has done `prelude` before: sets limits, say.
    pub fn under(prelude: &str) -> Self {
        let mut shell = Command::new("sh");
        let script = format!("{prelude} && exec \"$0\" \"$@\"");
        shell.args(["-c", &script, env!("CARGO_BIN_EXE_pendularm")]);
        Self::spawn(shell, "127.0.0.1:0", &[])
    }

    fn spawn(mut command: Command, bind: &str, arguments: &[&str]) -> Self {
        for variable in [
            "ARM_SIM_LINKS",
            "ARM_SIM_BIND",
            "ARM_SIM_SEED",
            "ARM_SIM_LOG",
            "ARM_SIM_TOKEN",
            "ARM_SIM_ALLOW_HOST",
            "ARM_SIM_ALLOW_ORIGIN",
            "ARM_SIM_STRICT_ORIGIN",
            "ARM_SIM_REPORT",
        ] {
            command.env_remove(variable);
        }
        let mut child = command
            .args(["--bind", bind])
            .args(arguments)
            .env("ARM_SIM_LOG", "off")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("stdout is piped"))
            .read_line(&mut line)
            .expect("the program says where it listens");
        let address = line
            .trim()
            .strip_prefix("listening on ")
            .and_then(|address| address.parse().ok())
            .unwrap_or_else(|| panic!("not an address: {line:?}"));
        Self { child, address }
    }

    pub fn connect(&self) -> Client {
        Client::to(self.address)
    }

    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// That [`SET_GRAVITY`], hidden in what was sent, was not executed.
    pub fn assert_nothing_was_executed(&self) {
        let parameters = self.connect().ask("/arm_sim/set_params", json!({}));
        assert_eq!(parameters["gravity"], 9.81);
    }

    /// The exit status, if the program ends within `limit`.
    pub fn wait(&mut self, limit: Duration) -> Option<std::process::ExitStatus> {
        let deadline = Instant::now() + limit;
        loop {
            if let Some(status) = self.child.try_wait().expect("the child can be asked") {
                return Some(status);
            }
            if Instant::now() > deadline {
                return None;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Runtime {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A client over raw TCP.
pub struct Client {
    stream: TcpStream,
    reader: BufReader<TcpStream>,
    calls: u64,
    /// Frames that came while another was awaited, oldest first.
    pub kept: Vec<Value>,
}

impl Client {
    pub fn to(address: SocketAddr) -> Self {
        let stream = TcpStream::connect(address).expect("the program accepts");
        stream.set_nodelay(true).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let reader = BufReader::new(stream.try_clone().unwrap());
        Self {
            stream,
            reader,
            calls: 0,
            kept: Vec::new(),
        }
    }

    pub fn stream(&self) -> &TcpStream {
        &self.stream
    }

    /// Sends a frame and a newline.
    pub fn send(&mut self, frame: &Value) {
        self.send_bytes(format!("{frame}\n").as_bytes());
    }

    /// Sends bytes as they are.
    pub fn send_bytes(&mut self, bytes: &[u8]) {
        self.stream
            .write_all(bytes)
            .expect("the program takes what is sent");
    }

    /// The next frame; panics at the end of the stream or when none comes.
    pub fn receive(&mut self) -> Value {
        let line = self.receive_line();
        serde_json::from_str(&line).unwrap_or_else(|error| panic!("{error} in {line:?}"))
    }

    /// The next frame as text, with its newline.
    pub fn receive_line(&mut self) -> String {
        let mut line = String::new();
        let read = self
            .reader
            .read_line(&mut line)
            .expect("a frame comes in time");
        assert!(
            read > 0 && line.ends_with('\n'),
            "the stream ended, with {line:?}"
        );
        line
    }

    /// True if the stream ends (or breaks) within the usual patience, whatever came before.
    pub fn is_closed(&mut self) -> bool {
        let mut rest = Vec::new();
        match self.reader.read_to_end(&mut rest) {
            Ok(_) => true,
            Err(error) => error.kind() == ErrorKind::ConnectionReset,
        }
    }

    /// The next frame for which `wanted` holds; the others are kept.
    pub fn receive_where(&mut self, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        let deadline = Instant::now() + PATIENCE;
        while Instant::now() < deadline {
            let frame = self.receive();
            if wanted(&frame) {
                return frame;
            }
            self.kept.push(frame);
        }
        panic!("no {what} came in time");
    }

    /// The next message on `topic`.
    pub fn message(&mut self, topic: &str) -> Value {
        let frame = self.receive_where(topic, |frame| {
            frame["op"] == "publish" && frame["topic"] == topic
        });
        frame["msg"].clone()
    }

    /// The next status.
    pub fn status(&mut self) -> Value {
        self.receive_where("status", |frame| frame["op"] == "status")
    }

    /// Calls a service and gives the whole response.
    pub fn call(&mut self, service: &str, args: Value) -> Value {
        self.calls += 1;
        let id = format!("call-{}", self.calls);
        self.send(&json!({"op": "call_service", "service": service, "args": args, "id": id}));
        self.receive_where(service, |frame| {
            frame["op"] == "service_response" && frame["id"] == id
        })
    }

    /// Calls a service that must succeed and gives its values.
    pub fn ask(&mut self, service: &str, args: Value) -> Value {
        let response = self.call(service, args);
        assert_eq!(response["result"], true, "{response}");
        assert_eq!(response["status"], "", "{response}");
        response["values"].clone()
    }

    /// Calls a service that must refuse and gives the reason.
    pub fn refusal(&mut self, service: &str, args: Value) -> String {
        let response = self.call(service, args);
        assert_eq!(response["result"], false, "{response}");
        response["status"]
            .as_str()
            .filter(|status| !status.is_empty())
            .expect("a reason")
            .to_owned()
    }

    /// Subscribes and waits for the confirmation.
    pub fn subscribe(&mut self, topic: &str) {
        self.send(&json!({"op": "subscribe", "topic": topic}));
        let status = self.status();
        assert_eq!(status["level"], "info", "{status}");
    }

    /// Waits until the runtime has handled all that was sent: a call is answered in order.
    pub fn settle(&mut self) {
        self.ask("/arm_sim/set_params", json!({}));
    }

    /// What comes within `time`, without waiting longer.
    pub fn receive_for(&mut self, time: Duration) -> Vec<Value> {
        let deadline = Instant::now() + time;
        let mut frames = Vec::new();
        let mut line = Vec::new();
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                break;
            }
            self.stream.set_read_timeout(Some(left)).unwrap();
            match self.reader.read_until(b'\n', &mut line) {
                Ok(0) => break,
                Ok(_) if line.ends_with(b"\n") => {
                    frames.push(serde_json::from_slice(&line).expect("a frame is JSON"));
                    line.clear();
                }
                Ok(_) => {}
                Err(error)
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Err(error) => panic!("{error}"),
            }
        }
        assert!(
            line.is_empty(),
            "a frame was cut off by the deadline: ask for a little longer"
        );
        self.stream.set_read_timeout(Some(PATIENCE)).unwrap();
        frames
    }
}
