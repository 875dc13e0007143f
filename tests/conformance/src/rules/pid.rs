//! "PID services" and "Control law".
//!
//! Most rules use no gravity and small gains, so the arm hardly moves, and the effort shows each term alone.

use std::thread::sleep;
use std::time::Duration;

use serde_json::json;

use crate::bench::{Bench, apply_alone, has, point, shifted};
use crate::rules::control_services::is_query;
use crate::values::{fine, largest, list, minus, must, near};
use crate::{Got, Rule, rule};

/// The rules of this part.
pub const RULES: &[Rule] = &[
    rule("enable-1", "PID starts disabled", "data false and zero effort before any change", starts_disabled),
    rule("enable-2", "enable switches the controller and returns the state", "data as it was set", switches),
    rule("enable-3", "An empty request changes nothing", "the same value twice", |bench| is_query(bench, ENABLE, &["data"])),
    rule("enable-4", "Effort is zero while the controller is disabled", "zeros while the arm swings", no_effort),
    rule("enable-5", "Effort acts once the controller is enabled", "effort that is not zero, and motion", effort_acts),
    rule("enable-6", "Enabling after a disable clears the integral", "an effort near zero again", clears_integral),
    rule("enable-7", "Disabling ends the effort at once, also while paused", "an effort while enabled, zeros after that", ends_effort),
    rule("gains-1", "Gains are accepted and read back", "kp, ki and kd as they were set", reads_back),
    rule("gains-2", "An empty request changes nothing", "the same gains twice", |bench| is_query(bench, SET_GAINS, &GAINS)),
    rule("gains-3", "kp, ki and kd are optional and apply alone", "the other gains stay", gains_alone),
    rule(
        "gains-4",
        "An array of the wrong length is rejected, the other fields apply",
        "result false, the old array, the other arrays new",
        wrong_length,
    ),
    rule("gains-5", "A negative gain is rejected, the other fields apply", "result false, the old array, the other arrays new", negative),
    rule("gains-6", "A change of gains keeps the integral", "twice the effort after ki is doubled", keeps_integral),
    rule("gains-7", "Gains of zero are accepted", "no effort with the controller on", zero_gains),
    rule(
        "law-1",
        "The proportional term is kp times the position error, for each joint alone",
        "effort = kp (setpoint - actual) with another kp for each joint",
        proportional,
    ),
    rule("law-2", "The derivative term is kd times the velocity error", "effort = -kd velocity for an arm that moves", derivative),
    rule(
        "law-3",
        "The derivative term does not differentiate the position error",
        "no effort and no motion when the setpoint jumps and kp = ki = 0",
        no_kick,
    ),
    rule(
        "law-4",
        "The integral term is ki times the sum of the position error over time",
        "effort / ki grows by the integral of the error",
        integral,
    ),
    rule("law-5", "The integral is bounded", "the same effort after 0.4 s and 1.2 s of an error of 1e8 rad", bounded),
    rule("law-6", "Without an integral term gravity leaves an offset", "at rest with an error of G / kp, more than 0.01 rad", offset),
    rule("law-7", "With an integral term the arm reaches the setpoint and stays", "within 0.05 rad for 0.5 s, in at most 10 s", converges),
];

const ENABLE: &str = "/pid_controller/enable";
const SET_GAINS: &str = "/pid_controller/set_gains";
const GAINS: [&str; 3] = ["kp", "ki", "kd"];
/// An integral gain so small that the arm hardly moves while the error is 1 rad.
const SMALL: f64 = 0.005;

fn starts_disabled(bench: &mut Bench) -> Got {
    let found = bench.found()?.clone();
    let data = crate::values::boolean(&found.enable?, "data")?;
    must(!data, || "data true".to_owned())?;
    let effort = found.state?.effort;
    near("effort", &effort, &bench.each(0.0), 1e-12)?;
    Ok(format!("data false, effort {}", list(&effort)))
}

fn switches(bench: &mut Bench) -> Got {
    for on in [true, false] {
        bench.enable(on)?;
        let data = bench.is_enabled()?;
        must(data == on, || format!("data {data} after data {on}"))?;
    }
    Ok("data as it was set".to_owned())
}

