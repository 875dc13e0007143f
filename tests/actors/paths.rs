//! Paths in virtual time: success means that the arm has arrived, and an arm that cannot follow ends or refuses them at
//! once. Goals that do not move it yet say so.

use crate::stage::{Client, Stage, ms, numbers};
use crate::system::in_virtual_time;
use pendularm::math::pid::Gains;
use serde_json::{Value, json};
use tokio::time::{Instant, sleep};

const ACTION: &str = "/joint_trajectory_controller/follow_joint_trajectory";
const ENABLE: &str = "/pid_controller/enable";

/// A goal to `target` within `duration` seconds, with these members beside its trajectory.
fn path(id: &str, target: &[f64], duration: f64, more: &Value) -> Value {
    let names = ["joint1", "joint2", "joint3"];
    let nanosec = duration.fract() * 1e9;
    let point = json!({"positions": target, "time_from_start": {"sec": duration.trunc(), "nanosec": nanosec}});
    let mut args =
        json!({"trajectory": {"joint_names": &names[..target.len()], "points": [point]}});
    for (name, value) in more.as_object().unwrap() {
        args[name] = value.clone();
    }
    json!({"op": "send_action_goal", "id": id, "action": ACTION, "args": args})
}

async fn result(client: &mut Client) -> Value {
    client
        .next_where(|frame| frame["op"] == "action_result")
        .await
}

async fn code(client: &mut Client, goal: &Value) -> i64 {
    client.send(goal).await;
    let end = result(client).await;
    end["values"]["error_code"]
        .as_i64()
        .unwrap_or_else(|| panic!("{end}"))
}

fn within(limit: f64, joints: usize) -> Value {
    let one = |joint: usize| json!({"name": format!("joint{}", joint + 1), "position": limit});
    json!({"goal_tolerance": (0..joints).map(one).collect::<Vec<_>>()})
}

/// Follows paths, fast and slow, and watches the arm for a second after a success. With little damping it swings past
/// its target again and again.
async fn arrives<const N: usize>()
where
    Gains<N>: Default,
{
    const LIMIT: f64 = 0.01;
    let stage = Stage::<N>::start().await;
    let mut client = stage.connect();
    client.enable().await;
    client.subscribe("/joint_states").await;
    let kd = client.ask("/pid_controller/set_gains", json!({})).await["kd"].take();
    let target = &[1.2, -0.7, 0.4][..N];
    for (damping, expected) in [(1.0, 0), (0.1, -5)] {
        let kd: Vec<f64> = numbers(&kd).iter().map(|one| damping * one).collect();
        client
            .ask("/pid_controller/set_gains", json!({"kd": kd}))
            .await;
        for duration in [0.001, 1.0] {
            client.ask("/arm_sim/reset", json!({})).await;
            let goal = path("a", target, duration, &within(LIMIT, N));
            assert_eq!(
                code(&mut client, &goal).await,
                expected,
                "{N} links, {damping}"
            );
            for _ in 0..60 * u32::from(expected == 0) {
                let state = client.message("/joint_states").await;
                for (is, to) in numbers(&state["position"]).iter().zip(target) {
                    assert!((is - to).abs() <= LIMIT, "{N} links, {duration} s: {state}");
                }
            }
        }
    }
}

#[test]
fn success_means_that_the_arm_has_arrived_and_stays() {
    in_virtual_time(async {
        arrives::<2>().await;
        arrives::<3>().await;
    });
}

/// Velocities of `goal_tolerance`, of an arm that goes round and round.
#[test]
fn a_joint_that_has_arrived_is_as_slow_as_the_goal_says() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.enable().await;
        // A spring without a damper.
        let gains = json!({"kp": [1.0, 1.0], "ki": [0, 0], "kd": [0, 0]});
        client.ask("/pid_controller/set_gains", gains).await;
        for (position, velocity, expected) in [
            (-1.0, 0.0, -5),
            (-1.0, 1e-3, -5),
            (-1.0, 100.0, 0),
            (-1.0, -1.0, 0),
            (0.0, -1.0, -5),
            (9.0, -1.0, 0),
        ] {
            stage.reset().await;
            let joint =
                |name: &str| json!({"name": name, "position": position, "velocity": velocity});
            let more = json!({"goal_tolerance": [joint("joint1"), joint("joint2")], "goal_time_tolerance": {"sec": 2}});
            let goal = path("a", &[2.0, 0.0], 0.001, &more);
            assert_eq!(
                code(&mut client, &goal).await,
                expected,
                "{position} rad, {velocity} rad/s"
            );
        }
    });
}

