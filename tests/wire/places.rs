//! Places of real sockets: the warning of the log, and places of clients that have closed. `tests/actors/exchanges/places.txt` has the
//! others.

use std::net::{Shutdown, SocketAddr};
use std::time::{Duration, Instant};

use serde_json::json;

use crate::common::{Client, Logged, is_served_at_last, program, refusal_of};

fn serving(clients: &str) -> Logged {
    let mut command = program();
    command.args(["--clients", clients]);
    Logged::start(command, std::process::Stdio::null())
}

/// The refusal of a client that calls a service.
#[track_caller]
fn refused(address: SocketAddr) -> String {
    let mut client = Client::to(address);
    client.send(&json!({"op": "call_service", "service": "/arm_sim/pause"}));
    refusal_of(&mut client)
}

#[test]
fn the_log_warns_once_about_refused_clients_and_names_the_option() {
    let mut runtime = serving("8");
    let _clients: Vec<Client> = (0..7).map(|_| Client::to(runtime.address)).collect();
    for _ in 0..3 {
        assert!(refused(runtime.address).contains("--clients"));
    }
    let warning = runtime.await_line("no place is free");
    let parts = "places=8 taken=7 refused=1 most_from=127.0.0.1 held=7 --clients";
    for part in parts.split(' ') {
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
    caller.stream().shutdown(Shutdown::Write).unwrap();
    // Its socket is checked several times: it may still read.
    std::thread::sleep(Duration::from_secs(1));
    assert!(refused(runtime.address).contains("serves 3 clients"));
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
        // Each holds a permit for five seconds.
        let _holders: Vec<Client> = (0..3).map(|_| over_tcp(runtime.address)).collect();
        let waiting: Vec<Client> = (3..7).map(|_| wait(runtime.address)).collect();
        assert!(refused(runtime.address).contains("serves 8 clients"));
        drop(waiting);
        assert!(is_served_at_last(runtime.address));
    }
}
