//! How the program starts, refuses to start, and what it prints.

use std::net::TcpListener;

use crate::command::Going;
use crate::common::{Client, Runtime, program};
use serde_json::json;

#[test]
fn the_version_goes_to_standard_output_with_status_0() {
    let mut version = program();
    version.arg("--version").env("ARM_SIM_LINKS", "7");
    let version = version.output().unwrap();
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
    let mut child = Going::of(program().args(["--bind", "127.0.0.1:0", "--log", "trace"]));
    let line = child.line();
    let address = line.trim_end().strip_prefix("listening on ").expect(&line);
    let mut client = Client::to(address.parse().unwrap());
    assert!(address.starts_with("127.0.0.1:"), "{line}");
    client.send_bytes(b"rubbish\n");
    client.status();
    // Far beyond stability: the divergence is logged.
    client.ask("/arm_sim/set_params", json!({"gravity": 1e308}));
    client.settle();
    child.terminate();
    // Standard error has not been read so far, and the program must still end.
    let (status, rest, _) = child.end();
    assert_eq!((status, &*rest), (Some(0), ""));
}

#[test]
fn it_is_served_on_another_loopback_address_only_on_request() {
    let Ok(probe) = TcpListener::bind("[::1]:0") else {
        return; // This machine has no IPv6.
    };
    drop(probe);
    let runtime = Runtime::with_bind("[::1]:0", &[]);
    assert!(runtime.address.is_ipv6(), "{}", runtime.address);
    runtime.connect().settle();
    // With another address than the default it does not also serve `[::1]`.
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
