//! "/joint_trajectory and /joint_states".
//!
//! The setpoint shows in the effort: without gravity and with small gains the arm hardly moves, so `effort / kp` is the
//! position error, and `effort / kd` the velocity error.

use std::time::{Duration, Instant};

use serde_json::json;

use crate::bench::{Bench, Joints, point, shifted};
use crate::values::{largest, list, must, near, set};
use crate::{Check, Got};

/// The gain that makes a setpoint visible.
const SMALL: f64 = 0.5;
/// How exactly: the arm moves a little [rad, rad/s].
const TOLERANCE: f64 = 0.03;

/// The checks of this part.
pub const CHECKS: &[Check] = &[
    ("trajectory-1", |bench| {
        bench.float(SMALL, 0.0, 0.0)?;
        let angles = angles(bench);
        bench.command(&json!([point(&angles, &bench.each(0.0))]))?;
        position_is(bench, &angles)
    }),
    ("trajectory-2", |bench| {
        bench.float(SMALL, 0.0, 0.0)?;
        let (angles, rest) = (angles(bench), bench.each(0.0));
        let mut last = point(&angles, &rest);
        set(&mut last, "time_from_start", json!({"sec": 5, "nanosec": 0}));
        bench.command(&json!([point(&shifted(&angles, 1.0), &rest), point(&shifted(&angles, -1.0), &rest), last]))?;
        position_is(bench, &angles)
    }),
    ("trajectory-3", |bench| {
        with_velocity(bench)?;
        velocity_is(bench, 0.4)
    }),
    ("trajectory-4", |bench| {
        with_velocity(bench)?;
        bench.command(&json!([{"positions": angles(bench), "time_from_start": {"sec": 0, "nanosec": 0}}]))?;
        velocity_is(bench, 0.0)
    }),
    ("trajectory-5", |bench| {
        with_velocity(bench)?;
        let angles = angles(bench);
        bench.command(&json!([point(&angles, &[0.7])]))?;
        velocity_is(bench, 0.0)?;
        bench.set_gains(SMALL, 0.0, 0.0)?;
        position_is(bench, &angles)
    }),
    ("trajectory-6", |bench| stays(bench, &json!([point(&[0.9], &[0.0])]))),
    ("trajectory-7", |bench| stays(bench, &json!([]))),
    ("trajectory-8", |bench| {
        bench.float(SMALL, 0.0, 0.0)?;
        bench.enable(false)?;
        let angles = angles(bench);
        bench.command(&json!([point(&angles, &bench.each(0.0))]))?;
        bench.enable(true)?;
        position_is(bench, &angles)
    }),
    ("states-1", |bench| {
        bench.fresh()?;
        bench.forget("/joint_states");
        let began = Instant::now();
        for count in 0..5 {
            let left = Duration::from_secs(1).saturating_sub(began.elapsed());
            bench.message("/joint_states", left).map_err(|_| format!("{count} messages"))?;
        }
        Ok(format!("5 messages in {:.2} s", began.elapsed().as_secs_f64()))
    }),
    ("states-2", |bench| {
        let name = bench.fresh()?.name;
        let mut distinct = name.clone();
        distinct.sort();
        distinct.dedup();
        must(distinct.len() == bench.links && name.len() == bench.links, || format!("{name:?}"))?;
        Ok(format!("{name:?}"))
    }),
    ("states-3", |bench| {
        bench.swing()?;
        let states = bench.joints_for(0.2)?;
        Ok(format!("{} messages with {} entries", states.len(), bench.links))
    }),
    ("states-4", |bench| {
        bench.fresh()?;
        let mut last = f64::NEG_INFINITY;
        for _ in 0..15 {
            let msg = bench.message("/joint_states", Duration::from_secs(2))?;
            let stamp = Joints::read(&msg)?.stamp;
            let nanosec = msg.pointer("/header/stamp/nanosec").or_else(|| msg.pointer("/header/stamp/nsecs"));
            let nanosec = nanosec.and_then(serde_json::Value::as_u64);
            must(nanosec.is_some_and(|nanosec| nanosec < 1_000_000_000), || format!("nanosec {nanosec:?}"))?;
            must(stamp >= last, || format!("{stamp} after {last}"))?;
            last = stamp;
        }
        must(largest(&[last]).is_finite(), || "no stamp".to_owned())?;
        Ok(format!("15 stamps, the last {last:.3} s"))
    }),
    ("pace-1", |bench| {
        paced(bench, 1.0, 0.05, "stamps advance by", "s in a second", |states| {
            let (first, last) = (states.first()?, states.last()?);
            Some(last.stamp - first.stamp)
        })
    }),
    ("pace-2", |bench| {
        #[allow(clippy::cast_precision_loss, reason = "a second has few messages")]
        let count = |states: &[Joints]| Some(states.len().saturating_sub(1) as f64);
        paced(bench, 60.0, 0.2, "at", "Hz", count)
    }),
];

/// Passes if the effort shows these angles as the setpoint of the positions.
fn position_is(bench: &mut Bench, angles: &[f64]) -> Got {
    let Joints { position, effort, .. } = bench.fresh()?;
    let shown: Vec<f64> = position.iter().zip(effort).map(|(angle, effort)| angle + effort / SMALL).collect();
    near("the setpoint", &shown, angles, TOLERANCE)?;
    Ok(list(&shown))
}

/// Passes if the effort shows this rate as the setpoint of every velocity.
fn velocity_is(bench: &mut Bench, rate: f64) -> Got {
    let Joints { velocity, effort, .. } = bench.fresh()?;
    let shown: Vec<f64> = velocity.iter().zip(effort).map(|(rate, effort)| rate + effort / SMALL).collect();
    near("the velocity setpoint", &shown, &bench.each(rate), TOLERANCE)?;
    Ok(list(&shown))
}

/// Different angles for the joints, so an exchange of joints is visible.
fn angles(bench: &Bench) -> Vec<f64> {
    [0.4, -0.3, 0.2].into_iter().take(bench.links).collect()
}

/// With the derivative term alone and a velocity setpoint of 0.4 rad/s.
fn with_velocity(bench: &mut Bench) -> Result<(), String> {
    let pose = bench.float(0.0, 0.0, SMALL)?;
    bench.command(&json!([point(&pose, &bench.each(0.4))]))
}

/// Sends a trajectory after a valid one. The valid one must stay active.
fn stays(bench: &mut Bench, points: &serde_json::Value) -> Got {
    bench.float(SMALL, 0.0, 0.0)?;
    let angles = angles(bench);
    bench.command(&json!([point(&angles, &bench.each(0.0))]))?;
    bench.command(points)?;
    position_is(bench, &angles)
}

/// Passes if the rate of a quantity is the expected one in one of three seconds: a busy machine may delay messages.
fn paced(bench: &mut Bench, expected: f64, tolerance: f64, says: &str, unit: &str, quantity: fn(&[Joints]) -> Option<f64>) -> Got {
    let mut got = String::new();
    for _ in 0..3 {
        bench.fresh()?;
        let (began, mut states) = (Instant::now(), vec![bench.joints()?]);
        let first = began.elapsed();
        while began.elapsed() < Duration::from_secs(1) {
            states.push(bench.joints()?);
        }
        let seconds = (began.elapsed() - first).as_secs_f64();
        let rate = quantity(&states).ok_or("no joint states")? / seconds;
        got = format!("{says} {rate:.2} {unit}");
        if (rate / expected - 1.0).abs() <= tolerance {
            return Ok(got);
        }
    }
    Err(got)
}
