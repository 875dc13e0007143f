//! SIGINT and SIGTERM end the program within a second, and what waits is answered.
//!
//! **Invariant:** nothing that a client does keeps the program from ending, with exit status 0.

use std::io::Write;
use std::time::Duration;

use crate::arm::ticks;
use crate::common::{Client, Runtime, provide, signal};
use crate::diagnostics::status;
use pendularm::protocol::op::GoalStatus;
use serde_json::{Value, json};

/// README's second, and one more for a machine that is busy with other tests.
const LIMIT: Duration = Duration::from_secs(2);

/// Sends the signal; the program must end in time, with status 0.
fn ends_on(runtime: &mut Runtime, name: &str) {
    signal(runtime.pid(), name);
    let (status, took) = runtime.end();
    assert!(status.success(), "{status}");
    assert!(took < LIMIT, "it took {took:?}");
}

/// All frames up to the end of the stream, however it ends.
fn rest(client: &mut Client) -> Vec<Value> {
    let mut bytes = Vec::new();
    let _ = std::io::Read::read_to_end(&mut client.stream(), &mut bytes);
    bytes
        .split(|&byte| byte == b'\n')
        .filter_map(|line| serde_json::from_slice(line).ok())
        .collect()
}

#[test]
fn a_signal_ends_an_idle_program_and_one_that_is_only_watched() {
    for name in ["INT", "TERM"] {
        for clients in [0, 20] {
            let mut runtime = Runtime::start();
            let mut watchers: Vec<Client> = (0..clients).map(|_| runtime.connect()).collect();
            for client in &mut watchers {
                client.subscribe("/joint_states");
            }
            ends_on(&mut runtime, name);
            for client in &mut watchers {
                assert!(client.is_closed());
            }
        }
    }
}

#[test]
fn a_signal_ends_a_program_with_clients_that_watch_flood_or_never_read() {
    let mut runtime = Runtime::start();
    let mut watchers: Vec<Client> = (0..10).map(|_| runtime.connect()).collect();
    for client in &mut watchers {
        client.subscribe("/joint_states");
    }
    let mut deaf = runtime.connect();
    deaf.send(&json!({"op": "advertise", "topic": "/big"}));
    deaf.subscribe("/big");
    let blob = "x".repeat(200_000);
    for _ in 0..20 {
        deaf.send(&json!({"op": "publish", "topic": "/big", "msg": {"data": blob}}));
    }
    let flood = runtime.connect().stream().try_clone().unwrap();
    let flooding = std::thread::spawn(move || {
        let frame = b"{\"op\":\"call_service\",\"service\":\"/arm_sim/pause\"}\n".repeat(100);
        while std::io::Write::write_all(&mut &flood, &frame).is_ok() {}
    });
    // The flood is under way: the arm has made some ticks beside it.
    ticks(&mut watchers[0], 6);
    ends_on(&mut runtime, "TERM");
    flooding.join().unwrap();
    for client in &mut watchers {
        assert!(client.is_closed());
    }
}

#[test]
fn pending_calls_are_told_that_the_program_is_shutting_down() {
    let mut runtime = Runtime::start();
    let (mut provider, mut caller) = (runtime.connect(), runtime.connect());
    provide(&mut provider, "/s");
    for id in 0..5 {
        caller.send(&json!({"op": "call_service", "service": "/s", "id": id}));
    }
    // Many seconds of work each, of which one runs and fifteen wait; behind a sixteenth that waits nothing would be
    // read.
    let term = "sin(sin(sin(sin(t))))^2+cos(cos(cos(t)))^3+exp(sin(t))";
    let sum = [term; 10].join("+");
    for id in 5..21 {
        caller.send(
            &json!({"op": "call_service", "service": "/arm_sim/integration_step", "id": id,
            "args": {"function": sum, "x0": 0, "dt": 1e-3,
                "steps": 1_000_000, "integrator": "rk4"}}),
        );
    }
    for _ in 0..5 {
        provider.receive();
    }
    // A connection's calls are taken in order: all have come when a light one is answered.
    caller.settle();
    ends_on(&mut runtime, "INT");
    let frames = rest(&mut caller);
    let mut ids: Vec<u64> = frames
        .iter()
        .filter_map(|frame| frame["id"].as_u64())
        .collect();
    ids.sort_unstable();
    assert_eq!(
        ids,
        (0..21).collect::<Vec<_>>(),
        "every call is answered once"
    );
    for frame in frames {
        assert_eq!(frame["result"], false, "{frame}");
        assert_eq!(frame["values"], json!({}));
        assert_eq!(frame["status"], "shutting down");
    }
}

