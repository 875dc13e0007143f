//! "PID services" and "Control law".
//!
//! Most rules use no gravity and small gains, so the arm hardly moves, and the effort shows each term alone.

use std::thread::sleep;
use std::time::Duration;

use serde_json::json;

use crate::bench::{Bench, apply_alone, has, is_query, is_switched, shifted};
use crate::values::{largest, list, minus, must, near, plain, set};
use crate::{Check, Got};

/// The checks of this part.
pub const CHECKS: &[Check] = &[
    ("enable-1", |bench| {
        let found = bench.found()?.clone();
        let data = crate::values::boolean(&found.setting(ENABLE)?, "data")?;
        let state = found.state?;
        let away = largest(&minus(&state.position, &bench.reset()?));
        if data && largest(&state.effort) > 0.0 && away > 0.1 {
            return bench.aside("PID is on and moved the arm, so somebody has used this server; a fresh server can be judged");
        }
        must(!data, || "data true".to_owned())?;
        let effort = state.effort;
        near("effort", &effort, &bench.each(0.0), 1e-12)?;
        Ok(format!("data false, effort {}", list(&effort)))
    }),
    ("enable-2", |bench| is_switched(bench, ENABLE)),
    ("enable-3", |bench| is_query(bench, ENABLE, &["data"])),
    ("enable-4", |bench| {
        bench.swing()?;
        let states = bench.joints_for(0.3)?;
        let velocity = states.iter().map(|joints| largest(&joints.velocity)).fold(0.0, f64::max);
        must(velocity > 0.1, || "the arm does not swing".to_owned())?;
        for joints in &states {
            near("effort", &joints.effort, &bench.each(0.0), 1e-12)?;
        }
        Ok(format!("zeros at up to {velocity:.1} rad/s"))
    }),
    ("enable-5", |bench| {
        let pose = bench.float(5.0, 0.0, 1.0)?;
        bench.hold(&shifted(&pose, 0.5))?;
        let joints = bench.joints_for(0.3)?.pop().ok_or("no joint states")?;
        let moved = largest(&minus(&joints.position, &pose));
        must(largest(&joints.effort) > 0.0 && moved > 0.01, || format!("effort {}, moved {moved:.4} rad", list(&joints.effort)))?;
        Ok(format!("effort {}, moved {moved:.3} rad", list(&joints.effort)))
    }),
    ("enable-6", |bench| {
        let before = wound_up(bench, 1000)?;
        bench.enable(false)?;
        bench.enable(true)?;
        let after = bench.fresh()?.effort;
        changes(&before, &after, |before, after| after.abs() < 0.4 * before)
    }),
    ("enable-7", |bench| {
        let pose = bench.float(0.5, 0.0, 0.0)?;
        bench.hold(&shifted(&pose, 1.0))?;
        bench.fresh()?;
        bench.pause(true)?;
        let before = bench.fresh()?.effort;
        must(largest(&before) > 0.1, || format!("effort {} while enabled", list(&before)))?;
        bench.enable(false)?;
        let after = bench.fresh()?.effort;
        near("effort", &after, &bench.each(0.0), 1e-12)?;
        Ok(format!("{}, then {}", list(&before), list(&after)))
    }),
    ("gains-1", |bench| {
        let gains = json!({"kp": bench.each(12.5), "ki": bench.each(3.0), "kd": bench.each(0.75)});
        let answer = bench.accepted(SET_GAINS, &gains)?;
        has(&gains, &answer)?;
        has(&gains, &bench.accepted(SET_GAINS, &json!({}))?)?;
        Ok(answer.to_string())
    }),
    ("gains-2", |bench| is_query(bench, SET_GAINS, &GAINS)),
    ("gains-3", |bench| {
        bench.set_gains(1.0, 2.0, 3.0)?;
        let before = json!({"kp": bench.each(1.0), "ki": bench.each(2.0), "kd": bench.each(3.0)});
        let changes = [("kp", 4.0), ("ki", 5.0), ("kd", 6.0)].map(|(name, value)| (name, json!(bench.each(value))));
        apply_alone(bench, SET_GAINS, before, &changes)
    }),
    ("gains-4", |bench| {
        let long = vec![1.0; bench.links + 1];
        rejects_gains(bench, &[vec![5.0], long])
    }),
    ("gains-5", |bench| {
        let mut bad = bench.each(5.0);
        bad.splice(bench.links - 1.., [-5.0]);
        rejects_gains(bench, &[bad])
    }),
    ("gains-6", |bench| {
        let before = wound_up(bench, 500)?;
        bench.accepted(SET_GAINS, &json!({"ki": bench.each(2.0 * SMALL)}))?;
        let after = bench.fresh()?.effort;
        changes(&before, &after, |before, after| after > 1.6 * before)
    }),
    ("gains-7", |bench| {
        let pose = bench.float(0.0, 0.0, 0.0)?;
        bench.hold(&shifted(&pose, 1.0))?;
        let effort = bench.fresh()?.effort;
        near("effort", &effort, &bench.each(0.0), 1e-12)?;
        Ok(list(&effort))
    }),
    ("law-1", |bench| {
        let pose = bench.float(0.0, 0.0, 0.0)?;
        let kp: Vec<f64> = [0.5, 0.3, 0.2].into_iter().take(bench.links).collect();
        let away: Vec<f64> = [0.6, -0.8, 1.0].into_iter().take(bench.links).collect();
        let setpoint: Vec<f64> = pose.iter().zip(&away).map(|(angle, by)| angle + by).collect();
        bench.accepted(SET_GAINS, &json!({"kp": kp}))?;
        bench.hold(&setpoint)?;
        let joints = bench.fresh()?;
        let expected: Vec<f64> = minus(&setpoint, &joints.position).iter().zip(&kp).map(|(error, kp)| kp * error).collect();
        near("effort", &joints.effort, &expected, 0.02)?;
        must(largest(&joints.effort) > 0.1, || format!("effort {}", list(&joints.effort)))?;
        Ok(list(&joints.effort))
    }),
    ("law-2", |bench| {
        bench.set_gravity(0.0)?;
        bench.swing()?;
        bench.set_gains(0.0, 0.0, 0.1)?;
        bench.enable(true)?;
        let joints = bench.fresh()?;
        let expected: Vec<f64> = joints.velocity.iter().map(|rate| -0.1 * rate).collect();
        must(largest(&expected) > 0.05, || format!("velocity {}", list(&joints.velocity)))?;
        let error = largest(&minus(&joints.effort, &expected)) / largest(&expected);
        must(error < 0.1, || format!("effort {} instead of {}", list(&joints.effort), list(&expected)))?;
        Ok(format!("effort {} at {} rad/s", list(&joints.effort), list(&joints.velocity)))
    }),
    ("law-3", |bench| {
        let pose = bench.float(0.0, 0.0, 0.5)?;
        bench.hold(&shifted(&pose, 1.0))?;
        bench.stays_at(&pose, 0.3, 1e-9)
    }),
    ("law-4", |bench| {
        let pose = bench.float(0.0, SMALL, 0.0)?;
        let setpoint = shifted(&pose, 1.0);
        bench.hold(&setpoint)?;
        let states = bench.joints_for(0.5)?;
        let [first, .., last] = states.as_slice() else { return Err("no joint states".to_owned()) };
        let grown: Vec<f64> = minus(&last.effort, &first.effort).iter().map(|change| change / SMALL).collect();
        let mut sum = bench.each(0.0);
        for pair in states.windows(2) {
            let [before, after] = pair else { continue };
            for (sum, error) in sum.iter_mut().zip(minus(&setpoint, &before.position)) {
                *sum += error * (after.stamp - before.stamp);
            }
        }
        let is_sum = sum.iter().zip(&grown).all(|(sum, grown)| *sum > 0.1 && (grown / sum - 1.0).abs() < 0.15);
        must(is_sum, || format!("effort / ki grew by {}, the integral of the error by {}", list(&grown), list(&sum)))?;
        Ok(format!("by {} and {}", list(&grown), list(&sum)))
    }),
    ("law-5", |bench| {
        let pose = bench.float(0.0, 1e-8, 0.0)?;
        bench.hold(&shifted(&pose, 1e8))?;
        sleep(Duration::from_millis(300));
        let early = bench.fresh()?.effort;
        sleep(Duration::from_millis(500));
        let late = bench.fresh()?.effort;
        changes(&early, &late, |early, late| early > 0.0 && (late / early - 1.0).abs() < 0.05)
    }),
    ("law-6", |bench| {
        let setpoint = held(bench, [0.5, -0.4, 0.3], false)?;
        let joints = bench.at_rest()?;
        let error = largest(&minus(&setpoint, &joints.position));
        must(error > 0.01, || format!("an offset of {error:.4} rad"))?;
        Ok(format!("an offset of {error:.4} rad"))
    }),
    ("law-7", |bench| {
        let setpoint = held(bench, [0.5, -0.4, 0.3], true)?;
        bench.fresh()?;
        let began = std::time::Instant::now();
        let mut inside = began;
        loop {
            let joints = bench.joints()?;
            let error = largest(&minus(&setpoint, &joints.position));
            if error > 0.05 {
                inside = std::time::Instant::now();
            } else if inside.elapsed() > Duration::from_millis(500) {
                return Ok(format!("within {error:.4} rad after {:.1} s", began.elapsed().as_secs_f64()));
            }
            must(began.elapsed() < Duration::from_secs(10), || format!("{} rad off after 10 s", plain(error)))?;
        }
    }),
];

