//! The kernel of the page in one file gives the same answers as the runtime to the same frames at the same times.
//!
//! Both begin at one instant of virtual time. Only one of them can measure run times, so these are left out.

use std::cell::Cell;
use std::time::Duration;

use crate::stage::{Stage, ms};
use crate::system::in_virtual_time;
use crate::virtual_time::Client;
use pendularm::actors::resources::work_clock;
use pendularm::math::arm::Arm;
use pendularm_wasm::Kernel;
use serde_json::{Value, json};
use tokio::time::{Instant, sleep};

thread_local! {
    static BEGAN: Cell<Option<Instant>> = const { Cell::new(None) };
}

/// Virtual time since the kernel was made.
fn clock() -> Duration {
    BEGAN.get().map_or(Duration::ZERO, |began| began.elapsed())
}

/// A runtime and a kernel, each with a client that sends the same requests.
struct Both<const N: usize> {
    stage: Stage<N>,
    client: Client,
    kernel: Kernel<N>,
    /// All frames of the kernel.
    said: Vec<Value>,
}

const SEED: u64 = 11;

impl<const N: usize> Both<N>
where
    Arm<N>: Default,
{
    async fn start() -> Self {
        // A busy machine defers no step. The kernel's budget follows the virtual clock, and the runtime's budget counts
        // queries of the clock.
        work_clock::count(Duration::from_micros(1));
        let stage = Stage::<N>::with_seed(SEED).await;
        stage.compute();
        BEGAN.set(Some(Instant::now()));
        let kernel = Kernel::new(clock, SEED);
        let client = stage.connect();
        let mut both = Self {
            stage,
            client,
            kernel,
            said: Vec::new(),
        };
        both.send(json!({"op": "set_level", "level": "warning", "errors": "object"}))
            .await;
        both
    }

    async fn send(&mut self, frame: Value) {
        self.client.send(&frame).await;
        self.client.settle().await;
        self.kernel.receive(&frame.to_string());
        self.hear();
    }

    fn hear(&mut self) {
        let frames = String::from_utf8(self.kernel.take_frames()).unwrap();
        let lines = frames
            .lines()
            .map(|line| serde_json::from_str(line).unwrap());
        self.said.extend(lines);
    }

    async fn subscribe(&mut self, topic: &str) {
        self.send(json!({"op": "subscribe", "topic": topic})).await;
    }

    /// Lets time pass, with its ticks.
    async fn pass(&mut self, time: Duration) {
        let (end, tick) = (clock() + time, Duration::from_secs(1) / 60);
        loop {
            let since_tick = clock().as_nanos() % tick.as_nanos();
            let wait = tick - Duration::from_nanos(u64::try_from(since_tick).unwrap());
            if clock() + wait > end {
                break;
            }
            sleep(wait).await;
            self.kernel.tick();
            self.hear();
        }
        sleep(end.saturating_sub(clock())).await;
    }

    /// The answers of both, and the statuses before them.
    async fn call(&mut self, service: &str, args: Value) -> (Value, Value) {
        let frame = json!({"op": "call_service", "id": "one", "service": service, "args": args});
        let before = (self.client.received.len(), self.said.len());
        self.kernel.receive(&frame.to_string());
        while self.kernel.compute(ms(1)) {}
        self.hear();
        self.client.send(&frame).await;
        let is_answer = |frame: &Value| frame["op"] == "service_response" && frame["id"] == "one";
        self.client.receive_where(is_answer).await;
        let of = |received: &[Value]| -> Value {
            let told = received.iter().filter(|frame| frame["op"] != "publish");
            told.cloned().map(without_times).collect()
        };
        (
            of(&self.client.received[before.0..]),
            of(&self.said[before.1..]),
        )
    }

    async fn agree(&mut self, service: &str, args: Value) -> Value {
        if service.starts_with("/study/") {
            // The study uses the last state of the arm: here, the present one.
            self.call("/arm_sim/pause", json!({})).await;
        }
        let (theirs, ours) = self.call(service, args.clone()).await;
        assert_eq!(ours, theirs, "{service} {args}");
        ours.as_array().unwrap().last().unwrap().clone()
    }

    /// Asserts that both have published the same on a topic.
    fn agree_on(&self, topic: &str) -> usize {
        let theirs = self.client.messages(topic);
        let is_on = |frame: &&Value| frame["topic"] == topic;
        let ours = self
            .said
            .iter()
            .filter(is_on)
            .map(|frame| frame["msg"].clone());
        let ours: Vec<Value> = ours.collect();
        assert_eq!(ours, theirs, "{topic}");
        ours.len()
    }
}

/// The frame without values that depend on the machine's speed.
fn without_times(mut frame: Value) -> Value {
    if let Some(values) = frame["values"].as_object_mut() {
        values.remove("wall_time");
    }
    frame
}

