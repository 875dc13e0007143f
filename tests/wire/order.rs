//! Frames of one connection take effect in the order sent, and those to it leave in the order in which they were
//! produced.
//!
//! **Invariant:** a race that is possible is given hundreds of chances.

use crate::arm::{stamp, state_where};
use crate::common::{Client, Runtime};
use serde_json::{Value, json};

fn call(service: &str, id: impl Into<Value>, args: Value) -> String {
    let frame = json!({"op": "call_service", "service": service, "id": id.into(), "args": args});
    format!("{frame}\n")
}

fn trajectory(position: f64) -> String {
    let msg = json!({"points": [{"positions": [position, position]}]});
    format!(
        "{}\n",
        json!({"op": "publish", "topic": "/joint_trajectory", "msg": msg})
    )
}

fn is_state(frame: &Value) -> bool {
    frame["topic"] == "/joint_states"
}

/// All `/joint_states` that came before the response `id`, and the first `after` of those behind it.
fn states_around(client: &mut Client, id: &str, after: usize) -> (Vec<Value>, Vec<Value>) {
    client.receive_where("response", |frame| frame["id"] == id);
    let before = std::mem::take(&mut client.kept)
        .into_iter()
        .filter(is_state);
    let before = before.map(|mut frame| frame["msg"].take()).collect();
    let after = (0..after)
        .map(|_| client.message("/joint_states"))
        .collect();
    (before, after)
}

#[test]
fn pipelined_calls_take_effect_and_are_answered_in_the_order_sent() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let frames: String = (0..300)
        .map(|n| call("/arm_sim/set_params", n, json!({"gravity": n})))
        .collect();
    client.send_bytes(frames.as_bytes());
    for n in 0..300 {
        let response = client.receive();
        assert_eq!(response["id"], n);
        assert_eq!(response["values"]["gravity"], f64::from(n), "{response}");
    }
}

/// A setpoint counts from the moment it is taken, and with P control alone and the arm paused the effort tells it.
#[test]
fn trajectories_and_calls_take_effect_in_the_order_sent() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    client.ask("/arm_sim/set_params", json!({"gravity": 0}));
    client.ask(
        "/pid_controller/set_gains",
        json!({"kp": [1, 1], "ki": [0, 0], "kd": [0, 0]}),
    );
    // The reset clears the setpoint of the trajectory before it, and not that of the one behind it.
    for round in 1..20 {
        let frames = [
            trajectory(7.0),
            call("/pid_controller/enable", "on", json!({"data": true})),
            call("/arm_sim/reset", "reset", json!({})),
            call("/pid_controller/enable", "off", json!({"data": false})),
        ];
        client.send_bytes(frames.concat().as_bytes());
        let (_, after) = states_around(&mut client, "off", 3);
        for state in after {
            assert_eq!(state["effort"], json!([0.0, 0.0]), "round {round}: {state}");
            assert_eq!(state["position"], json!([0.0, 0.0]), "at rest: {state}");
        }
    }
    client.send_bytes(
        [
            call("/arm_sim/reset", "reset", json!({})),
            trajectory(0.5),
            call("/pid_controller/enable", "on", json!({"data": true})),
        ]
        .concat()
        .as_bytes(),
    );
    let (_, after) = states_around(&mut client, "on", 10);
    assert!(
        after[9]["effort"][0].as_f64().unwrap() > 0.0,
        "{}",
        after[9]
    );
}

#[test]
fn no_state_from_before_follows_the_response_to_a_pause() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    for _ in 0..15 {
        client.message("/joint_states");
        client.send_bytes(call("/arm_sim/pause", "pause", json!({"data": true})).as_bytes());
        let (_, after) = states_around(&mut client, "pause", 2);
        assert_eq!(
            after[0], after[1],
            "the arm moved after the response to the pause"
        );
        client.ask("/arm_sim/pause", json!({"data": false}));
    }
}

#[test]
fn no_state_from_before_follows_the_response_to_a_reset() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    for round in 0..30 {
        // An arm that goes on makes up 250 ms at most if it is late: half a second is from before the reset.
        let (paused, least) = if round % 2 == 0 {
            (true, 0.1)
        } else {
            (false, 0.5)
        };
        state_where(&mut client, "a moving arm", |state| stamp(state) > least);
        client.send_bytes(
            [
                call("/arm_sim/pause", "pause", json!({"data": paused})),
                call("/arm_sim/reset", "reset", json!({})),
            ]
            .concat()
            .as_bytes(),
        );
        let (_, after) = states_around(&mut client, "reset", 1);
        let after = stamp(&after[0]);
        assert!(
            after == 0.0 || !paused && after < least,
            "round {round}: {after} s after a reset"
        );
        client.ask("/arm_sim/pause", json!({"data": false}));
    }
}

