//! Aimed at the arm's thread: steps, settings, goals, trials.

use super::Attack;
use super::script::{Client, call, light, numbers, publish, subscribe};

pub const ATTACKS: &[Attack] = &[
    Attack::new(
        "step",
        "4 clients call /arm_sim/step with 10,000 steps of three links",
        || steps().times(4),
    )
    .with(&["--links", "3"])
    .moves(),
    Attack::new("step-16", "16 clients do so with two links", || steps().times(16)).moves(),
    Attack::new(
        "long-steps",
        "150 clients take steps of a second by hand, while a goal is pursued whose feedback 20 hear",
        || {
    let weightless = call("/arm_sim/set_params", "1", r#"{"gravity":0}"#);
    let long = call("/arm_sim/set_integrator", "2", r#"{"timestep":1}"#);
    let goal = r#"{"x":0.5,"y":0.5,"epsilon":1e-6}"#;
    let goal = call("/ik_action/send_goal", "3", goal);
    let hear = Client::tcp().says(&subscribe("/ik_action/feedback", ""));
    let begin = Client::tcp().says(&weightless).says(&long).says(&goal);
    let step = steps().after(300).times(150);
    [begin.times(1), hear.times(20), step].concat()
},
    )
    .moves(),
    Attack::new(
        "timestep",
        "the arm steps a microsecond at a time, with three links",
        timestep,
    )
    .with(&["--links", "3"])
    .moves(),
    Attack::new(
        "error-estimate",
        "the same while 10 clients watch the error estimate",
        || [
        timestep(),
        Client::tcp()
            .says(&subscribe("/arm_sim/error_estimate", ""))
            .times(10),
    ]
    .concat(),
    )
    .moves(),
    Attack::new(
        "disturb",
        "10 clients push the arm as often as they can",
        disturb,
    )
    .moves(),
    Attack::new(
        "goals",
        "10 clients send goals that replace one another, through both doors",
        goals,
    )
    .moves(),
    Attack::new(
        "action-goals",
        "10 clients send goals with ids of 64 KiB and want feedback",
        || {
    let goal = |k: usize| {
        let (id, args) = (numbers(64 * 1024), place(k));
        format!(
            r#"{{"op":"send_action_goal","action":"/ik_action","id":{id},"feedback":true,"args":{args}}}"#
        )
    };
    Client::tcp().repeats_each(0..16, goal).times(10)
},
    )
    .moves(),
    Attack::new(
        "cancels",
        "10 clients cancel goals that there are and that there are not",
        cancels,
    )
    .moves(),
    Attack::new(
        "trials",
        "10 clients start, skip and stop trials, 100 watch",
        trials,
    )
    .moves(),
    Attack::new(
        "resets-of-the-arm",
        "10 clients reset and pause the arm, over and over",
        resets,
    )
    .moves(),
    Attack::new(
        "settings",
        "10 clients change masses and lengths, 200 watch the description and the frames",
        settings,
    )
    .moves(),
    Attack::new(
        "integrators",
        "10 clients change method and gains, each of which asks for a prediction",
        integrators,
    )
    .moves(),
    Attack::new(
        "setpoints",
        "10 clients publish setpoints without end",
        setpoints,
    )
    .moves(),
    Attack::new(
        "wrong-settings",
        "10 clients send settings of 64 KiB that are refused one by one",
        || {
    let field = numbers(20 * 1024);
    let args = format!(
        r#"{{"gravity":{field},"masses":{field},"lengths":"{}"}}"#,
        "9".repeat(20 * 1024)
    );
    Client::tcp()
        .repeats(&call("/arm_sim/set_params", "1", &args))
        .times(10)
},
    ),
    Attack::new(
        "kinematics",
        "10 clients ask for solutions at, within and beyond the edge",
        kinematics,
    ),
];

fn steps() -> Client {
    let pause = call("/arm_sim/pause", "0", r#"{"data":true}"#);
    Client::tcp()
        .says(&pause)
        .floods(&call("/arm_sim/step", "1", r#"{"steps":10000}"#))
}

fn timestep() -> Vec<Client> {
    let set = call(
        "/arm_sim/set_integrator",
        "1",
        r#"{"method":"rk4","timestep":1e-6}"#,
    );
    Client::tcp()
        .says(&set)
        .says(&call("/pid_controller/enable", "2", r#"{"data":true}"#))
        .times(1)
}

fn disturb() -> Vec<Client> {
    let push = |k: usize| {
        call(
            "/arm_sim/disturb",
            "1",
            &format!(r#"{{"effort":[{k},-{k}],"duration":1000}}"#),
        )
    };
    Client::tcp().repeats_each(0..500, push).times(10)
}

/// A place that the hand can reach, another each time.
fn place(k: usize) -> String {
    let angle = k as f64 * 0.37;
    format!(
        r#"{{"x":{:.4},"y":{:.4},"success_hold":1000}}"#,
        1.2 * angle.cos(),
        1.2 * angle.sin()
    )
}

fn goals() -> Vec<Client> {
    let service = |k| call("/ik_action/send_goal", "1", &place(k));
    let action = |k: usize| {
        let args = place(k);
        format!(
            r#"{{"op":"send_action_goal","action":"/ik_action","id":{k},"feedback":true,"args":{args}}}"#
        )
    };
    [
        Client::tcp().repeats_each(0..300, service).times(5),
        Client::tcp().repeats_each(0..300, action).times(5),
    ]
    .concat()
}

fn cancels() -> Vec<Client> {
    let cancel = |k: usize| match k % 3 {
        0 => call("/ik_action/send_goal", "1", &place(k)),
        1 => call(
            "/ik_action/cancel_goal",
            "1",
            &format!(r#"{{"goal_id":{k}}}"#),
        ),
        _ => format!(r#"{{"op":"cancel_action_goal","action":"/ik_action","id":{k}}}"#),
    };
    Client::tcp().repeats_each(0..300, cancel).times(10)
}

fn trials() -> Vec<Client> {
    let call = |k: usize| light(["/ik_trial/start", "/ik_trial/skip", "/ik_trial/stop"][k % 3]);
    let watch = Client::tcp()
        .says(&subscribe("/ik_trial/status", ""))
        .times(100);
    [Client::tcp().repeats_each(0..300, call).times(10), watch].concat()
}

fn resets() -> Vec<Client> {
    let calls = |k: usize| match k % 3 {
        0 => light("/arm_sim/reset"),
        1 => call("/arm_sim/pause", "1", r#"{"data":true}"#),
        _ => call("/arm_sim/pause", "1", r#"{"data":false}"#),
    };
    Client::tcp().repeats_each(0..300, calls).times(10)
}

fn settings() -> Vec<Client> {
    let set = |k: usize| {
        let one = 1.0 + k as f64 * 1e-3;
        call(
            "/arm_sim/set_params",
            "1",
            &format!(r#"{{"masses":[{one},1],"lengths":[1,{one}]}}"#),
        )
    };
    let watch = Client::tcp()
        .says(&subscribe("/robot_description", ""))
        .says(&subscribe("/tf_static", ""))
        .says(&subscribe("/tf", ""))
        .says(&subscribe("/diagnostics", ""));
    [
        Client::tcp().repeats_each(0..300, set).times(10),
        watch.times(200),
    ]
    .concat()
}

fn integrators() -> Vec<Client> {
    let set = |k: usize| match k % 2 {
        0 => {
            let method = ["euler", "midpoint", "verlet", "rk4"][k / 2 % 4];
            call(
                "/arm_sim/set_integrator",
                "1",
                &format!(r#"{{"method":"{method}"}}"#),
            )
        }
        _ => call(
            "/pid_controller/set_gains",
            "1",
            &format!(r#"{{"kp":[{k},{k}]}}"#),
        ),
    };
    Client::tcp().repeats_each(0..300, set).times(10)
}

fn setpoints() -> Vec<Client> {
    let point = |k: usize| {
        publish(
            "/joint_trajectory",
            &format!(r#"{{"points":[{{"positions":[0.{k},-0.{k}]}}]}}"#),
        )
    };
    Client::tcp()
        .says(&call("/pid_controller/enable", "1", r#"{"data":true}"#))
        .repeats_each(0..500, point)
        .times(10)
}

fn kinematics() -> Vec<Client> {
    let solve = |k: usize| {
        call(
            "/ik/solve",
            "1",
            &format!(r#"{{"x":{},"y":1e-{}}}"#, 1.9 + 0.0005 * k as f64, k % 300),
        )
    };
    Client::tcp().repeats_each(0..400, solve).times(10)
}
