//! The program itself: its end, and the output with the reason.

use std::process::{Command, Stdio};

use crate::common;

/// The program itself with these arguments.
fn program(arguments: &[&str]) -> Command {
    let mut command = common::program();
    command.args(arguments).stdin(Stdio::null());
    command
}

/// A listener of this test uses the address.
#[test]
fn as_json_the_reason_for_not_starting_is_an_object_too() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let output = program(&["--bind", &address, "--log-format", "json"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    let log = String::from_utf8(output.stderr).unwrap();
    let last: serde_json::Value = serde_json::from_str(log.lines().last().unwrap()).unwrap();
    assert_eq!(last["level"], "ERROR");
    assert!(
        last["message"].as_str().unwrap().contains(&address),
        "{log}"
    );
}

/// Every write to `/dev/full` fails.
#[cfg(target_os = "linux")]
fn full() -> Stdio {
    let full = std::fs::File::options().write(true).open("/dev/full");
    Stdio::from(full.unwrap())
}

#[cfg(target_os = "linux")]
#[test]
fn output_that_is_lost_is_a_failure() {
    let runtime = common::Runtime::start();
    let address = runtime.address.to_string();
    for arguments in [
        &["--help"][..],
        &["--version"],
        &["plan", "--error", "0.1", "--duration", "0.1"],
        #[cfg(feature = "cli")]
        &["completions", "bash"],
        #[cfg(feature = "cli")]
        &["topic", "list", "--connect", &address],
    ] {
        let output = program(arguments).stdout(full()).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {said}");
        assert!(said.starts_with("pendularm: standard output: "), "{said}");
        assert_eq!(said.lines().count(), 1, "{said}");
    }
}

#[test]
fn a_closed_pipe_is_no_failure() {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let output = program(&["--help"]).stdout(writer).output().unwrap();
    assert_eq!((output.status.code(), output.stderr), (Some(0), vec![]));
}

#[cfg(target_os = "linux")]
#[test]
fn an_error_message_that_is_not_read_changes_no_exit_status() {
    let status = |arguments: &[&str]| {
        let mut program = program(arguments);
        program.stdout(full()).stderr(full());
        program.status().unwrap().code()
    };
    assert_eq!(status(&["--help"]), Some(1));
    assert_eq!(status(&["--links", "4"]), Some(2));
}
