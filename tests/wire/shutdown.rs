//! SIGINT and SIGTERM end the program within a second, and waiting calls are answered.
//!
//! **Invariant:** the program ends with exit status 0 for any action of a client.

use std::io::Write;
use std::time::Duration;

use crate::common::{Client, Runtime, provide, signal};
use pendularm::protocol::op::GoalStatus;
use pendularm_client::websocket::{self as frames, LAST, opcode};
use serde_json::{Value, json};

/// The documented second, and one more for a machine that is busy with other tests.
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
            &json!({"op": "send_action_goal", "action": action, "id": action, "args": args,
            "feedback": true}),
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
        &json!({"op": "call_service", "id": "steps", "service": "/arm_sim/integration_step",
        "args": endless}),
    );
    ends_on(&mut runtime, "TERM");
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

/// A call of one of the runtime's services, as a line.
fn line(service: &str, args: &Value) -> String {
    let call = json!({"op": "call_service", "service": service, "args": args});
    format!("{call}\n")
}

/// Repeats the same bytes until the stream ends, with or without answers.
fn flood(client: &Client, bytes: Vec<u8>) {
    let mut stream = client.stream().try_clone().unwrap();
    std::thread::spawn(move || while stream.write_all(&bytes).is_ok() {});
}

/// States of work: how many clients bring the program into one, what each sends first, and what it sends without end.
fn states() -> Vec<(&'static str, usize, Vec<u8>, Vec<u8>)> {
    let reference = json!({"q0": [1, 2, 3], "qdot0": [30, -20, 10], "duration": 1e4, "timestep": 0.001,
        "setpoint": [0, 0, 0], "gains": {"kp": [9, 9, 9]}, "reference": true});
    let millions =
        json!({"function": "t", "x0": 0.1, "dt": 0.1, "steps": 1_000_000, "integrator": "euler"});
    let trajectory = json!({"op": "publish", "topic": "/joint_trajectory",
        "msg": {"points": [{"positions": [1, 2, 3]}]}});
    let push = json!({"effort": [1, 1, 1], "duration": 1});
    let arm = line("/arm_sim/set_params", &json!({"gravity": 9}))
        + &line("/arm_sim/disturb", &push)
        + &line("/pid_controller/set_gains", &json!({"kp": [1, 2, 3]}))
        + &format!("{trajectory}\n");
    // Numbers whose reading is slow, in the `id` of a goal that goes on for ever and has feedback with that `id`.
    let id = vec!["10000000000000001268e281"; 30_000].join(",");
    let goal = format!(
        "{{\"op\":\"send_action_goal\",\"action\":\"/ik_action\",\"feedback\":true,\"id\":[{id}],\
         \"args\":{{\"x\":1,\"y\":1,\"epsilon\":1e-300}}}}\n"
    );
    let pause = line("/arm_sim/pause", &json!({"data": true}));
    let steps = line("/arm_sim/step", &json!({"steps": 10_000})).repeat(100);
    let too_fast = line("/arm_sim/set_integrator", &json!({"timestep": 1e-6}));
    let upgrade = frames::handshake("localhost", "/", "");
    let mut ping = Vec::new();
    frames::append(&mut ping, LAST | opcode::PING, [0; 4], &[7; 125]);
    let once = |name, clients, text: String| (name, clients, text.into_bytes(), Vec::new());
    let no_end = |name, clients, first: String, flood| (name, clients, first.into_bytes(), flood);
    let none = String::new;
    let stability = line("/study/stability", &json!({})).repeat(16);
    let integration = line("/arm_sim/integration_step", &millions);
    let (arm, statuses) = (arm.repeat(10).into_bytes(), b"[]\n".repeat(10_000));
    vec![
        once(
            "computes references",
            20,
            line("/study/rollout", &reference),
        ),
        once("looks for stable timesteps", 20, stability),
        no_end("is stepped by hand", 20, pause, steps.into_bytes()),
        no_end("has an arm that is flooded", 50, none(), arm),
        once("encodes millions of numbers", 10, integration),
        once("cannot follow its timestep", 1, too_fast),
        no_end("has clients that read no statuses", 10, none(), statuses),
        no_end("reads slow frames", 5, none(), goal.into_bytes()),
        no_end("is pinged without end", 5, upgrade, ping.repeat(100)),
    ]
}

#[test]
fn a_signal_ends_a_program_in_every_state_of_work() {
    for (state, clients, first, flooding) in states() {
        let mut runtime = Runtime::with_links(3);
        let kept: Vec<Client> = (0..clients).map(|_| runtime.connect()).collect();
        for client in &kept {
            (&mut client.stream()).write_all(&first).unwrap();
            if !flooding.is_empty() {
                flood(client, flooding.clone());
            }
        }
        // There is no event to wait for: in some of these states nothing is answered, and in others the program soon
        // reads no further and uses no processor time. It must end at any time, so a moment on the way into a state
        // is as good.
        std::thread::sleep(Duration::from_millis(300));
        println!("a program that {state}");
        ends_on(&mut runtime, "TERM");
    }
}