const ENABLE: &str = "/pid_controller/enable";
const SET_GAINS: &str = "/pid_controller/set_gains";
const GAINS: [&str; 3] = ["kp", "ki", "kd"];
/// An integral gain so small that the arm hardly moves while the error is 1 rad.
pub(crate) const SMALL: f64 = 0.005;

/// With the integral term alone and an error of 1 rad for a time: the effort.
pub(crate) fn wound_up(bench: &mut Bench, milliseconds: u64) -> Result<Vec<f64>, String> {
    let pose = bench.float(0.0, SMALL, 0.0)?;
    bench.hold(&shifted(&pose, 1.0))?;
    sleep(Duration::from_millis(milliseconds));
    let effort = bench.fresh()?.effort;
    must(effort.iter().all(|effort| *effort > 0.2 * SMALL), || format!("the integral does not grow: effort {}", list(&effort)))?;
    Ok(effort)
}

/// Passes if every joint's effort after something compares with the one before it.
pub(crate) fn changes(before: &[f64], after: &[f64], holds: impl Fn(f64, f64) -> bool) -> Got {
    let told = format!("effort {} before, {} after", list(before), list(after));
    if before.iter().zip(after).all(|(before, after)| holds(*before, *after)) { Ok(told) } else { Err(told) }
}

/// Passes if each bad array is rejected for each gain, with the other two applied.
fn rejects_gains(bench: &mut Bench, bad: &[Vec<f64>]) -> Got {
    let mut status = String::new();
    for name in GAINS {
        for array in bad {
            bench.set_gains(1.0, 1.0, 1.0)?;
            let mut request = json!({"kp": bench.each(2.0), "ki": bench.each(2.0), "kd": bench.each(2.0)});
            let mut expected = request.clone();
            set(&mut request, name, json!(array));
            set(&mut expected, name, json!(bench.each(1.0)));
            let answer = bench.rejected(SET_GAINS, &request)?;
            has(&expected, &answer.values)?;
            status = answer.status;
        }
    }
    Ok(status)
}

/// Holds a setpoint near the starting pose, which it returns.
pub(crate) fn held(bench: &mut Bench, by: [f64; 3], integral: bool) -> Result<Vec<f64>, String> {
    let pose = bench.reset()?;
    let setpoint: Vec<f64> = pose.iter().zip(by).map(|(angle, by)| angle + by).collect();
    bench.set_holding_gains(integral)?;
    bench.hold(&setpoint)?;
    bench.enable(true)?;
    Ok(setpoint)
}
