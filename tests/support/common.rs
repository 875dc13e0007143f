//! Parts that the process-level tests share: the built program on a free port, and the client that is connected to it.

use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use pendularm_client::ending;

pub use pendularm_client::blocking::{Client, PATIENCE};
use serde_json::json;

/// The variables of the environment that the program reads.
pub const VARIABLES: [&str; 13] = [
    "ARM_SIM_LINKS",
    "ARM_SIM_BIND",
    "ARM_SIM_CLIENTS",
    "ARM_SIM_SEED",
    "ARM_SIM_LOG",
    "ARM_SIM_LOG_FORMAT",
    "ARM_SIM_TOKEN",
    "ARM_SIM_RECORD",
    "ARM_SIM_RECORD_DIR",
    "ARM_SIM_ALLOW_HOST",
    "ARM_SIM_ALLOW_ORIGIN",
    "ARM_SIM_STRICT_ORIGIN",
    "ARM_SIM_REPORT",
];

/// The program, without variables of the environment that could change its behaviour.
pub fn program() -> Command {
    without_variables(Command::new(env!("CARGO_BIN_EXE_pendularm")))
}

/// The program with these arguments, to its end.
pub fn run(arguments: &[&str]) -> Output {
    program().args(arguments).output().unwrap()
}

pub fn without_variables(mut command: Command) -> Command {
    for variable in VARIABLES {
        command.env_remove(variable);
    }
    command
}

/// The program, started by a shell that first runs `prelude`, for example to set limits.
pub fn shell(prelude: &str) -> Command {
    let mut shell = Command::new("sh");
    let script = format!("{prelude} && exec \"$0\" \"$@\"");
    shell.args(["-c", &script, env!("CARGO_BIN_EXE_pendularm")]);
    without_variables(shell)
}

/// The one error line of a command that failed with this exit status and printed nothing else.
#[track_caller]
pub fn complaint(output: &Output, status: i32) -> String {
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(status), "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(output.stdout.is_empty());
    let complaint = said.trim_end().strip_prefix("pendularm: ");
    complaint.expect(&said).to_owned()
}

/// Sends a signal, by its name.
#[track_caller]
pub fn signal(pid: u32, name: &str) {
    let mut kill = Command::new("kill");
    let status = kill.args([format!("-{name}"), pid.to_string()]).status();
    assert!(status.expect("kill is there").success());
}

/// Has the client provide a service.
#[track_caller]
pub fn provide(client: &mut Client, service: &str) {
    client.send(&json!({"op": "advertise_service", "service": service, "type": "x/Y", "id": "ad"}));
    let status = client.status();
    assert_eq!(status["level"], "info", "{status}");
    assert_eq!(status["id"], "ad");
}

/// The message to a client beyond the limit, before its end.
#[track_caller]
pub fn refusal_of(client: &mut Client) -> String {
    let status = client.receive();
    assert_eq!(status["level"], "error", "{status}");
    assert!(client.is_closed());
    status["msg"].as_str().unwrap().to_owned()
}

/// Whether a new client has a place after the end of another.
pub fn is_served_at_last(address: SocketAddr) -> bool {
    let began = Instant::now();
    while began.elapsed() < PATIENCE {
        let mut next = Client::to(address);
        next.send(&json!({"op": "call_service", "service": "/arm_sim/pause"}));
        if next.receive()["op"] == "service_response" {
            return true;
        }
    }
    false
}

/// The exit status of a process that must end by itself, and the elapsed time.
#[track_caller]
pub fn end(child: &mut Child) -> (ExitStatus, Duration) {
    let ended = ending::wait(child, PATIENCE).expect("the child can be asked");
    if ended.is_none() {
        let _ = child.kill();
    }
    ended.expect("it ends")
}

/// The running program. Dropping it ends the process.
pub struct Runtime {
    child: Child,
    pub address: SocketAddr,
}

/// A process or thread as its file `stat` below `/proc` describes it: its name, and the fields behind that, the first of
/// which `man 5 proc` counts as the third.
pub fn stat(file: impl AsRef<Path>) -> (String, Vec<String>) {
    let text = std::fs::read_to_string(file).unwrap();
    let (name, fields) = text.rsplit_once(") ").unwrap();
    let name = name.split_once('(').unwrap().1;
    (
        name.to_owned(),
        fields.split_whitespace().map(str::to_owned).collect(),
    )
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
        Self::spawn(program(), bind, arguments)
    }

    /// The same, started by a [`shell`].
    pub fn under(prelude: &str) -> Self {
        Self::under_with(prelude, &[])
    }

    /// The same with more arguments.
    pub fn under_with(prelude: &str, arguments: &[&str]) -> Self {
        Self::spawn(shell(prelude), "127.0.0.1:0", arguments)
    }

    /// The same without ignored signals, because a shell ignores some for its background jobs.
    pub fn hearing_all(arguments: &[&str]) -> Self {
        let mut env = Command::new("env");
        env.args(["--default-signal", env!("CARGO_BIN_EXE_pendularm")]);
        Self::spawn(without_variables(env), "127.0.0.1:0", arguments)
    }

    /// The same, of a command with variables of its own.
    pub fn spawn(mut command: Command, bind: &str, arguments: &[&str]) -> Self {
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

    /// Ends the program in order.
    #[track_caller]
    pub fn stop(mut self) {
        signal(self.pid(), "TERM");
        assert!(self.end().0.success());
    }

    /// As [`end`], for the program.
    pub fn end(&mut self) -> (ExitStatus, Duration) {
        end(&mut self.child)
    }
}

impl Drop for Runtime {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The program with another standard output, and its log read to the end.
pub struct Logged {
    child: Child,
    pub address: SocketAddr,
    lines: mpsc::Receiver<String>,
    /// The lines that have been read.
    log: Vec<String>,
}

impl Logged {
    pub fn start(command: Command, stdout: impl Into<Stdio>) -> Self {
        Self::at("info", command, stdout)
    }

    /// The same with another level of the log.
    pub fn at(level: &str, mut command: Command, stdout: impl Into<Stdio>) -> Self {
        let mut child = command
            .args(["--bind", "127.0.0.1:0", "--log", level])
            .stdin(Stdio::null())
            .stdout(stdout)
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let stderr = BufReader::new(child.stderr.take().unwrap());
        let (line_came, lines) = mpsc::channel();
        std::thread::spawn(move || {
            for line in stderr.split(b'\n') {
                let line = String::from_utf8(line.unwrap()).expect("the log is text");
                // The receiver of a failed test is gone.
                let _ = line_came.send(line);
            }
        });
        let mut started = Self {
            child,
            address: SocketAddr::from(([127, 0, 0, 1], 0)),
            lines,
            log: Vec::new(),
        };
        let line = started.await_line("serving rosbridge clients");
        let port = line.split_once("127.0.0.1:").unwrap().1;
        let digits: String = port.chars().take_while(char::is_ascii_digit).collect();
        started.address.set_port(digits.parse().unwrap());
        started
    }

    /// The line of the log with this text, which may have come already.
    pub fn await_line(&mut self, text: &str) -> String {
        loop {
            if let Some(line) = self.log.iter().find(|line| line.contains(text)) {
                return line.clone();
            }
            self.log
                .push(self.lines.recv_timeout(PATIENCE).expect(text));
        }
    }

    /// Ends the program in order; its whole log.
    pub fn end(mut self) -> Vec<String> {
        signal(self.child.id(), "TERM");
        assert!(end(&mut self.child).0.success());
        self.log.extend(self.lines.iter());
        std::mem::take(&mut self.log)
    }
}

impl Drop for Logged {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
