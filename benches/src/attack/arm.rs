//! Attacks on the arm's thread: steps, settings, goals, trials.

use super::Attack;
use super::script::{Client, call, light, publish, subscribe};

pub const ATTACKS: &[Attack] = &[
    Attack::new(
        "step",
        "4 clients call /arm_sim/step with 10,000 steps of three links",
        || steps().times(4),
    )
    .with(&["--links", "3"])
    .moves(),
    Attack::new(
        "long-steps",
        "150 clients step the arm by a second, while 20 clients receive the feedback of a goal",
        long_steps,
    )
    .moves(),
    Attack::new(
        "timestep",
        "the arm steps a microsecond at a time, with three links; 10 clients watch the error estimate",
        || {
            let set = r#"{"method":"rk4","timestep":1e-6}"#;
            let setter = Client::tcp()
                .says(&call("/arm_sim/set_integrator", "1", set))
                .says(&call("/pid_controller/enable", "2", r#"{"data":true}"#));
            let watcher = Client::tcp().says(&subscribe("/arm_sim/error_estimate", ""));
            [setter.times(1), watcher.times(10)].concat()
        },
    )
    .with(&["--links", "3"])
    .moves(),
    Attack::new(
        "commands",
        "10 clients push, reset, pause and set the arm; 200 watch the description and the frames",
        commands,
    )
    .moves(),
    Attack::new(
        "goals",
        "10 clients send and cancel goals that replace one another, through both doors",
        || Client::tcp().repeats_each(0..400, goal).times(10),
    )
    .moves(),
    Attack::new(
        "trials",
        "10 clients start, skip and stop trials, 100 watch",
        || {
            let calls = ["/ik_trial/start", "/ik_trial/skip", "/ik_trial/stop"];
            let caller = Client::tcp().repeats_each(0..calls.len(), |k| light(calls[k]));
            let watcher = Client::tcp().says(&subscribe("/ik_trial/status", ""));
            [caller.times(10), watcher.times(100)].concat()
        },
    )
    .moves(),
];

fn steps() -> Client {
    let pause = call("/arm_sim/pause", "0", r#"{"data":true}"#);
    Client::tcp()
        .says(&pause)
        .floods(&call("/arm_sim/step", "1", r#"{"steps":10000}"#))
}

fn long_steps() -> Vec<Client> {
    let goal = r#"{"x":0.5,"y":0.5,"epsilon":1e-6}"#;
    let begin = Client::tcp()
        .says(&call("/arm_sim/set_params", "1", r#"{"gravity":0}"#))
        .says(&call("/arm_sim/set_integrator", "2", r#"{"timestep":1}"#))
        .says(&call("/ik_action/send_goal", "3", goal));
    let hear = Client::tcp().says(&subscribe("/ik_action/feedback", ""));
    [
        begin.times(1),
        hear.times(20),
        steps().after(300).times(150),
    ]
    .concat()
}

/// Settings, each different from the previous one. Most cause a new prediction, and masses a new description.
fn commands() -> Vec<Client> {
    let command = |k: usize| {
        let one = 1.0 + k as f64 * 1e-3;
        let method = ["euler", "midpoint", "verlet", "rk4"][k / 7 % 4];
        let (service, args) = match k % 7 {
            0 => (
                "/arm_sim/disturb",
                format!(r#"{{"effort":[{k},-{k}],"duration":1000}}"#),
            ),
            1 => (
                "/arm_sim/set_params",
                format!(r#"{{"masses":[{one},1],"lengths":[1,{one}]}}"#),
            ),
            2 => (
                "/arm_sim/set_integrator",
                format!(r#"{{"method":"{method}"}}"#),
            ),
            3 => (
                "/pid_controller/set_gains",
                format!(r#"{{"kp":[{k},{k}]}}"#),
            ),
            4 => ("/arm_sim/reset", "{}".to_owned()),
            5 => (
                "/arm_sim/pause",
                format!(r#"{{"data":{}}}"#, k.is_multiple_of(2)),
            ),
            _ => {
                let points = format!(r#"{{"points":[{{"positions":[0.{k},-0.{k}]}}]}}"#);
                return publish("/joint_trajectory", &points);
            }
        };
        call(service, "1", &args)
    };
    let watcher = Client::tcp()
        .says(&subscribe("/robot_description", ""))
        .says(&subscribe("/tf_static", ""))
        .says(&subscribe("/tf", ""))
        .says(&subscribe("/diagnostics", ""));
    let commander = Client::tcp().repeats_each(0..700, command);
    [commander.times(10), watcher.times(200)].concat()
}

/// A goal at a new reachable target each time, or the cancellation of a possible one.
fn goal(k: usize) -> String {
    let (y, x) = (k as f64 * 0.37).sin_cos();
    let place = format!(
        r#"{{"x":{:.4},"y":{:.4},"success_hold":1000}}"#,
        1.2 * x,
        1.2 * y
    );
    let action = format!(r#""action":"/ik_action","id":{}"#, k / 2);
    match k % 4 {
        0 => call("/ik_action/send_goal", "1", &place),
        1 => call(
            "/ik_action/cancel_goal",
            "1",
            &format!(r#"{{"goal_id":{k}}}"#),
        ),
        2 => format!(r#"{{"op":"send_action_goal",{action},"feedback":true,"args":{place}}}"#),
        _ => format!(r#"{{"op":"cancel_action_goal",{action}}}"#),
    }
}