/// Arguments that are valid or invalid for at least one service.
fn arguments(links: usize) -> Vec<Value> {
    let per_joint = |value: f64| vec![value; links];
    vec![
        json!({}),
        json!(null),
        json!([]),
        json!("text"),
        json!([1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13]),
        json!({"data": "yes", "unknown": 1}),
        json!({"data": true}),
        json!({"data": false}),
        json!({"method": "verlet", "timestep": -1, "integrator": "nothing"}),
        json!({"method": "rk5", "timestep": 0.002, "integrator": "midpoint"}),
        json!({"gravity": 3.7, "masses": per_joint(2.0), "lengths": [1]}),
        json!({"gravity": "heavy", "masses": per_joint(0.0), "lengths": per_joint(0.9)}),
        json!({"kp": per_joint(300.0), "ki": per_joint(-1.0), "kd": 5}),
        json!({"period": 0.01, "delay": true, "control_period": -1}),
        json!({"period": null, "delay": null, "control_period": 0.004}),
        json!({"position": per_joint(0.3), "velocity": "fast"}),
        json!({"steps": 25, "effort": per_joint(1.0)}),
        json!({"steps": 0, "effort": per_joint(1e9)}),
        json!({"effort": per_joint(4.0), "duration": 0.25}),
        json!({"viscous": per_joint(0.4)}),
        json!({"effort": null, "anti_windup": "back_calculation", "tracking_time": 0.3}),
        json!({"effort": per_joint(4.0), "duration": 0}),
        json!({"x": 0.7, "y": 0.9, "phi": 0.4}),
        json!({"x": 70, "y": 0.9, "phi": 0.4}),
        json!({"x": 0.7, "epsilon": 0}),
        json!({"goal_id": "goal-1"}),
        json!({"goal_id": 7}),
        json!({"duration": 2.5, "epsilon": 0.05, "success_hold": 0.1}),
        json!({"duration": 0.5, "samples": 7, "reference": true, "timestep": 0.01}),
        json!({"duration": 1e300, "samples": 1_000_000_000}),
        json!({"settling_time": 1e-9, "margin": 0.5}),
        json!({"error": 0.01, "controller": true, "duration": 0.5, "setpoint": per_joint(0.2)}),
        json!({"params": {"masses": per_joint(3.0)}, "gains": {"kp": per_joint(200.0)}, "duration": 0.3}),
        json!({"params": {"masses": 3}, "gains": {"kp": "stiff"}}),
        json!({"mass_matrix": [3, 0.5, 0.5, 1], "kp": [40], "kd": [3, 2], "ki": 1, "period": 0.01, "delay": 1}),
        json!({"mass_matrix": [3, 0.5, 0.5, 1], "kp": [40], "kd": [3, 2], "period": 0.01, "between": "implicit", "steps": 3}),
        json!({"mass_matrix": [1, 2, 3], "kp": ["stiff"], "period": -1, "between": "nothing"}),
    ]
}

/// Whether the arguments need their own computation. Unknown fields are ignored, so without a known one the result is
/// the same. Gains of three links are a computation of seconds, so those of two links stand for them.
fn is_of_the_study(links: usize, service: &str, args: &Value) -> bool {
    let Some(fields) = args.as_object() else {
        return !args.is_null() && *args != json!([]);
    };
    let known = match service {
        "/study/gains" => &["settling_time", "margin"][..],
        "/study/rollout" => &["samples", "params", "gains"],
        "/study/held_limit" => &["mass_matrix"],
        _ => &["params", "control_period"],
    };
    let is_quick = links == 2 || service != "/study/gains";
    (fields.is_empty() && is_quick) || known.iter().any(|name| fields.contains_key(*name))
}

/// The services of the page, and one more; the others need a server.
const SERVED: [&str; 24] = [
    "/arm_sim/set_params",
    "/arm_sim/set_friction",
    "/arm_sim/set_integrator",
    "/arm_sim/set_state",
    "/arm_sim/step",
    "/arm_sim/reset",
    "/arm_sim/pause",
    "/arm_sim/disturb",
    "/pid_controller/set_gains",
    "/pid_controller/set_limits",
    "/pid_controller/set_sensors",
    "/pid_controller/set_period",
    "/pid_controller/enable",
    "/ik/solve",
    "/ik_action/send_goal",
    "/ik_action/cancel_goal",
    "/ik_trial/start",
    "/ik_trial/skip",
    "/ik_trial/stop",
    "/study/stability",
    "/study/gains",
    "/study/rollout",
    "/study/held_limit",
    "/nobody/knows",
];

async fn every_answer_is_the_same<const N: usize>()
where
    Arm<N>: Default,
{
    let mut both = Both::<N>::start().await;
    let (mut good, mut refused) = (0, 0);
    for service in SERVED {
        for args in arguments(N) {
            if service.starts_with("/study/") && !is_of_the_study(N, service, &args) {
                continue;
            }
            let answer = both.agree(service, args).await;
            if answer["result"] == true {
                good += 1;
            } else {
                refused += 1;
            }
            both.pass(ms(7)).await;
        }
    }
    assert!(
        good > 100 && refused > 100,
        "{good} good, {refused} refused"
    );
    both.agree("/arm_sim/pause", json!({})).await;
    let ours = both.kernel.simulation();
    let theirs = both.stage.simulation().await;
    assert_eq!(ours.state(), theirs.state());
    assert_eq!(ours.steps(), theirs.steps());
}