#[test]
fn goals_are_told_that_the_program_is_shutting_down() {
    let mut runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask("/pid_controller/enable", json!({"data": true}));
    let far_off = json!({"positions": [1, 1], "time_from_start": {"sec": 1000}});
    let goals = [
        ("/ik_action", json!({"x": 0.5, "y": 1, "tolerance": 1e-12})),
        (
            "/joint_trajectory_controller/follow_joint_trajectory",
            json!({"trajectory": {"joint_names": ["joint1", "joint2"], "points": [far_off]}}),
        ),
        (
            "/tf2_web_republisher",
            json!({"source_frames": ["link_1"], "target_frame": "world", "rate": 10}),
        ),
    ];
    for (action, args) in &goals {
        client.send(
            &json!({"op": "send_action_goal", "action": action, "id": action, "args": args,
            "feedback": true}),
        );
        client.receive_where("feedback", |frame| {
            frame["op"] == "action_feedback" && frame["action"] == *action
        });
    }
    ends_on(&mut runtime, "TERM");
    let ends: Vec<Value> = rest(&mut client)
        .into_iter()
        .filter(|frame| frame["op"] == "action_result")
        .collect();
    let mut told: Vec<&str> = ends.iter().filter_map(|end| end["id"].as_str()).collect();
    told.sort_unstable();
    let mut sent = goals.map(|(action, _)| action);
    sent.sort_unstable();
    assert_eq!(told, sent, "{ends:?}");
    for end in &ends {
        assert_eq!(end["status"], GoalStatus::Aborted as u8, "{end}");
    }
}

/// A call of one of the runtime's services, as a line.
fn line(service: &str, args: &Value) -> String {
    let call = json!({"op": "call_service", "service": service, "args": args});
    format!("{call}\n")
}

/// An answer of tens of megabytes.
fn millions() -> Value {
    json!({"function": "t", "x0": 0.1, "dt": 0.1, "steps": 1_000_000, "integrator": "euler"})
}

/// Sends the same again and again until the stream ends, whether or not anything comes back.
fn flood(client: &Client, bytes: impl Into<Vec<u8>>) {
    let mut stream = client.stream().try_clone().unwrap();
    let bytes = bytes.into();
    std::thread::spawn(move || while stream.write_all(&bytes).is_ok() {});
}

/// Clients bring the program into a state; a signal ends it from there.
#[track_caller]
fn ends_while(links: usize, clients: usize, state: impl Fn(&mut Client)) {
    let mut runtime = Runtime::with_links(links);
    let mut kept: Vec<Client> = (0..clients).map(|_| runtime.connect()).collect();
    for client in &mut kept {
        state(client);
    }
    // There is no event to wait for: in some of these states nothing is answered, and in others the program soon reads
    // no further and uses no processor time. It must end at any time, so a moment on the way into a state is as good.
    std::thread::sleep(Duration::from_millis(300));
    ends_on(&mut runtime, "TERM");
}

#[test]
fn a_signal_ends_a_program_that_computes_references() {
    let reference = json!({"q0": [1, 2, 3], "qdot0": [30, -20, 10], "duration": 1e4, "timestep": 0.001,
        "setpoint": [0, 0, 0], "gains": {"kp": [9, 9, 9]}, "reference": true});
    let call = line("/study/rollout", &reference);
    ends_while(3, 20, |client| client.send_bytes(call.as_bytes()));
}

#[test]
fn a_signal_ends_a_program_that_looks_for_stable_timesteps() {
    let call = line("/study/stability", &json!({})).repeat(16);
    ends_while(3, 20, |client| client.send_bytes(call.as_bytes()));
}

#[test]
fn a_signal_ends_a_program_that_is_stepped_by_hand() {
    let calls = line("/arm_sim/pause", &json!({"data": true}))
        + &line("/arm_sim/step", &json!({"steps": 10_000})).repeat(100);
    ends_while(3, 20, |client| flood(client, calls.clone()));
}

