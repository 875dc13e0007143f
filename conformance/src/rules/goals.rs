//! "Inverse kinematics": goals, by `/ik_action/*`.

use std::time::Duration;

use serde_json::{Value, json};

use crate::Check;
use crate::arm::Arm;
use crate::bench::{Bench, GRAVITY};
use crate::values::{boolean, member, must, near, number, numbers_of, set, text};

/// The checks of this part.
pub const CHECKS: &[Check] = &[
    ("goal-1", |bench| {
        let goal = endless(bench);
        let id = bench.send_goal(&goal)?;
        Ok(format!("goal_id {id}"))
    }),
    ("goal-2", |bench| {
        let (_, id) = active(bench)?;
        let status = bench.rejected(SEND, &json!({"x": 50.0, "y": 0.0, "phi": 0.0}))?.status;
        bench.forget(FEEDBACK);
        no_result(bench, &id)?;
        bench.forget(FEEDBACK);
        let msg = bench.message(FEEDBACK, PATIENCE)?;
        must(is_of(&msg, &id), || format!("feedback of another goal: {msg}"))?;
        Ok(format!("rejected with: {status}"))
    }),
    ("goal-3", |bench| bench.rejects(SEND, &[json!({}), json!({"x": 1.0}), json!({"y": 1.0}), json!({"x": "1", "y": 1.0})])),
    ("goal-4", |bench| {
        let bad = [json!({"epsilon": 0.0}), json!({"epsilon": -0.1}), json!({"success_hold": -1.0})];
        bench.rejects(SEND, &bad.map(|option| goal_at(bench, [0.5, -0.8, 0.4], &option)))
    }),
    ("goal-5", |bench| {
        bench.watch("/joint_trajectory")?;
        let goal = endless(bench);
        bench.send_goal(&goal)?;
        let msg = bench.message("/joint_trajectory", PATIENCE)?;
        let points = member(&msg, "points")?.as_array().map_or(0, Vec::len);
        let last = points.checked_sub(1).ok_or("no points")?;
        let positions = numbers_of(&msg, &format!("points/{last}/positions"), bench.links)?;
        reaches(bench, &positions, &goal)?;
        Ok(crate::values::list(&positions))
    }),
    ("goal-6", |bench| {
        let (goal, id) = active(bench)?;
        let msg = bench.message_that(FEEDBACK, PATIENCE, "feedback", |msg| is_of(msg, &id))?;
        has_target(bench, &msg, &goal)?;
        let positions = numbers_of(&msg, "positions", bench.links)?;
        reaches(bench, &positions, &goal)?;
        let (distance, elapsed) = (number(&msg, "distance_remaining")?, number(&msg, "elapsed")?);
        must(distance >= 0.0 && elapsed >= 0.0, || format!("distance_remaining {distance}, elapsed {elapsed}"))?;
        let later = bench.message_that(FEEDBACK, PATIENCE, "later feedback", |msg| {
            is_of(msg, &id) && number(msg, "elapsed").is_ok_and(|later| later > elapsed)
        })?;
        Ok(later.to_string())
    }),
    ("goal-7", |bench| {
        let (goal, id) = active(bench)?;
        let next = goal_at(bench, [-0.5, 0.9, 0.2], &json!({"epsilon": 1e-6, "success_hold": 1000.0}));
        let other = bench.send_goal(&next)?;
        must(id != other, || format!("both goals have the id {id}"))?;
        Ok(ended(bench, &id, &goal, "preempted", PATIENCE)?.to_string())
    }),
    ("goal-8", |bench| {
        // A goal of an earlier rule, if there is one.
        bench.peer.call(CANCEL, &json!({})).map(drop)?;
        Ok(bench.rejected(CANCEL, &json!({}))?.status)
    }),
    ("goal-9", |bench| {
        bench.exists(CANCEL)?;
        let (_, id) = active(bench)?;
        let status = bench.rejected(CANCEL, &json!({"goal_id": format!("not-{id}")}))?.status;
        no_result(bench, &id)?;
        Ok(status)
    }),
    ("goal-10", |bench| {
        listen(bench)?;
        let mut last = Value::Null;
        for names_goal in [true, false] {
            let goal = endless(bench);
            let id = bench.send_goal(&goal)?;
            let args = if names_goal { json!({"goal_id": id}) } else { json!({}) };
            bench.accepted(CANCEL, &args)?;
            last = ended(bench, &id, &goal, "preempted", PATIENCE)?;
        }
        Ok(last.to_string())
    }),
    ("goal-11", |bench| {
        listen(bench)?;
        let (epsilon, hold) = (0.05, 0.5);
        let goal = goal_at(bench, [0.5, -0.4, 0.3], &json!({"epsilon": epsilon, "success_hold": hold}));
        let id = bench.send_goal(&goal)?;
        let msg = ended(bench, &id, &goal, "reached", Duration::from_secs(10))?;
        let distance = number(&msg, "final_distance")?;
        must(distance <= epsilon * 1.001, || format!("final_distance {distance}"))?;
        // Feedback that came before the result: the time since the arm was last outside, and the time of the last one.
        let (mut outside, mut last) = (0.0, 0.0);
        while let Ok(msg) = bench.message_that(FEEDBACK, Duration::from_millis(1), "feedback", |msg| is_of(msg, &id)) {
            last = number(&msg, "elapsed")?;
            if number(&msg, "distance_remaining")? > epsilon {
                outside = last;
            }
        }
        // One feedback interval, at 10 Hz or faster, is not seen at either end.
        must(last - outside > hold - 0.2, || format!("{:.2} s inside", last - outside))?;
        Ok(format!("reached at {distance:.4} m after {:.2} s inside", last - outside))
    }),
    ("goal-12", |bench| {
        listen(bench)?;
        let goal = wide(bench);
        let id = bench.send_goal(&goal)?;
        Ok(ended(bench, &id, &goal, "reached", Duration::from_secs(1))?.to_string())
    }),
    ("goal-13", |bench| {
        listen(bench)?;
        let goal = wide(bench);
        let id = bench.send_goal(&goal)?;
        result(bench, &id, Duration::from_secs(1))?;
        // A goal that has ended is not preempted.
        bench.peer.call(CANCEL, &json!({})).map(drop)?;
        no_result(bench, &id)?;
        must(boolean(&bench.accepted("/arm_sim/pause", &json!({}))?, "data").is_ok(), || "no answer".to_owned())?;
        Ok("one".to_owned())
    }),
];

