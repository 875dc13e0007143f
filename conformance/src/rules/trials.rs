//! "Inverse kinematics": timed trials, by `/ik_trial/*`.

use std::time::Duration;

use serde_json::{Value, json};

use crate::Check;
use crate::arm::Arm;
use crate::bench::{Bench, GRAVITY};
use crate::run::PATIENCE;
use crate::values::{boolean, member, must, near, number, numbers_of, text};

/// The checks of this part.
pub const CHECKS: &[Check] = &[
    ("trial-1", |bench| {
        bench.rejected(SKIP, &json!({}))?;
        Ok(bench.rejected(STOP, &json!({}))?.status)
    }),
    ("trial-2", |bench| {
        start(bench, 60.0)?;
        let status = status_that(bench, "a status of the running trial", is_running)?;
        near("duration", &[number(&status, "duration")?], &[60.0], 1e-9)?;
        near("targets_reached", &[number(&status, "targets_reached")?], &[0.0], 1e-9)?;
        Ok(status.to_string())
    }),
    ("trial-3", |bench| {
        let status = started(bench)?;
        boolean(&status, "running")?;
        for name in ["elapsed", "duration", "targets_reached", "target/x", "target/y", "error"] {
            number(&status, name)?;
        }
        if bench.links == 3 {
            number(&status, "target/phi")?;
        }
        numbers_of(&status, "desired_positions", bench.links)?;
        let action = text(&status, "action_status")?;
        must(["idle", "active", "reached", "preempted"].contains(&action), || format!("action_status {action}"))?;
        Ok(status.to_string())
    }),
    ("trial-4", |bench| {
        start(bench, 60.0)?;
        let arm = Arm::of(bench.links, GRAVITY);
        let mut got = String::new();
        for _ in 0..3 {
            let status = status_that(bench, "a status with a target", has_target)?;
            let (x, y) = (number(&status, "target/x")?, number(&status, "target/y")?);
            let positions = numbers_of(&status, "desired_positions", bench.links)?;
            let (got_x, got_y, _) = arm.end_effector(&positions);
            near("x and y of desired_positions", &[got_x, got_y], &[x, y], 1e-6)?;
            got = format!("({x:.3}, {y:.3}) m");
            bench.accepted(SKIP, &json!({}))?;
            bench.forget(STATUS);
        }
        Ok(format!("3 targets, the last at {got}"))
    }),
    ("trial-5", |bench| {
        let before = started(bench)?;
        bench.accepted(SKIP, &json!({}))?;
        let old = member(&before, "target")?.clone();
        let after = status_that(bench, "a status with another target", |status| has_target(status) && status.get("target") != Some(&old))?;
        near("targets_reached", &[number(&after, "targets_reached")?], &[0.0], 1e-9)?;
        Ok(format!("{} after {old}", member(&after, "target")?))
    }),
    ("trial-6", |bench| {
        started(bench)?;
        bench.accepted(STOP, &json!({}))?;
        let status = cleared(bench)?;
        bench.rejected(SKIP, &json!({}))?;
        Ok(status.to_string())
    }),
    ("trial-7", |bench| {
        start(bench, 0.5)?;
        let status = cleared(bench)?;
        let elapsed = number(&status, "elapsed")?;
        must(elapsed > 0.4, || format!("ended after {elapsed} s"))?;
        bench.rejected(STOP, &json!({}))?;
        Ok(status.to_string())
    }),
    ("trial-8", |bench| {
        let status = start_easy(bench)?;
        bench.accepted(STOP, &json!({}))?;
        Ok(format!("targets_reached {}", number(&status, "targets_reached")?))
    }),
    ("trial-9", |bench| {
        let before = number(&start_easy(bench)?, "elapsed")?;
        std::thread::sleep(Duration::from_millis(500));
        start(bench, 60.0)?;
        let status = status_that(bench, "a status of the new trial", is_running)?;
        near("targets_reached", &[number(&status, "targets_reached")?], &[0.0], 1e-9)?;
        let elapsed = number(&status, "elapsed")?;
        must(elapsed < before + 0.4, || format!("elapsed {elapsed} after {before}"))?;
        Ok(format!("targets_reached 0 at {elapsed:.2} s"))
    }),
    ("trial-10", |bench| {
        bench.watch("/ik_action/feedback")?;
        let status = started(bench)?;
        let target = member(&status, "target")?.clone();
        let (x, y) = (number(&target, "x")?, number(&target, "y")?);
        let is_same = |msg: &Value| {
            let same = |name, value: f64| number(msg, name).is_ok_and(|got| (got - value).abs() < 1e-6);
            same("target/x", x) && same("target/y", y)
        };
        bench.message_that("/ik_action/feedback", PATIENCE, "feedback for that target", is_same)?;
        Ok(format!("feedback for {target}"))
    }),
];

const STATUS: &str = "/ik_trial/status";
const START: &str = "/ik_trial/start";
const SKIP: &str = "/ik_trial/skip";
const STOP: &str = "/ik_trial/stop";

/// Starts a trial whose targets are not reached.
fn start(bench: &mut Bench, duration: f64) -> Result<(), String> {
    bench.watch(STATUS)?;
    bench.accepted(START, &json!({"duration": duration, "epsilon": 1e-6, "success_hold": 100.0}))?;
    bench.forget(STATUS);
    Ok(())
}

/// Starts such a trial. Returns its first status with a target.
fn started(bench: &mut Bench) -> Result<Value, String> {
    start(bench, 60.0)?;
    status_that(bench, "a status with a target", has_target)
}

/// The next expected status. The error has the latest unexpected one.
fn status_that(bench: &mut Bench, name: &str, is_it: impl Fn(&Value) -> bool) -> Result<Value, String> {
    match bench.message_that(STATUS, PATIENCE, name, is_it) {
        Ok(status) => Ok(status),
        Err(why) => {
            let last = bench.message(STATUS, Duration::from_millis(300));
            Err(last.map_or_else(|_| why.clone(), |last| format!("{why}; a status is {last}")))
        }
    }
}

fn is_running(status: &Value) -> bool {
    boolean(status, "running") == Ok(true)
}

fn has_target(status: &Value) -> bool {
    is_running(status) && status.get("target").is_some_and(Value::is_object)
}

/// The status of the ended trial, which must have no goal.
fn cleared(bench: &mut Bench) -> Result<Value, String> {
    let status = status_that(bench, "a status of the ended trial", |status| boolean(status, "running") == Ok(false))?;
    for name in ["error", "desired_positions"] {
        let found = member(&status, name)?;
        must(found.is_null(), || format!("{name} {found}"))?;
    }
    let action = text(&status, "action_status")?;
    must(action == "idle", || format!("action_status {action}"))?;
    Ok(status)
}

/// Starts a trial whose targets are reached at once.
fn start_easy(bench: &mut Bench) -> Result<Value, String> {
    bench.set_holding_gains(true)?;
    bench.enable(true)?;
    bench.watch(STATUS)?;
    bench.accepted(START, &json!({"duration": 60.0, "epsilon": 10.0, "success_hold": 0.0}))?;
    status_that(bench, "a status with 2 targets reached", |status| number(status, "targets_reached").is_ok_and(|count| count >= 2.0))
}
