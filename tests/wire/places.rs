//! Places: how many clients are served, which places are kept, and the message to a client without a free place.

use std::net::SocketAddr;
use std::process::Output;
use std::time::{Duration, Instant};

use serde_json::json;

use crate::common::{Client, Logged, PATIENCE, is_served_at_last, program, refusal_of};

fn serving(clients: &str) -> Logged {
    let mut command = program();
    command.args(["--clients", clients]);
    Logged::start(command, std::process::Stdio::null())
}

/// Clients over TCP: half of them silent, the others served.
fn occupy(address: SocketAddr, clients: usize) -> Vec<Client> {
    let mut all: Vec<Client> = (0..clients).map(|_| Client::to(address)).collect();
    for client in all.iter_mut().step_by(2) {
        client.settle();
    }
    all
}

/// The refusal of a client that calls a service, or of one that says nothing.
#[track_caller]
fn refused(address: SocketAddr, speaks: bool) -> String {
    let mut client = Client::to(address);
    if speaks {
        client.send(&json!({"op": "call_service", "service": "/arm_sim/pause"}));
    }
    refusal_of(&mut client)
}

#[cfg(feature = "cli")]
fn diagnostics(address: SocketAddr) -> Output {
    program()
        .args(["diagnostics", "--timeout", "30", "--connect"])
        .arg(address.to_string())
        .output()
        .unwrap()
}

#[cfg(all(feature = "web", feature = "cli"))]
#[test]
fn a_script_that_takes_all_places_leaves_the_reserved_one_to_pages_and_commands() {
    use crate::web_client::get;

    let mut runtime = serving("8");
    let address = runtime.address;
    let mut clients = occupy(address, 7);
    for speaks in [true, false, true] {
        let told = refused(address, speaks);
        assert!(
            told.contains("serves 8 clients at once and keeps 1") && told.contains("--clients"),
            "{told}"
        );
    }
    assert_eq!(get(address, "/").status, 200);
    let output = diagnostics(address);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let mut page = Client::web(address);
    page.settle();
    // Now the reserved place is taken too.
    let answer = get(address, "/");
    assert_eq!(answer.status, 503);
    assert_eq!(
        answer.header("content-type"),
        Some("text/plain; charset=utf-8")
    );
    assert!(
        answer.text().contains("serves 8 clients"),
        "{}",
        answer.text()
    );
    let output = diagnostics(address);
    let complaint = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{complaint}");
    assert!(complaint.contains("serves 8 clients"), "{complaint}");
    drop(page);
    let began = Instant::now();
    while get(address, "/").status != 200 {
        assert!(began.elapsed() < PATIENCE, "no place became free");
    }
    for client in &mut clients {
        client.settle();
    }
    clients.pop();
    assert!(is_served_at_last(address));
    let warning = runtime.await_line("no place is free");
    for part in [
        "places=8",
        "taken=7",
        "refused=1",
        "most_from=127.0.0.1",
        "held=7",
        "--clients",
    ] {
        assert!(warning.contains(part), "{warning}");
    }
    let log = runtime.end();
    let warnings = log.iter().filter(|line| line.contains("no place is free"));
    assert_eq!(warnings.count(), 1, "{log:#?}");
}

/// A client that has only stopped sending keeps its place for 15 s while its call waits.
#[cfg(target_os = "linux")]
#[test]
fn a_client_that_has_closed_its_socket_gets_no_answer() {
    let runtime = serving("3");
    let mut provider = Client::to(runtime.address);
    provider.send(&json!({"op": "advertise_service", "service": "/silent", "type": "a/b"}));
    provider.settle();
    let mut caller = Client::to(runtime.address);
    caller.send(&json!({"op": "call_service", "service": "/silent", "timeout": 60}));
    caller.settle();
    assert!(refused(runtime.address, true).contains("serves 3 clients"));
    drop(caller);
    let began = Instant::now();
    assert!(is_served_at_last(runtime.address));
    assert!(began.elapsed() < Duration::from_secs(10), "{began:?}");
}

/// A client that waits for one of the few permits of long frames is not read, so the end of its stream is not seen.
#[cfg(all(target_os = "linux", feature = "web"))]
#[test]
fn a_client_that_has_closed_its_socket_waits_for_no_permit_of_a_long_frame() {
    let begin = |mut client: Client, bytes: &[u8]| {
        client.settle();
        client.write(bytes).unwrap();
        client
    };
    let long = vec![b'a'; 1 << 20];
    let line = [br#"{"op":"publish","topic":"/long","msg":""#, &*long].concat();
    let mut message = Vec::new();
    pendularm_client::websocket::append(&mut message, 0x81, [0; 4], &line);
    message.pop();
    let over_tcp = |address| begin(Client::to(address), &line);
    let over_web = |address| begin(Client::web(address), &message);
    let ways: [&dyn Fn(SocketAddr) -> Client; 2] = [&over_tcp, &over_web];
    for wait in ways {
        let runtime = serving("8");
        // Each holds a permit for a minute.
        let _holders: Vec<Client> = (0..3).map(|_| over_tcp(runtime.address)).collect();
        let waiting: Vec<Client> = (3..7).map(|_| wait(runtime.address)).collect();
        assert!(refused(runtime.address, true).contains("serves 8 clients"));
        drop(waiting);
        assert!(is_served_at_last(runtime.address));
    }
}