fn no_effort(bench: &mut Bench) -> Got {
    bench.swing()?;
    let states = bench.joints_for(0.3)?;
    let velocity = states.iter().map(|joints| largest(&joints.velocity)).fold(0.0, f64::max);
    must(velocity > 0.1, || "the arm does not swing".to_owned())?;
    for joints in &states {
        near("effort", &joints.effort, &bench.each(0.0), 1e-12)?;
    }
    Ok(format!("zeros at up to {velocity:.1} rad/s"))
}

fn effort_acts(bench: &mut Bench) -> Got {
    let pose = bench.float(5.0, 0.0, 1.0)?;
    bench.hold(&shifted(&pose, 0.5))?;
    let joints = bench.joints_for(0.3)?.pop().ok_or("no joint states")?;
    let moved = largest(&minus(&joints.position, &pose));
    must(largest(&joints.effort) > 0.0 && moved > 0.01, || format!("effort {}, moved {moved:.4} rad", list(&joints.effort)))?;
    Ok(format!("effort {}, moved {moved:.3} rad", list(&joints.effort)))
}

/// With the integral term alone and an error of 1 rad for a time: the effort.
fn wound_up(bench: &mut Bench, milliseconds: u64) -> Result<Vec<f64>, String> {
    let pose = bench.float(0.0, SMALL, 0.0)?;
    bench.hold(&shifted(&pose, 1.0))?;
    sleep(Duration::from_millis(milliseconds));
    let effort = bench.fresh()?.effort;
    must(effort.iter().all(|effort| *effort > 0.2 * SMALL), || format!("the integral does not grow: effort {}", fine(&effort)))?;
    Ok(effort)
}

fn clears_integral(bench: &mut Bench) -> Got {
    let before = wound_up(bench, 1000)?;
    bench.enable(false)?;
    bench.enable(true)?;
    let after = bench.fresh()?.effort;
    let is_clear = before.iter().zip(&after).all(|(before, after)| after.abs() < 0.4 * before);
    must(is_clear, || format!("effort {} before, {} after", fine(&before), fine(&after)))?;
    Ok(format!("effort {} before, {} after", fine(&before), fine(&after)))
}

fn ends_effort(bench: &mut Bench) -> Got {
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
}

fn reads_back(bench: &mut Bench) -> Got {
    let gains = json!({"kp": bench.each(12.5), "ki": bench.each(3.0), "kd": bench.each(0.75)});
    let answer = bench.accepted(SET_GAINS, &gains)?;
    has(&gains, &answer)?;
    has(&gains, &bench.accepted(SET_GAINS, &json!({}))?)?;
    Ok(answer.to_string())
}

fn gains_alone(bench: &mut Bench) -> Got {
    bench.set_gains(1.0, 2.0, 3.0)?;
    let before = json!({"kp": bench.each(1.0), "ki": bench.each(2.0), "kd": bench.each(3.0)});
    let changes = [("kp", 4.0), ("ki", 5.0), ("kd", 6.0)].map(|(name, value)| (name, json!(bench.each(value))));
    apply_alone(bench, SET_GAINS, before, &changes)
}

/// Passes if each bad array is rejected for each gain, with the other two applied.
fn rejects_gains(bench: &mut Bench, bad: &[Vec<f64>]) -> Got {
    let mut status = String::new();
    for name in GAINS {
        for array in bad {
            bench.set_gains(1.0, 1.0, 1.0)?;
            let mut request = json!({"kp": bench.each(2.0), "ki": bench.each(2.0), "kd": bench.each(2.0)});
            let mut expected = request.clone();
            if let (Some(request), Some(expected)) = (request.as_object_mut(), expected.as_object_mut()) {
                request.insert(name.to_owned(), json!(array));
                expected.insert(name.to_owned(), json!(bench.each(1.0)));
            }
            let answer = bench.rejected(SET_GAINS, &request)?;
            has(&expected, &answer.values)?;
            status = answer.status;
        }
    }
    Ok(status)
}

fn wrong_length(bench: &mut Bench) -> Got {
    let long = vec![1.0; bench.links + 1];
    rejects_gains(bench, &[vec![5.0], long])
}

fn negative(bench: &mut Bench) -> Got {
    let mut bad = bench.each(5.0);
    if let Some(last) = bad.last_mut() {
        *last = -5.0;
    }
    rejects_gains(bench, &[bad])
}

