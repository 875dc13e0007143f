//! How the program starts, refuses to start, and ends.

use std::io::{BufRead, BufReader, Read};
use std::net::TcpListener;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use crate::common::{self, Client, Runtime};
use serde_json::{Value, json};

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

    fn signal(&self, name: &str) {
        let status = Command::new("kill")
            .args([&format!("-{name}"), &self.child.id().to_string()])
            .status();
        assert!(status.unwrap().success());
    }

    /// Exit status and how long it took.
    fn end(&mut self) -> (Option<i32>, Duration) {
        let (status, took) = common::end(&mut self.child);
        (status.code(), took)
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
fn the_address_comes_from_the_environment_too() {
    let serving = Serving::start(&[], &[("ARM_SIM_BIND", "127.0.0.1:0")]);
    assert!(
        serving.first_line.starts_with("listening on 127.0.0.1:"),
        "{}",
        serving.first_line
    );
    serving.connect().settle();
}

#[test]
fn bad_usage_is_told_in_one_line_with_status_2() {
    type Case = (
        &'static [&'static str],
        &'static [(&'static str, &'static str)],
        &'static str,
    );
    let cases: [Case; 18] = [
        (&[], &[("ARM_SIM_LINKS", "1")], "ARM_SIM_LINKS"),
        (&[], &[("ARM_SIM_LINKS", "4")], "ARM_SIM_LINKS"),
        (&[], &[("ARM_SIM_LINKS", "two")], "ARM_SIM_LINKS"),
        (&[], &[("ARM_SIM_LINKS", " 2")], "ARM_SIM_LINKS"),
        (&[], &[("ARM_SIM_LINKS", "2.0")], "ARM_SIM_LINKS"),
        (&["--links", "4"], &[], "--links must be 2 or 3, got \"4\""),
        (&["--links", "5"], &[], "--links"),
        (&["--links"], &[], "--links"),
        (&["--what"], &[], "--what"),
        (&["serve"], &[], "\"serve\""),
        (&["--bind", "nowhere"], &[], "--bind"),
        (&["--bind", "0.0.0.0:0"], &[], "loopback"),
        (&["--bind", "192.168.1.1:9095"], &[], "loopback"),
        (&["--bind", "[::]:0"], &[], "loopback"),
        (&[], &[("ARM_SIM_BIND", "0.0.0.0:0")], "ARM_SIM_BIND"),
        (&[], &[("ARM_SIM_BIND", "nonsense")], "ARM_SIM_BIND"),
        (&[], &[("ARM_SIM_SEED", "nonsense")], "ARM_SIM_SEED"),
        (&[], &[("ARM_SIM_LOG", "nonsense")], "ARM_SIM_LOG"),
    ];
    for (arguments, variables, part) in cases {
        let output = outcome(arguments, variables);
        assert_eq!(output.status.code(), Some(2), "{arguments:?} {variables:?}");
        assert_one_line(&output, &[part]);
    }
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
    let expected = format!("pendularm {} (", env!("CARGO_PKG_VERSION"));
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
    serving.signal("TERM");
    // Standard error has not been read so far: that must not keep it from ending.
    assert_eq!(serving.end().0, Some(0));
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
fn a_signal_ends_it_within_a_second_with_status_0_clients_or_not() {
    for name in ["INT", "TERM"] {
        for clients in [0, 20] {
            let mut serving = Serving::start(&["--bind", "127.0.0.1:0"], &[]);
            let mut connected: Vec<Client> = (0..clients).map(|_| serving.connect()).collect();
            for client in &mut connected {
                client.subscribe("/joint_states");
            }
            serving.signal(name);
            let (status, took) = serving.end();
            assert_eq!(status, Some(0), "SIG{name}");
            // A second is promised; another is granted to a busy machine.
            assert!(took < Duration::from_secs(2), "{took:?} after SIG{name}");
            for mut client in connected {
                assert!(client.is_closed());
            }
        }
    }
}

#[test]
fn a_client_that_never_reads_does_not_hold_up_the_end() {
    let mut serving = Serving::start(&["--bind", "127.0.0.1:0"], &[]);
    let mut deaf = serving.connect();
    // An answer of tens of megabytes, which fills every buffer on the way once it has begun to come.
    let big =
        json!({"function": "t", "x0": 0, "dt": 1e-3, "steps": 1_000_000, "integrator": "euler"});
    deaf.send(&json!({"op": "call_service", "service": "/arm_sim/integration_step", "args": big}));
    deaf.stream().peek(&mut [0]).expect("an answer begins");
    for topic in ["/joint_states", "/clock", "/diagnostics"] {
        deaf.send(&json!({"op": "subscribe", "topic": topic}));
    }
    serving.signal("TERM");
    let (status, took) = serving.end();
    assert_eq!(status, Some(0));
    assert!(took < Duration::from_secs(2), "{took:?}");
}

#[test]
fn an_arm_that_lags_does_not_hold_up_the_end() {
    let mut serving = Serving::start(&["--bind", "127.0.0.1:0"], &[]);
    let mut client = serving.connect();
    client.ask("/arm_sim/set_integrator", json!({"timestep": 1e-12}));
    client.subscribe("/diagnostics");
    client.receive_where("a word of the delay", |frame| {
        let statuses = frame["msg"]["status"].as_array();
        statuses.is_some_and(|all| {
            all.iter()
                .any(|one| one["name"] == "arm_sim" && one["level"] != 0)
        })
    });
    serving.signal("TERM");
    let (status, took) = serving.end();
    assert_eq!(status, Some(0));
    assert!(took < Duration::from_secs(2), "{took:?}");
}

#[test]
fn every_pending_call_is_told_that_the_runtime_shuts_down() {
    let mut serving = Serving::start(&["--bind", "127.0.0.1:0"], &[]);
    // One that waits for a client to answer, and as many computations as a connection may have.
    let mut provider = serving.connect();
    provider.send(&json!({"op": "advertise_service", "service": "/slow"}));
    provider.status();
    let mut caller = serving.connect();
    caller.send(&json!({"op": "call_service", "service": "/slow", "id": "forwarded"}));
    provider.receive_where("call", |frame| frame["op"] == "call_service");
    // 4000 nodes, most of them dear: the first is far from done when the signal comes.
    let sum = vec!["tan(tan(tan(tan(tan(tan(tan(tan(t))))))))"; 400].join("+");
    let heavy =
        json!({"function": sum, "x0": 0, "dt": 1e-3, "steps": 100_000, "integrator": "rk4"});
    for id in 0..16 {
        caller.send(&json!({"op": "call_service", "service": "/arm_sim/integration_step", "id": id, "args": heavy}));
    }
    caller.settle();
    serving.signal("INT");
    let mut refused: Vec<Value> = Vec::new();
    while refused.len() < 17 {
        let response = caller.receive_where("response", |frame| frame["op"] == "service_response");
        assert_eq!(response["result"], false, "{response}");
        assert_eq!(response["values"], json!({}));
        assert!(
            response["status"]
                .as_str()
                .unwrap()
                .contains("shutting down"),
            "{response}"
        );
        refused.push(response["id"].clone());
    }
    for id in 0..16 {
        assert!(
            refused.contains(&json!(id)),
            "{id} is missing in {refused:?}"
        );
    }
    assert!(refused.contains(&json!("forwarded")));
    assert!(caller.is_closed());
    assert_eq!(serving.end().0, Some(0));
}