const SEND: &str = "/ik_action/send_goal";
const CANCEL: &str = "/ik_action/cancel_goal";
const FEEDBACK: &str = "/ik_action/feedback";
const RESULT: &str = "/ik_action/result";
/// The longest wait for a message about a goal.
const PATIENCE: Duration = Duration::from_secs(2);

/// The target that a pose reaches, with its orientation for 3 links, and further members.
fn goal_at(bench: &Bench, pose: [f64; 3], further: &Value) -> Value {
    let pose: Vec<f64> = pose.into_iter().take(bench.links).collect();
    let (x, y, phi) = Arm::of(bench.links, GRAVITY).end_effector(&pose);
    let mut goal = further.clone();
    set(&mut goal, "x", json!(x));
    set(&mut goal, "y", json!(y));
    if bench.links == 3 {
        set(&mut goal, "phi", json!(phi));
    }
    goal
}

/// A goal that stays active.
fn endless(bench: &Bench) -> Value {
    goal_at(bench, [0.5, -0.8, 0.4], &json!({"epsilon": 1e-6, "success_hold": 1000.0}))
}

/// Subscribes to feedback and results, and enables a controller that can hold the arm.
pub(crate) fn listen(bench: &mut Bench) -> Result<(), String> {
    bench.set_holding_gains(true)?;
    bench.enable(true)?;
    bench.watch(FEEDBACK)?;
    bench.watch(RESULT)?;
    bench.peer.call(CANCEL, &json!({})).map(drop)?;
    std::thread::sleep(Duration::from_millis(20));
    bench.peer.call("/arm_sim/pause", &json!({})).map(drop)?;
    bench.forget(RESULT);
    bench.forget(FEEDBACK);
    Ok(())
}

fn is_of(msg: &Value, id: &str) -> bool {
    msg.get("goal_id").and_then(Value::as_str) == Some(id)
}

/// Sends a goal that stays active, after `listen`: the goal and its id.
fn active(bench: &mut Bench) -> Result<(Value, String), String> {
    listen(bench)?;
    let goal = endless(bench);
    let id = bench.send_goal(&goal)?;
    Ok((goal, id))
}

/// The result of a goal.
pub(crate) fn result(bench: &mut Bench, id: &str, within: Duration) -> Result<Value, String> {
    bench.message_that(RESULT, within, &format!("the result of goal {id}"), |msg| is_of(msg, id))
}

/// The result of a goal, which must have this outcome and the goal's target.
fn ended(bench: &mut Bench, id: &str, goal: &Value, outcome: &str, within: Duration) -> Result<Value, String> {
    let msg = result(bench, id, within)?;
    let got = text(&msg, "outcome")?;
    must(got == outcome, || format!("outcome {got}"))?;
    let distance = number(&msg, "final_distance")?;
    must(distance >= 0.0, || format!("final_distance {distance}"))?;
    has_target(bench, &msg, goal)?;
    Ok(msg)
}

/// Passes if a pose reaches a goal.
fn reaches(bench: &Bench, pose: &[f64], goal: &Value) -> Result<(), String> {
    let (x, y, _) = Arm::of(bench.links, GRAVITY).end_effector(pose);
    near("the end effector", &[x, y], &[number(goal, "x")?, number(goal, "y")?], 1e-6)
}

/// Passes if no result of a goal comes for a moment.
fn no_result(bench: &mut Bench, id: &str) -> Result<(), String> {
    match result(bench, id, Duration::from_millis(300)) {
        Ok(msg) => Err(format!("a result: {msg}")),
        Err(_) => Ok(()),
    }
}

/// Passes if the target of a message is that of the goal.
fn has_target(bench: &Bench, msg: &Value, goal: &Value) -> Result<(), String> {
    let names: &[&str] = if bench.links == 3 { &["x", "y", "phi"] } else { &["x", "y"] };
    for name in names {
        near(&format!("target {name}"), &[number(msg, &format!("target/{name}"))?], &[number(goal, name)?], 1e-9)?;
    }
    Ok(())
}

/// A goal that is reached wherever the arm is.
pub(crate) fn wide(bench: &Bench) -> Value {
    goal_at(bench, [0.5, -0.4, 0.3], &json!({"epsilon": 10.0, "success_hold": 0.0}))
}