#[test]
fn every_answer_of_an_arm_of_two_or_three_links_is_the_same() {
    in_virtual_time(every_answer_is_the_same::<2>());
    in_virtual_time(every_answer_is_the_same::<3>());
}

#[test]
fn a_method_of_ones_own_is_refused_with_the_reason() {
    in_virtual_time(async {
        let mut both = Both::<2>::start().await;
        let euler = json!({"tableau": {"a": [[]], "b": [1]}, "duration": 0.1, "error": 0.1});
        for service in ["/study/method", "/study/rollout"] {
            let (theirs, ours) = both.call(service, euler.clone()).await;
            assert_eq!(theirs[0]["result"], true, "{service}: {theirs}");
            assert_eq!(ours[0]["result"], false, "{service}: {ours}");
            let why = ours[0].to_string();
            assert!(
                why.contains("tableau: a method of your own needs a server"),
                "{why}"
            );
        }
    });
}

/// Both, subscribed to topics, after calls. After each call time passes \[ms\].
async fn after(topics: &[&str], calls: Vec<(&str, Value, u64)>) -> Both<2> {
    let mut both = Both::<2>::start().await;
    for topic in topics {
        both.subscribe(topic).await;
    }
    for (service, args, time) in calls {
        both.agree(service, args).await;
        both.pass(ms(time)).await;
    }
    both.client.settle().await;
    both
}

#[test]
fn a_goal_and_its_messages_are_the_same() {
    in_virtual_time(async {
        let topics = [
            "/joint_states",
            "/joint_trajectory",
            "/ik_action/feedback",
            "/ik_action/result",
        ];
        // Another goal takes the first one's place, the third is cancelled, and a reset ends the fourth.
        let calls = vec![
            ("/ik_action/send_goal", json!({"x": 0.7, "y": 0.9}), 0),
            ("/pid_controller/enable", json!({"data": true}), 900),
            ("/ik_action/send_goal", json!({"x": -0.7, "y": 1.1}), 6000),
            ("/ik_action/send_goal", json!({"x": 0.2, "y": -1.1}), 50),
            ("/ik_action/cancel_goal", json!({"goal_id": "goal-3"}), 0),
            ("/ik_action/send_goal", json!({"x": 0.3, "y": -1.1}), 50),
            ("/arm_sim/reset", json!({}), 0),
            ("/arm_sim/pause", json!({"data": true}), 0),
            ("/arm_sim/step", json!({"steps": 1500}), 100),
        ];
        let both = after(&topics, calls).await;
        assert_eq!(both.agree_on("/ik_action/result"), 4);
        assert_eq!(both.agree_on("/joint_trajectory"), 4);
        assert!(both.agree_on("/ik_action/feedback") > 100);
        assert!(both.agree_on("/joint_states") > 400);
    });
}

#[test]
fn a_trial_has_the_same_targets_and_the_same_end() {
    in_virtual_time(async {
        let terms = json!({"duration": 20.0, "epsilon": 0.05, "success_hold": 0.2});
        let calls = vec![
            ("/pid_controller/enable", json!({"data": true}), 0),
            ("/ik_trial/start", terms, 9000),
            ("/ik_trial/skip", json!({}), 12_000),
            ("/ik_trial/stop", json!({}), 0),
        ];
        let both = after(&["/ik_action/result", "/joint_trajectory"], calls).await;
        assert!(both.agree_on("/ik_action/result") > 3);
        assert!(both.agree_on("/joint_trajectory") > 3);
    });
}

#[test]
fn setpoints_and_efforts_are_taken_or_refused_alike() {
    in_virtual_time(async {
        let mut both = Both::<2>::start().await;
        both.subscribe("/joint_trajectory").await;
        let point = |positions: &[f64]| json!({"points": [{"positions": positions}]});
        for (topic, msg) in [
            ("/joint_trajectory", point(&[0.4, -0.2])),
            ("/joint_trajectory", point(&[0.4])),
            ("/joint_trajectory", json!({"points": []})),
            ("/effort_controller/commands", json!({"data": [1.5, -0.5]})),
            ("/effort_controller/commands", json!({"data": [1.5]})),
        ] {
            both.send(json!({"op": "publish", "topic": topic, "id": "p", "msg": msg}))
                .await;
            both.pass(ms(40)).await;
        }
        let statuses = |received: &[Value]| -> Vec<Value> {
            let told = received.iter().filter(|frame| frame["op"] == "status");
            told.cloned().collect()
        };
        assert_eq!(statuses(&both.said), statuses(&both.client.received));
        assert_eq!(statuses(&both.said).len(), 3);
        assert_eq!(both.agree_on("/joint_trajectory"), 3);
        both.agree("/arm_sim/pause", json!({"data": true})).await;
        let ours = *both.kernel.simulation().state();
        assert_eq!(ours, *both.stage.simulation().await.state());
    });
}
