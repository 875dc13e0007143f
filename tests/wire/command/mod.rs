//! The commands that contact a running arm: their output in YAML and in JSON, and their errors when the runtime
//! refuses. They end properly when no server listens, and when the server is hostile.

mod calls;
mod diagnostics;
mod ending;
mod hostile;
mod naive;
mod table;
mod topics;
mod yaml;

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Output, Stdio};
use std::thread::{self, JoinHandle};

use serde_json::Value;

use crate::common::{self, Runtime, signal};

/// The words of a command line; quoted ones are unchanged.
fn words(line: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut is_quoted = false;
    for one in line.chars() {
        match one {
            '\'' => is_quoted = !is_quoted,
            ' ' if !is_quoted => words.push(String::new()),
            _ => words.last_mut().unwrap().push(one),
        }
    }
    words
}

/// A command with the address of a runtime, ready to be started.
fn command(runtime: &Runtime, arguments: &[&str]) -> std::process::Command {
    let mut command = common::program();
    // After `--` there are no options.
    let (verb, rest) = arguments.split_at(arguments.len().min(2));
    command
        .args(verb)
        .args(["--connect", &runtime.address.to_string()])
        .args(["--timeout", &common::PATIENCE.as_secs().to_string()])
        .args(rest);
    command
}

/// The same for a command line.
fn command_line(runtime: &Runtime, line: &str) -> std::process::Command {
    let words = words(line);
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    command(runtime, &words)
}

fn ask(runtime: &Runtime, line: &str) -> Output {
    command_line(runtime, line).output().unwrap()
}

/// Standard output of a command that has to succeed.
#[track_caller]
fn said(runtime: &Runtime, line: &str) -> String {
    let output = ask(runtime, line);
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{line}: {complaint}");
    assert_eq!(complaint, "", "{line}");
    String::from_utf8(output.stdout).unwrap()
}

/// The same, in JSON.
#[track_caller]
fn json_of(runtime: &Runtime, line: &str) -> Value {
    let text = said(runtime, &format!("{line} --json"));
    assert_eq!(text.lines().count(), 1, "{text}");
    serde_json::from_str(&text).unwrap()
}

/// The error line of a command that must be refused with this exit status.
#[track_caller]
fn refusal(runtime: &Runtime, line: &str, status: i32) -> String {
    common::complaint(&ask(runtime, line), status)
}

/// A program that keeps running, and its output line by line.
pub struct Going(pub Child, pub BufReader<std::process::ChildStdout>);

impl Going {
    fn start(runtime: &Runtime, line: &str) -> Self {
        Self::of(&mut command_line(runtime, line))
    }

    pub fn of(program: &mut std::process::Command) -> Self {
        let mut child = program
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap());
        Self(child, lines)
    }

    pub fn line(&mut self) -> String {
        let mut line = String::new();
        self.1.read_line(&mut line).unwrap();
        line
    }

    fn interrupt(&self) {
        signal(self.0.id(), "INT");
    }

    /// Ends it. SIGINT is ignored if whoever started the tests ignores it.
    pub fn terminate(&self) {
        signal(self.0.id(), "TERM");
    }

    /// Exit status, the rest of standard output, and standard error. It has to end by itself within `common::PATIENCE`.
    #[track_caller]
    pub fn end(self) -> (Option<i32>, String, String) {
        fn all(mut from: impl Read + Send + 'static) -> JoinHandle<String> {
            thread::spawn(move || {
                let mut text = String::new();
                from.read_to_string(&mut text).unwrap();
                text
            })
        }
        let Self(mut child, lines) = self;
        let (rest, complaint) = (all(lines), all(child.stderr.take().unwrap()));
        let status = common::end(&mut child).0.code();
        (status, rest.join().unwrap(), complaint.join().unwrap())
    }
}
