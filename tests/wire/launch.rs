//! How the program starts, refuses to start, and what it prints.

use std::io::{BufRead, BufReader, Read};
use std::net::TcpListener;
use std::process::{Child, Command, Output, Stdio};

use crate::common::{self, Client, Runtime, signal};
use serde_json::json;

/// The program with these arguments and variables, and no other variable of its own.
fn program(arguments: &[&str], variables: &[(&str, &str)]) -> Command {
    let mut command = common::program();
    command.args(arguments).envs(variables.iter().copied());
    command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

/// Runs it to its end, which must come by itself.
fn outcome(arguments: &[&str], variables: &[(&str, &str)]) -> Output {
    let mut child = program(arguments, variables).spawn().unwrap();
    common::end(&mut child);
    child.wait_with_output().unwrap()
}

/// A program that is serving, and the address that it has announced.
struct Serving {
    child: Child,
    stdout: BufReader<std::process::ChildStdout>,
    first_line: String,
}

impl Serving {
    fn start(arguments: &[&str], variables: &[(&str, &str)]) -> Self {
        let mut child = program(arguments, variables).spawn().unwrap();
        let mut stdout = BufReader::new(child.stdout.take().unwrap());
        let mut first_line = String::new();
        stdout.read_line(&mut first_line).unwrap();
        Self {
            child,
            stdout,
            first_line,
        }
    }

    fn connect(&self) -> Client {
        let address = self
            .first_line
            .trim_end()
            .strip_prefix("listening on ")
            .expect("the line");
        Client::to(address.parse().unwrap())
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn links(client: &mut Client) -> usize {
    let values = client.ask("/arm_sim/set_params", json!({}));
    values["lengths"].as_array().unwrap().len()
}

/// Nothing on standard output, one line on standard error that holds `parts` and no word of a panic.
fn assert_one_line(output: &Output, parts: &[&str]) {
    let stderr = String::from_utf8(output.stderr.clone()).unwrap();
    assert_eq!(output.stdout, b"", "{stderr}");
    assert_eq!(stderr.lines().count(), 1, "{stderr}");
    assert!(stderr.starts_with("pendularm: "), "{stderr}");
    assert!(
        stderr.ends_with('\n') && !stderr.contains("panic"),
        "{stderr}"
    );
    for part in parts {
        assert!(stderr.contains(part), "{part} is missing in {stderr}");
    }
}

#[test]
fn the_number_of_links_comes_from_the_environment_and_two_is_the_default() {
    let bind = ["--bind", "127.0.0.1:0"];
    let without = Serving::start(&bind, &[]);
    assert_eq!(links(&mut without.connect()), 2);
    for (value, expected) in [("", 2), ("2", 2), ("3", 3)] {
        let serving = Serving::start(&bind, &[("ARM_SIM_LINKS", value)]);
        assert_eq!(links(&mut serving.connect()), expected, "{value:?}");
    }
    let option = Serving::start(
        &["--bind", "127.0.0.1:0", "--links", "3"],
        &[("ARM_SIM_LINKS", "2")],
    );
    assert_eq!(links(&mut option.connect()), 3, "the option wins");
}

#[test]
fn a_port_in_use_is_told_in_one_line_with_status_1() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let output = outcome(&["--bind", &address], &[]);
    assert_eq!(output.status.code(), Some(1));
    assert_one_line(&output, &[&address]);
}

#[test]
fn help_and_version_go_to_standard_output_with_status_0() {
    let help = outcome(&["--help"], &[]);
    assert_eq!((help.status.code(), help.stderr), (Some(0), vec![]));
    let text = String::from_utf8(help.stdout).unwrap();
    for part in [
        "--links",
        "ARM_SIM_LINKS",
        "--bind",
        "ARM_SIM_BIND",
        "127.0.0.1:9095",
        "--version",
    ] {
        assert!(text.contains(part), "{part} is missing in {text}");
    }
    let version = outcome(&["--version"], &[("ARM_SIM_LINKS", "7")]);
    assert_eq!((version.status.code(), version.stderr), (Some(0), vec![]));
    let version = String::from_utf8(version.stdout).unwrap();
    let expected = format!("pendularm {} (", env!("PENDULARM_VERSION"));
    assert!(
        version.starts_with(&expected) && version.lines().count() == 1,
        "{version}"
    );
}

#[test]
fn standard_output_has_the_listening_line_and_nothing_else() {
    let mut serving = Serving::start(&["--bind", "127.0.0.1:0"], &[("ARM_SIM_LOG", "trace")]);
    let mut client = serving.connect();
    client.send_bytes(b"rubbish\n");
    client.status();
    client.settle();
    // Far beyond stability: the divergence is logged.
    client.ask("/arm_sim/set_params", json!({"gravity": 1e308}));
    client.settle();
    signal(serving.child.id(), "TERM");
    // Standard error has not been read so far: that must not keep it from ending.
    let (status, _) = common::end(&mut serving.child);
    assert_eq!(status.code(), Some(0));
    let mut rest = String::new();
    serving.stdout.read_to_string(&mut rest).unwrap();
    assert_eq!(rest, "");
    let port = serving.first_line.trim_end().rsplit(':').next().unwrap();
    assert!(port.parse::<u16>().unwrap() > 0, "{}", serving.first_line);
    assert_eq!(
        serving.first_line,
        format!("listening on 127.0.0.1:{port}\n")
    );
}

#[test]
fn it_can_be_served_on_another_loopback_address_only_where_asked() {
    let Ok(probe) = TcpListener::bind("[::1]:0") else {
        return; // This machine has no IPv6.
    };
    drop(probe);
    let serving = Serving::start(&["--bind", "[::1]:0"], &[]);
    assert!(
        serving.first_line.starts_with("listening on [::1]:"),
        "{}",
        serving.first_line
    );
    serving.connect().settle();
    // Bound to another than the default address it has no twin.
    let four = Runtime::start();
    let port = four.address.port();
    assert!(std::net::TcpStream::connect(format!("[::1]:{port}")).is_err());
}

#[test]
fn the_seed_option_repeats_the_targets_and_without_it_they_differ() {
    let target = |arguments: &[&str]| {
        let runtime = Runtime::with(arguments);
        let mut client = runtime.connect();
        client.subscribe("/ik_trial/status");
        client.ask("/ik_trial/start", json!({}));
        client.message("/ik_trial/status")["target"].clone()
    };
    let seeded = target(&["--seed", "42"]);
    assert_eq!(target(&["--seed", "42"]), seeded);
    assert_ne!(target(&["--seed", "43"]), seeded);
    assert_ne!(target(&[]), target(&[]));
}
