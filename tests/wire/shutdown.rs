//! SIGINT and SIGTERM end the program within a second, and waiting calls are answered.
//!
//! **Invariant:** the program ends with exit status 0 for any action of a client.

use std::io::Write;
use std::time::Duration;

use crate::common::{Client, Runtime, provide, signal};
use pendularm::protocol::op::GoalStatus;
use serde_json::{Value, json};

/// The documented second, and one more for a machine that is busy with other tests.
const LIMIT: Duration = Duration::from_secs(2);

/// Sends SIGTERM; the program must end in time, with status 0.
fn assert_ends(runtime: &mut Runtime) {
    signal(runtime.pid(), "TERM");
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
fn goals_calls_and_computations_end_with_the_reason_at_shutdown() {
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
            &json!({"op": "send_action_goal", "action": action, "id": action, "args": args, "feedback": true}),
        );
        client.receive_where("feedback", |frame| {
            frame["op"] == "action_feedback" && frame["action"] == *action
        });
    }
    let mut provider = runtime.connect();
    provide(&mut provider, "/s");
    client.send(&json!({"op": "call_service", "id": "call", "service": "/s"}));
    provider.receive();
    // Minutes of work in a test build.
    let endless = json!({"function": "sin(sin(sin(sin(sin(sin(t))))))^2+cos(cos(cos(cos(t))))^3", "x0": 0.1,
        "dt": 1e-3, "steps": 1_000_000, "integrator": "rk4"});
    client.send(
        &json!({"op": "call_service", "id": "steps", "service": "/arm_sim/integration_step", "args": endless}),
    );
    assert_ends(&mut runtime);
    let mut ends = rest(&mut client);
    for id in ["call", "steps"] {
        let is_told = |end: &Value| end["id"] == id && end["status"] == "shutting down";
        assert!(ends.iter().any(is_told), "{id}: {ends:?}");
    }
    ends.retain(|frame| frame["op"] == "action_result");
    let mut told: Vec<&str> = ends.iter().filter_map(|end| end["id"].as_str()).collect();
    told.sort_unstable();
    let mut sent = goals.map(|(action, _)| action);
    sent.sort_unstable();
    assert_eq!(told, sent, "{ends:?}");
    for end in &ends {
        assert_eq!(end["status"], GoalStatus::Aborted as u8, "{end}");
    }
}

/// States of work: how many clients bring the program into one, what each sends first, and what it sends without end.
fn states() -> [(&'static str, usize, String, String); 6] {
    let call = |service: &str, args: Value| {
        let call = json!({"op": "call_service", "service": service, "args": args});
        format!("{call}\n")
    };
    let watch = "{\"op\":\"subscribe\",\"topic\":\"/joint_states\"}\n".to_owned();
    let pause = call("/arm_sim/pause", json!({"data": true}));
    let steps = call("/arm_sim/step", json!({"steps": 10_000})).repeat(100);
    let gravity = call("/arm_sim/set_params", json!({"gravity": 9})).repeat(40);
    let millions =
        json!({"function": "t", "x0": 0.1, "dt": 0.1, "steps": 1_000_000, "integrator": "euler"});
    let millions = call("/arm_sim/integration_step", millions);
    let none = String::new;
    [
        ("is idle", 0, none(), none()),
        ("is only watched", 20, watch, none()),
        ("is stepped by hand", 5, pause, steps),
        ("has an arm that is flooded", 50, none(), gravity),
        ("encodes millions of numbers", 10, millions, none()),
        (
            "has clients that read no statuses",
            10,
            none(),
            "[]\n".repeat(10_000),
        ),
    ]
}

#[test]
fn a_signal_ends_a_program_in_every_state_of_work() {
    for (state, clients, first, flood) in states() {
        let mut runtime = Runtime::with_links(3);
        let mut kept: Vec<Client> = (0..clients).map(|_| runtime.connect()).collect();
        for client in &mut kept {
            client.send_bytes(first.as_bytes());
            let (mut stream, flood) = (client.stream().try_clone().unwrap(), flood.clone());
            // Until the stream ends, with or without answers.
            std::thread::spawn(move || {
                while !flood.is_empty() && stream.write_all(flood.as_bytes()).is_ok() {}
            });
        }
        // There is no event to wait for: in some of these states nothing is answered, and in others the program soon
        // reads no further and uses no processor time. It must end at any time, so a moment on the way into a state
        // is as good.
        std::thread::sleep(Duration::from_millis(300));
        println!("a program that {state}");
        assert_ends(&mut runtime);
    }
}