fn keeps_integral(bench: &mut Bench) -> Got {
    let before = wound_up(bench, 1000)?;
    bench.accepted(SET_GAINS, &json!({"ki": bench.each(2.0 * SMALL)}))?;
    let after = bench.fresh()?.effort;
    let is_kept = before.iter().zip(&after).all(|(before, after)| *after > 1.6 * before);
    must(is_kept, || format!("effort {} before, {} after", fine(&before), fine(&after)))?;
    Ok(format!("effort {} before, {} after", fine(&before), fine(&after)))
}

fn zero_gains(bench: &mut Bench) -> Got {
    let pose = bench.float(0.0, 0.0, 0.0)?;
    bench.hold(&shifted(&pose, 1.0))?;
    let effort = bench.fresh()?.effort;
    near("effort", &effort, &bench.each(0.0), 1e-12)?;
    Ok(list(&effort))
}

fn proportional(bench: &mut Bench) -> Got {
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
}

fn derivative(bench: &mut Bench) -> Got {
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
}

fn no_kick(bench: &mut Bench) -> Got {
    let pose = bench.float(0.0, 0.0, 0.5)?;
    bench.command(&json!([point(&shifted(&pose, 1.0), &bench.each(0.0))]))?;
    let states = bench.joints_for(0.3)?;
    for joints in &states {
        near("effort", &joints.effort, &bench.each(0.0), 1e-9)?;
        near("position", &joints.position, &pose, 1e-9)?;
    }
    Ok("no effort and no motion".to_owned())
}

fn integral(bench: &mut Bench) -> Got {
    let pose = bench.float(0.0, SMALL, 0.0)?;
    let setpoint = shifted(&pose, 1.0);
    bench.hold(&setpoint)?;
    let states = bench.joints_for(0.8)?;
    let (mut sum, mut grown) = (bench.each(0.0), bench.each(0.0));
    for pair in states.windows(2) {
        let [before, after] = pair else { continue };
        let dt = after.stamp - before.stamp;
        let errors = minus(&setpoint, &before.position);
        for (sum, error) in sum.iter_mut().zip(errors) {
            *sum += error * dt;
        }
        for (grown, change) in grown.iter_mut().zip(minus(&after.effort, &before.effort)) {
            *grown += change / SMALL;
        }
    }
    let is_sum = sum.iter().zip(&grown).all(|(sum, grown)| *sum > 0.1 && (grown / sum - 1.0).abs() < 0.15);
    must(is_sum, || format!("effort / ki grew by {}, the integral of the error by {}", list(&grown), list(&sum)))?;
    Ok(format!("by {} and {}", list(&grown), list(&sum)))
}

fn bounded(bench: &mut Bench) -> Got {
    let pose = bench.float(0.0, 1e-8, 0.0)?;
    bench.hold(&shifted(&pose, 1e8))?;
    sleep(Duration::from_millis(400));
    let early = bench.fresh()?.effort;
    sleep(Duration::from_millis(800));
    let late = bench.fresh()?.effort;
    let is_bounded = early.iter().zip(&late).all(|(early, late)| *early > 0.0 && (late / early - 1.0).abs() < 0.05);
    must(is_bounded, || format!("effort {}, then {}", fine(&early), fine(&late)))?;
    Ok(format!("effort {}, then {}", fine(&early), fine(&late)))
}

/// A setpoint near the starting pose.
fn aim(bench: &mut Bench) -> Result<Vec<f64>, String> {
    let pose = bench.reset()?;
    let by = [0.5, -0.4, 0.3];
    Ok(pose.iter().zip(by).map(|(angle, by)| angle + by).collect())
}

fn offset(bench: &mut Bench) -> Got {
    let setpoint = aim(bench)?;
    bench.set_holding_gains(false)?;
    bench.hold(&setpoint)?;
    bench.enable(true)?;
    let joints = bench.at_rest()?;
    let error = largest(&minus(&setpoint, &joints.position));
    must(error > 0.01, || format!("an offset of {error:.4} rad"))?;
    Ok(format!("an offset of {error:.4} rad"))
}

fn converges(bench: &mut Bench) -> Got {
    let setpoint = aim(bench)?;
    bench.set_holding_gains(true)?;
    bench.hold(&setpoint)?;
    bench.enable(true)?;
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
        must(began.elapsed() < Duration::from_secs(10), || format!("{error:.4} rad off after 10 s"))?;
    }
}