/// Of an arm whose controller is on and has no gains: it stays where it is.
#[test]
fn a_negative_time_tolerance_is_no_limit_and_zero_the_default() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.enable().await;
        let none = json!({"kp": [0, 0], "ki": [0, 0], "kd": [0, 0]});
        client.ask("/pid_controller/set_gains", none).await;
        for (tolerance, seconds) in [
            (json!({"sec": -1}), None),
            (json!({"sec": -1, "nanosec": 0}), None),
            (json!({"secs": -1, "nsecs": 0}), None),
            (json!({"nsecs": -1}), None),
            (json!({"nanosec": -500_000_000}), None),
            // One nanosecond less than nothing, as ROS 2 writes it.
            (json!({"sec": -1, "nanosec": 999_999_999}), None),
            (json!({"sec": i32::MIN}), None),
            (json!({"sec": -1, "nanosec": 1_000_000_000}), Some(5.0)),
            (json!({"secs": 0, "nsecs": 0}), Some(5.0)),
            (json!({}), Some(5.0)),
            (json!({"sec": 1, "nanosec": -250_000_000}), Some(0.75)),
            (json!({"secs": 1, "nsecs": 500_000_000}), Some(1.5)),
        ] {
            let began = Instant::now();
            let more = json!({"goal_time_tolerance": tolerance});
            client.send(&path("a", &[1.0, 0.0], 0.5, &more)).await;
            if let Some(seconds) = seconds {
                let end = result(&mut client).await;
                assert_eq!(end["values"]["error_code"], -5, "{tolerance}: {end}");
                let took = began.elapsed().as_secs_f64() - 0.5;
                assert!((took - seconds).abs() < 0.02, "{tolerance}: {took} s");
            } else {
                sleep(ms(20_000)).await;
                client
                    .send(&json!({"op": "cancel_action_goal", "id": "a", "action": ACTION}))
                    .await;
                assert_eq!(result(&mut client).await["status"], 5, "{tolerance}");
            }
        }
    });
}

#[test]
fn an_arm_that_cannot_follow_takes_no_path_and_ends_the_one_that_it_has() {
    in_virtual_time(async {
        let stage = Stage::<2>::start().await;
        let mut client = stage.connect();
        let long = |id: &str| path(id, &[0.3, 0.3], 1e3, &json!({}));
        for (paused, wrong) in [(false, ENABLE), (true, ENABLE), (false, "/arm_sim/reset")] {
            client.ask("/arm_sim/pause", json!({"data": paused})).await;
            client.enable().await;
            client.send(&long("runs")).await;
            client.heard.clear();
            if wrong == ENABLE {
                client.ask(ENABLE, json!({"data": false})).await;
            } else {
                let wild = json!({"kp": [1e300, 1e300]});
                client.ask("/pid_controller/set_gains", wild).await;
                sleep(ms(50)).await;
                client.settle().await;
            }
            // A path ends before the answer.
            let mut heard = client.heard.iter();
            let end = heard.find(|frame| frame["op"] == "action_result").unwrap();
            assert_eq!(
                (&end["status"], &end["values"]["error_code"]),
                (&json!(6), &json!(-1)),
                "{end}"
            );
            let why = end["values"]["error_string"].as_str().unwrap();
            assert!(why.contains(wrong), "{why}");
            client.send(&long("refused")).await;
            let end = result(&mut client).await;
            assert_eq!(
                (&end["status"], &end["result"]),
                (&json!(0), &json!(false)),
                "{end}"
            );
            let why = end["values"].as_str().unwrap();
            assert!(why.contains(wrong), "{why}");
        }
    });
}

/// The warnings among the frames of a client.
fn warnings(client: &Client) -> Vec<&Value> {
    client
        .heard
        .iter()
        .filter(|frame| frame["level"] == "warning")
        .collect()
}

