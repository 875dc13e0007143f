//! Steps that leave the finite numbers.

use crate::arm::{numbers, send_trajectory, stamp, state, state_where, trajectory};
use crate::common::{Client, Runtime};
use crate::diagnostics::status;
use serde_json::{Value, json};

/// An aggressive loop at a timestep far beyond its limit.
fn diverge(client: &mut Client, links: usize) {
    client.ask(
        "/pid_controller/set_gains",
        json!({"kp": vec![1e6; links], "kd": vec![1e5; links]}),
    );
    client.ask("/arm_sim/set_integrator", json!({"timestep": 0.02}));
    client.ask("/pid_controller/enable", json!({"data": true}));
    send_trajectory(client, &trajectory(&vec![1.0; links]));
}

fn arm_status(message: &Value) -> &Value {
    status(message, "arm_sim")
}

#[test]
fn nothing_but_a_reset_moves_a_diverged_arm() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/diagnostics");
    diverge(&mut client, 2);
    let is_level = |frame: &Value, level: u64| {
        frame["topic"] == "/diagnostics" && arm_status(&frame["msg"])["level"] == level
    };
    client.receive_where("a divergence", |frame| is_level(frame, 2));
    client.subscribe("/joint_states");
    let held = state(&mut client);
    client.ask(
        "/arm_sim/set_integrator",
        json!({"method": "euler", "timestep": 0.001}),
    );
    client.ask("/arm_sim/set_params", json!({"gravity": 1}));
    client.ask(
        "/pid_controller/set_gains",
        json!({"kp": [1, 1], "ki": [0, 0], "kd": [1, 1]}),
    );
    for data in [true, false] {
        client.ask("/arm_sim/pause", json!({"data": data}));
    }
    for data in [false, true] {
        client.ask("/pid_controller/enable", json!({"data": data}));
    }
    send_trajectory(&mut client, &trajectory(&[0.5, 0.5]));
    let later = state(&mut client);
    assert_eq!(
        (&later["position"], &later["velocity"], &later["header"]),
        (&held["position"], &held["velocity"], &held["header"])
    );
    assert_eq!(
        numbers(&later["effort"]),
        [0.0; 2],
        "disabling has ended it"
    );

    client.kept.clear();
    let values = client.ask("/arm_sim/reset", json!({}));
    assert_eq!(
        values,
        json!({"position": [0.0, 0.0], "velocity": [0.0, 0.0]})
    );
    assert!(
        client.kept.iter().any(|frame| is_level(frame, 0)),
        "the end of it is told at once"
    );
    state_where(&mut client, "an arm that moves again", |state| {
        stamp(state) > 0.3
    });
    assert_eq!(
        client.ask("/pid_controller/enable", json!({})),
        json!({"data": true})
    );
}

#[test]
fn a_diverged_arm_that_is_paused_is_diverged_still() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/diagnostics");
    diverge(&mut client, 2);
    client.receive_where("a divergence", |frame| {
        frame["topic"] == "/diagnostics" && arm_status(&frame["msg"])["level"] == 2
    });
    client.ask("/arm_sim/pause", json!({"data": true}));
    client.kept.clear();
    assert_eq!(arm_status(&client.message("/diagnostics"))["level"], 2);
    client.ask("/arm_sim/reset", json!({}));
    client.kept.clear();
    let after = client.message("/diagnostics");
    assert_eq!(arm_status(&after)["message"], "paused");
}

#[test]
fn enormous_setpoints_and_gains_leave_the_runtime_answering_in_valid_json() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    client.subscribe("/diagnostics");
    client.ask("/pid_controller/enable", json!({"data": true}));
    let defaults = client.ask("/pid_controller/set_gains", json!({}));
    for gains in [
        json!({}),
        json!({"kp": [1e308, 1e308], "ki": [1e308, 1e308], "kd": [1e308, 1e308]}),
        json!({"kp": [5e-324, 5e-324], "ki": [0, 0], "kd": [0, 0]}),
    ] {
        for positions in [[1e308, -1e308], [5e-324, -5e-324], [1e16, 1e-16]] {
            client.ask("/pid_controller/set_gains", gains.clone());
            client.ask("/arm_sim/reset", json!({}));
            let msg = json!({"points": [{"positions": positions, "velocities": positions}]});
            send_trajectory(&mut client, &msg);
            // Each frame is parsed strictly on its way in, and must hold numbers only.
            for _ in 0..5 {
                let state = client.message("/joint_states");
                for field in ["position", "velocity", "effort"] {
                    assert_eq!(numbers(&state[field]).len(), 2);
                }
            }
        }
    }
    client.ask("/pid_controller/set_gains", defaults);
    client.ask("/arm_sim/reset", json!({}));
    send_trajectory(&mut client, &trajectory(&[0.3, 0.3]));
    state_where(&mut client, "a settled arm", |state| {
        crate::arm::is_near(state, &[0.3, 0.3], 0.02)
    });
}

#[test]
fn extreme_parameters_leave_the_runtime_answering_in_valid_json() {
    for links in [2, 3] {
        let runtime = Runtime::with_links(links);
        let mut client = runtime.connect();
        for topic in ["/joint_states", "/clock", "/diagnostics"] {
            client.subscribe(topic);
        }
        let all = |value: f64| json!(vec![value; links]);
        for (field, value) in [
            ("masses", all(1e-320)),
            ("masses", all(1e308)),
            ("lengths", all(1e-320)),
            ("lengths", all(1e308)),
            ("gravity", json!(1e308)),
            ("gravity", json!(5e-324)),
        ] {
            let mut request = json!({});
            request[field] = value.clone();
            for enabled in [false, true] {
                let values = client.ask("/arm_sim/set_params", request.clone());
                assert_eq!(values[field], value);
                client.ask("/pid_controller/enable", json!({"data": enabled}));
                client.ask("/arm_sim/reset", json!({}));
                // Each frame is parsed strictly on its way in.
                for topic in ["/joint_states", "/clock", "/joint_states"] {
                    client.message(topic);
                }
                client.ask("/arm_sim/pause", json!({"data": true}));
                client.ask("/arm_sim/pause", json!({"data": false}));
            }
            client.ask(
                "/arm_sim/set_params",
                json!({"gravity": 9.81, "masses": vec![1.0; links], "lengths": vec![1.0; links]}),
            );
        }
        // And back in order.
        client.ask("/pid_controller/enable", json!({"data": false}));
        client.ask("/arm_sim/reset", json!({}));
        let fallen = state_where(&mut client, "a falling arm", |state| stamp(state) > 0.3);
        assert!(numbers(&fallen["position"])[0] < -0.05, "{fallen}");
        state(&mut client);
    }
}