/// The throttled subscriber holds back half a second of states: they must not come out after the response.
#[test]
fn no_state_from_before_follows_also_where_throttling_holds_one_back() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send(&json!({"op": "subscribe", "topic": "/joint_states", "throttle_rate": 150, "queue_length": 30}));
    client.status();
    for _ in 0..5 {
        client.message("/joint_states");
        client.message("/joint_states");
        client.send_bytes(call("/arm_sim/pause", "pause", json!({"data": true})).as_bytes());
        let (_, after) = states_around(&mut client, "pause", 2);
        assert_eq!(
            after[0], after[1],
            "a state from before the pause came after its response"
        );
        client.ask("/arm_sim/pause", json!({"data": false}));
    }
}

#[test]
fn no_state_from_before_follows_the_response_to_switching_the_controller_off() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    client.send_bytes(trajectory(1.0).as_bytes());
    for _ in 0..10 {
        client.ask("/pid_controller/enable", json!({"data": true}));
        client.receive_where("some effort", |frame| {
            is_state(frame) && frame["msg"]["effort"] != json!([0.0, 0.0])
        });
        client.kept.clear();
        client.send_bytes(call("/pid_controller/enable", "off", json!({"data": false})).as_bytes());
        let (_, after) = states_around(&mut client, "off", 1);
        assert_eq!(after[0]["effort"], json!([0.0, 0.0]));
    }
}

/// A status comes from the connection itself, an answer from the arm's thread: neither may overtake the other.
#[test]
fn answers_and_error_statuses_leave_in_the_order_of_what_they_answer() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let mut frames = String::new();
    for n in 0..200 {
        frames += &call("/arm_sim/set_params", n, json!({}));
        frames += "garbage\n";
        frames += &call("/arm_sim/pause", n, json!(7));
        frames += &format!("{{\"op\":\"subscribe\",\"topic\":\"/t\",\"id\":{n}}}\n");
        frames += "{\"op\":\"nonsense\"}";
        frames += &call("/none", n, json!({}));
    }
    client.send_bytes(frames.as_bytes());
    for n in 0..200 {
        assert_eq!(client.receive()["id"], n, "an answer of the arm");
        let malformed = client.receive();
        assert!(
            malformed["msg"]
                .as_str()
                .is_some_and(|msg| msg.contains("malformed")),
            "{malformed}"
        );
        let refused = client.receive();
        assert_eq!(
            (&refused["id"], &refused["result"]),
            (&json!(n), &json!(false))
        );
        assert_eq!(client.receive()["msg"], "subscribed to /t");
        let unknown = client.receive();
        assert!(
            unknown["msg"]
                .as_str()
                .is_some_and(|msg| msg.contains("nonsense")),
            "{unknown}"
        );
        assert_eq!(client.receive()["service"], "/none");
    }
}

#[test]
fn messages_of_one_publisher_arrive_in_the_order_sent() {
    let runtime = Runtime::start();
    let (mut publisher, mut subscriber) = (runtime.connect(), runtime.connect());
    subscriber.subscribe("/a");
    subscriber.subscribe("/b");
    let mut frames = String::from(
        "{\"op\":\"advertise\",\"topic\":\"/a\"}{\"op\":\"advertise\",\"topic\":\"/b\"}",
    );
    for n in 0..1000 {
        let topic = if n % 3 == 0 { "/a" } else { "/b" };
        frames += &format!("{{\"op\":\"publish\",\"topic\":\"{topic}\",\"msg\":{{\"n\":{n}}}}}\n");
    }
    publisher.send_bytes(frames.as_bytes());
    for n in 0..1000 {
        assert_eq!(subscriber.receive()["msg"]["n"], n);
    }
}

#[test]
fn a_computation_may_answer_late_and_holds_up_no_other_call() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let heavy =
        json!({"function": "sin(t)", "x0": 0, "dt": 1e-3, "steps": 300_000, "integrator": "rk4"});
    client.send_bytes(
        [
            call("/arm_sim/integration_step", "heavy", heavy),
            call("/arm_sim/pause", "light", json!({})),
        ]
        .concat()
        .as_bytes(),
    );
    assert_eq!(client.receive()["id"], "light");
    assert_eq!(client.receive()["id"], "heavy");
}