#[test]
fn a_signal_ends_a_program_whose_arm_is_flooded_with_calls_and_trajectories() {
    let trajectory = json!({"op": "publish", "topic": "/joint_trajectory",
        "msg": {"points": [{"positions": [1, 2]}]}});
    let calls = line("/arm_sim/set_params", &json!({"gravity": 9}))
        + &line(
            "/arm_sim/disturb",
            &json!({"effort": [1, 1], "duration": 1}),
        )
        + &line("/pid_controller/set_gains", &json!({"kp": [1, 2]}))
        + &format!("{trajectory}\n");
    ends_while(2, 50, |client| flood(client, calls.repeat(10)));
}

#[test]
fn a_signal_ends_a_program_that_encodes_millions_of_numbers() {
    let call = line("/arm_sim/integration_step", &millions());
    ends_while(2, 10, |client| client.send_bytes(call.as_bytes()));
}

#[test]
fn a_signal_ends_a_program_that_writes_to_a_client_that_never_reads() {
    let mut runtime = Runtime::start();
    let mut deaf = runtime.connect();
    // Tens of megabytes, which fill every buffer on the way once they have begun to come.
    deaf.send_bytes(line("/arm_sim/integration_step", &millions()).as_bytes());
    deaf.stream().peek(&mut [0]).expect("an answer begins");
    for topic in ["/joint_states", "/clock", "/diagnostics"] {
        deaf.send(&json!({"op": "subscribe", "topic": topic}));
    }
    ends_on(&mut runtime, "TERM");
}

#[test]
fn a_signal_ends_a_program_that_can_not_follow_its_timestep() {
    let call = line("/arm_sim/set_integrator", &json!({"timestep": 1e-6}));
    ends_while(3, 1, |client| client.send_bytes(call.as_bytes()));
    // However far it lags.
    let mut runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask("/arm_sim/set_integrator", json!({"timestep": 1e-12}));
    client.subscribe("/diagnostics");
    client.receive_where("a word of the delay", |frame| {
        frame["topic"] == "/diagnostics" && status(&frame["msg"], "arm_sim")["level"] != 0
    });
    ends_on(&mut runtime, "TERM");
}

#[test]
fn a_signal_ends_a_program_whose_clients_read_no_statuses() {
    let frame = b"[]\n".repeat(10_000);
    ends_while(2, 10, |client| flood(client, frame.clone()));
}

/// Numbers whose reading is slow, in the `id` of a goal that goes on for ever and tells of its progress with that `id`.
#[test]
fn a_signal_ends_a_program_whose_gateway_is_busy_with_slow_frames() {
    let id = vec!["10000000000000001268e281"; 30_000].join(",");
    let goal = format!(
        "{{\"op\":\"send_action_goal\",\"action\":\"/ik_action\",\"feedback\":true,\"id\":[{id}],\
         \"args\":{{\"x\":1,\"y\":1,\"epsilon\":1e-300}}}}\n"
    );
    ends_while(2, 5, |client| flood(client, goal.clone()));
}

#[cfg(feature = "web")]
#[test]
fn a_signal_ends_a_program_that_is_pinged_without_end() {
    let handshake =
        b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
        Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n";
    ends_while(2, 5, |client| {
        client.send_bytes(handshake);
        // Masked with zeros, so that the payload is what it is.
        flood(
            client,
            [b"\x89\xFD\0\0\0\0".as_slice(), &[7; 125]]
                .concat()
                .repeat(100),
        );
    });
}

#[test]
fn steps_by_hand_that_are_not_taken_yet_are_told_that_the_program_is_shutting_down() {
    let mut runtime = Runtime::with_links(3);
    let mut clients: Vec<Client> = (0..50).map(|_| runtime.connect()).collect();
    clients[0].ask("/arm_sim/pause", json!({"data": true}));
    let calls = line("/arm_sim/step", &json!({"steps": 10_000})).repeat(20);
    for client in &mut clients {
        client.send_bytes(calls.as_bytes());
    }
    // Once the first is taken, the next is at the arm.
    for client in &mut clients {
        client.receive();
    }
    ends_on(&mut runtime, "TERM");
    let mut told = 0;
    for client in &mut clients {
        let frames = rest(client);
        told += usize::from(frames.last().is_some_and(|frame| frame["result"] == false));
        for frame in &frames {
            assert!(
                frame["result"] == true || frame["status"] == "shutting down",
                "{frame}"
            );
        }
    }
    assert_eq!(told, clients.len(), "each had one at the arm");
}