#[test]
fn a_goal_that_does_not_move_the_arm_yet_says_so_before_its_answer() {
    in_virtual_time(async {
        let stage = Stage::<2>::start().await;
        let mut client = stage.connect();
        let args = json!({"x": 0.5, "y": 1.2});
        for is_on in [false, true] {
            client.ask(ENABLE, json!({"data": is_on})).await;
            for (service, args) in [
                ("/ik_action/send_goal", args.clone()),
                ("/ik_trial/start", json!({})),
                ("/ik_trial/skip", json!({})),
            ] {
                client.heard.clear();
                let answer = client.call(service, args).await;
                assert_eq!(
                    (&answer["result"], &answer["status"]),
                    (&json!(true), &json!("")),
                    "{answer}"
                );
                let said = warnings(&client);
                assert_eq!(
                    said.len(),
                    usize::from(!is_on),
                    "{service}: {:?}",
                    client.heard
                );
                for said in said {
                    assert_eq!(
                        (&said["op"], &said["id"]),
                        (&json!("status"), &answer["id"])
                    );
                    let text = said["msg"].as_str().unwrap();
                    assert!(
                        text.starts_with("the controller is off") && text.contains(ENABLE),
                        "{text}"
                    );
                }
            }
            client.heard.clear();
            client.send(&json!({"op": "send_action_goal", "id": "g", "action": "/ik_action", "args": args})).await;
            client.settle().await;
            let ids: Vec<&Value> = warnings(&client).iter().map(|said| &said["id"]).collect();
            assert_eq!(ids, vec![&json!("g"); usize::from(!is_on)]);
        }
        // One that is refused says why, and nothing else.
        client.ask(ENABLE, json!({"data": false})).await;
        client.heard.clear();
        client
            .refusal("/ik_action/send_goal", json!({"x": 9, "y": 9}))
            .await;
        assert_eq!(warnings(&client).len(), 0);
    });
}

/// The level and the warning that `/diagnostics` has a moment later.
async fn diagnosed(client: &mut Client) -> (u64, String) {
    let told = client.messages_for(ms(1100), "/diagnostics").await;
    let status = &told.last().unwrap()["status"][0];
    let values = status["values"].as_array().unwrap();
    let warning = values.iter().find(|one| one["key"] == "warning").unwrap();
    (
        status["level"].as_u64().unwrap(),
        warning["value"].as_str().unwrap().to_owned(),
    )
}

#[test]
fn diagnostics_warn_while_the_controller_holds_up_a_goal_or_a_setpoint() {
    in_virtual_time(async {
        let stage = Stage::<2>::start().await;
        let mut client = stage.connect();
        client.subscribe("/diagnostics").await;
        let goal = json!({"x": 0.5, "y": 1.2});
        for (service, args, is_held_up) in [
            ("/arm_sim/reset", json!({}), false),
            ("/ik_action/send_goal", goal.clone(), true),
            ("/ik_action/cancel_goal", json!({}), false),
            ("/joint_trajectory", json!([0.1, 0.1]), true),
            ("/arm_sim/pause", json!({"data": true}), true),
            ("/arm_sim/reset", json!({}), false),
            ("/ik_trial/start", json!({}), true),
            ("/arm_sim/pause", json!({"data": false}), true),
            ("/ik_trial/stop", json!({}), false),
            ("/joint_trajectory", json!([0.1, 0.1]), true),
            (ENABLE, json!({"data": true}), false),
            ("/joint_trajectory", json!([0.2, 0.1]), false),
            (ENABLE, json!({"data": false}), false),
            (ENABLE, json!({"data": true}), false),
            ("/ik_action/send_goal", goal, false),
            (ENABLE, json!({"data": false}), true),
        ] {
            if service == "/joint_trajectory" {
                client.publish_trajectory(args.clone()).await;
            } else {
                client.ask(service, args.clone()).await;
            }
            // Within a tick, not at the next second only.
            let soon = client.messages_for(ms(20), "/diagnostics").await;
            let (level, warning) = diagnosed(&mut client).await;
            assert_eq!(
                warning.contains(ENABLE),
                is_held_up,
                "{service} {args}: {warning}"
            );
            assert_eq!(level, u64::from(is_held_up), "{service} {args}: {warning}");
            if is_held_up && !service.starts_with("/arm_sim") {
                let values = &soon.first().expect(service)["status"][0]["values"];
                assert!(values.to_string().contains(ENABLE), "{service}: {soon:?}");
            }
        }
    });
}
