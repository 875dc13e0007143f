//! Mistakes in times, in expressions, in inverse kinematics, in the control law and in goals: what each of them makes of a few
//! questions.

use std::f64::consts::{LN_2, PI, TAU};
use std::time::{Duration, Instant};

use serde_json::json;

use super::{Diagnosis, FLOOR, MEASURED_RATIO, NEAR, RATIO, distance, solution, verdict};
use crate::arm::Arm;
use crate::bench::{Bench, GRAVITY, shifted};
use crate::rules::goals;
use crate::values::{largest, must, set};

/// The time after `k` steps of `dt`, as a mistake has it.
type Clock = fn(u32, f64) -> f64;

#[allow(clippy::cast_possible_truncation, reason = "this is one of the mistakes")]
const OF_TIMES: [(&str, Clock); 5] = [
    ("the times are one step ahead: the first one is dt instead of 0", |k, dt| f64::from(k + 1) * dt),
    ("the times are one step behind", |k, dt| (f64::from(k) - 1.0) * dt),
    ("the times are the numbers of the steps, without dt", |k, _| f64::from(k)),
    ("the times have single precision (float32)", |k, dt| f64::from((f64::from(k) * dt) as f32)),
    ("the times are a running sum of single precision (float32)", |k, dt| f64::from((0..k).fold(0.0_f32, |sum, _| sum + dt as f32))),
];

pub(super) fn of_times(bench: &mut Bench) -> Result<Diagnosis, String> {
    // No time but the first one is a float32.
    let (dt, steps) = (0.1, 200);
    let [got, ..] = bench.integrate("0", [0.0, 0.0, dt], steps, "rk4")?;
    let by = |clock: Clock| -> Vec<f64> { (0..=steps).map(|k| clock(k, dt)).collect() };
    let right = by(|k, dt| f64::from(k) * dt);
    let models = OF_TIMES.iter().map(|(says, clock)| ((*says).to_owned(), distance(&got, &by(*clock)))).collect();
    Ok(Diagnosis { cause: verdict(distance(&got, &right), models, NEAR, RATIO, FLOOR), plot: Some([right, got]) })
}

/// Expressions, and their values at t = 0.5.
const EXPRESSIONS: [(&str, f64); 12] = [
    ("-3^2", 9.0),
    ("2^3^2", 512.0),
    ("10-4-3", 3.0),
    ("16/4/2", 2.0),
    ("2*3^2", 18.0),
    ("2+3*4", 14.0),
    ("7/2", 3.5),
    ("sin(t)", 0.479_425_538_604_203),
    ("ln(t + 1)", 0.405_465_108_108_164_4),
    ("-t^2", 0.25),
    ("(1+2)*3", 9.0),
    ("12.5", 12.5),
];

/// Mistakes, with the expressions that they change.
const OF_EXPRESSIONS: [(&str, &[(&str, f64)]); 11] = [
    ("unary minus binds looser than ^, as in Python", &[("-3^2", -9.0), ("-t^2", -0.25)]),
    ("^ is left-associative", &[("2^3^2", 64.0)]),
    ("- and / are right-associative", &[("10-4-3", 9.0), ("16/4/2", 8.0)]),
    ("- is right-associative", &[("10-4-3", 9.0)]),
    ("/ is right-associative", &[("16/4/2", 8.0)]),
    ("all operators bind alike, from the left", &[("2^3^2", 64.0), ("2*3^2", 36.0), ("2+3*4", 20.0)]),
    ("^ binds as * does", &[("2^3^2", 64.0), ("2*3^2", 36.0)]),
    ("the division of integers drops the fraction", &[("7/2", 3.0)]),
    ("the angle of sin is taken for degrees", &[("sin(t)", 0.008_726_535_498_373_935)]),
    ("ln is the decimal logarithm", &[("ln(t + 1)", 0.176_091_259_055_681_24)]),
    ("parentheses are ignored", &[("(1+2)*3", 7.0)]),
];

pub(super) fn of_expressions(bench: &mut Bench) -> Result<Diagnosis, String> {
    let mut got = Vec::new();
    for (function, _) in EXPRESSIONS {
        // By forward Euler the velocity grows by the value times the timestep.
        let answer = bench.integrate(function, [0.0, 0.0, 0.5], 2, "euler");
        let value = answer.ok().and_then(|[_, _, v]| Some((v.get(2)? - v.get(1)?) / 0.5));
        got.push(value.unwrap_or(f64::NAN));
    }
    let right = EXPRESSIONS.map(|(_, value)| value);
    let model = |changes: &[(&str, f64)]| {
        EXPRESSIONS.map(|(function, value)| changes.iter().find(|(name, _)| *name == function).map_or(value, |(_, value)| *value))
    };
    let mut models: Vec<(String, f64)> =
        OF_EXPRESSIONS.iter().map(|(says, changes)| ((*says).to_owned(), distance(&got, &model(changes)))).collect();
    models.push(("ln is the logarithm to base 2".to_owned(), distance(&got, &model(&[("ln(t + 1)", 1.5_f64.ln() / LN_2)]))));
    Ok(Diagnosis { cause: verdict(distance(&got, &right), models, NEAR, RATIO, FLOOR), plot: None })
}

/// What a wrong solution says, as the end effector that its author believes in.
type Believed = fn(&Arm, &[f64]) -> (f64, f64, f64);

fn first(arm: &Arm, pose: &[f64], change: fn(usize, f64, &[f64]) -> f64) -> (f64, f64, f64) {
    let pose: Vec<f64> = pose.iter().enumerate().map(|(at, angle)| change(at, *angle, pose)).collect();
    arm.end_effector(&pose)
}

fn of_lengths(arm: &Arm, pose: &[f64], change: fn(&mut Vec<f64>)) -> (f64, f64, f64) {
    let mut arm = arm.clone();
    change(&mut arm.lengths);
    arm.end_effector(pose)
}

const OF_KINEMATICS: [(&str, Believed); 10] = [
    ("the solution has absolute instead of relative angles", |arm, pose| {
        first(arm, pose, |at, angle, pose| if at == 0 { angle } else { angle - pose.get(at - 1).copied().unwrap_or_default() })
    }),
    ("the solution is in degrees", |arm, pose| first(arm, pose, |_, angle, _| angle.to_radians())),
    ("the two joints have different elbows: the sign of joint 2 is that of the other solution", |arm, pose| {
        first(arm, pose, |at, angle, _| if at == 1 { -angle } else { angle })
    }),
    ("x and y are exchanged, as in atan2(x, y)", |arm, pose| {
        let (x, y, phi) = arm.end_effector(pose);
        (y, x, phi)
    }),
    ("y points down", |arm, pose| {
        let (x, y, phi) = arm.end_effector(pose);
        (x, -y, phi)
    }),
    ("joint 2 is the inner angle of the elbow: pi minus the right one", |arm, pose| {
        first(arm, pose, |at, angle, _| if at == 1 { PI - angle } else { angle })
    }),
    ("the lengths of the links are not used: they stay 1 m", |arm, pose| of_lengths(arm, pose, |lengths| lengths.fill(1.0))),
    ("the lengths of the first two links are exchanged", |arm, pose| of_lengths(arm, pose, |lengths| lengths.swap(0, 1))),
    ("the last joint has phi itself: the angles before it are not subtracted", |arm, pose| {
        first(arm, pose, |at, angle, pose| if at == 2 { angle - pose.iter().take(2).sum::<f64>() } else { angle })
    }),
    ("the wrist lies beyond the target: the last link is added instead of subtracted", |arm, pose| {
        of_lengths(arm, pose, |lengths| lengths.iter_mut().skip(2).for_each(|length| *length = -*length))
    }),
];

pub(super) fn of_kinematics(bench: &mut Bench) -> Result<Diagnosis, String> {
    let arm = Arm { lengths: [1.2, 0.9, 0.4].into_iter().take(bench.links).collect(), ..Arm::of(bench.links, 9.81) };
    bench.set_arm(&arm)?;
    let mut asked = Vec::new();
    for at in 0..8 {
        let pose: Vec<f64> = [0.4 + 0.3 * f64::from(at), 2.4 - 0.1 * f64::from(at), -0.6].into_iter().take(bench.links).collect();
        let (x, y, phi) = arm.end_effector(&pose);
        let args = if bench.links == 3 { json!({"x": x, "y": y, "phi": phi}) } else { json!({"x": x, "y": y}) };
        // A wrong solver may reject some targets.
        if let Ok(pose) = solution(bench, &args) {
            asked.push(((x, y, phi), pose));
        }
    }
    if asked.len() < 4 {
        return Err("too few targets are solved".to_owned());
    }
    let links = bench.links;
    let far = |believed: &dyn Fn(&Arm, &[f64]) -> (f64, f64, f64)| {
        let each = asked.iter().map(|((x, y, phi), pose)| {
            let (own_x, own_y, own_phi) = believed(&arm, pose);
            let turned = (own_phi - phi + PI).rem_euclid(TAU) - PI;
            distance(&[own_x, own_y, if links == 3 { turned } else { 0.0 }], &[*x, *y, 0.0])
        });
        each.fold(0.0, f64::max)
    };
    let of_links = OF_KINEMATICS.iter().take(if links == 3 { 10 } else { 8 });
    let models = of_links.map(|(says, believed)| ((*says).to_owned(), far(believed))).collect();
    Ok(Diagnosis { cause: verdict(far(&|arm, pose| arm.end_effector(pose)), models, NEAR, RATIO, 1e-9), plot: None })
}

/// Gains of the experiment, one for each joint.
const GAINS: [f64; 3] = [0.5, 0.3, 0.2];

/// What the right law gives: the proportional term of joints 1 and 2, and for an error of 7 rad; the derivative term at rest and
/// in motion; the growth of the integral term; and its part that is left after enable and after reset.
const LAW: [f64; 8] = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0];

const OF_LAW: [(&str, [f64; 8]); 14] = [
    ("the position error has the wrong sign", [-1.0, -1.0, -1.0, 1.0, 1.0, -1.0, 0.0, 0.0]),
    ("the proportional term has the wrong sign", [-1.0, -1.0, -1.0, 1.0, 1.0, 1.0, 0.0, 0.0]),
    ("the proportional term is missing", [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0]),
    ("all joints have the kp of joint 1", [1.0, GAINS[0] / GAINS[1], 1.0, 1.0, 1.0, 1.0, 0.0, 0.0]),
    ("the position error is wrapped to (-pi, pi]", [1.0, 1.0, (7.0 - TAU) / 7.0, 1.0, 1.0, 1.0, 0.0, 0.0]),
    ("the derivative term has the wrong sign", [1.0, 1.0, 1.0, -1.0, -1.0, 1.0, 0.0, 0.0]),
    ("the derivative term is missing", [1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0]),
    ("the derivative term ignores the velocity of the setpoint", [1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0]),
    ("the integral term has the wrong sign", [1.0, 1.0, 1.0, 1.0, 1.0, -1.0, 0.0, 0.0]),
    ("the integral term is missing", [1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]),
    ("the integral is summed without the timestep", [1.0, 1.0, 1.0, 1.0, 1.0, 1000.0, 0.0, 0.0]),
    ("enable does not clear the integral", [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0]),
    ("reset does not clear the integral", [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 1.0]),
    ("neither enable nor reset clears the integral", [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]),
];

/// The integral gain and the position error: so small that the arm hardly moves, and that no limit of the integral is reached, even
/// if it is summed without the timestep.
const KI: f64 = 5e-4;
const ERROR: f64 = 0.01;

pub(super) fn of_law(bench: &mut Bench) -> Result<Diagnosis, String> {
    let set_gains = |bench: &mut Bench, kp: &[f64], ki: f64, kd: f64| {
        let gains = json!({"kp": kp.iter().take(bench.links).collect::<Vec<_>>(), "ki": bench.each(ki), "kd": bench.each(kd)});
        bench.accepted("/pid_controller/set_gains", &gains).map(drop)
    };
    let at = |values: &[f64], joint: usize| values.get(joint).copied().unwrap_or(f64::NAN);
    let mut got = Vec::new();
    for error in [0.6, 7.0] {
        let pose = bench.float(0.0, 0.0, 0.0)?;
        set_gains(bench, &GAINS, 0.0, 0.0)?;
        bench.hold(&shifted(&pose, error))?;
        let joints = bench.fresh()?;
        for joint in 0..if error < 1.0 { 2 } else { 1 } {
            got.push(at(&joints.effort, joint) / (at(&GAINS, joint) * (at(&pose, joint) + error - at(&joints.position, joint))));
        }
    }
    let pose = bench.float(0.0, 0.0, 0.3)?;
    bench.command(&json!([crate::bench::point(&pose, &bench.each(0.5))]))?;
    let joints = bench.fresh()?;
    got.push(at(&joints.effort, 0) / (0.3 * (0.5 - at(&joints.velocity, 0))));
    // Gravity moves the arm, because the controller may not. At an equilibrium it has to.
    bench.enable(false)?;
    bench.set_gravity(GRAVITY)?;
    bench.reset()?;
    std::thread::sleep(Duration::from_millis(250));
    if largest(&bench.fresh()?.velocity) < 0.1 {
        bench.swing()?;
    }
    set_gains(bench, &[0.0; 3], 0.0, 0.1)?;
    bench.enable(true)?;
    let joints = bench.fresh()?;
    got.push(at(&joints.effort, 0) / (-0.1 * at(&joints.velocity, 0)));
    let pose = bench.float(0.0, KI, 0.0)?;
    bench.hold(&shifted(&pose, ERROR))?;
    let states = bench.joints_for(0.8)?;
    let [begin, .., end] = states.as_slice() else { return Err("no joint states".to_owned()) };
    let mean = ERROR + at(&pose, 0) - 0.5 * (at(&begin.position, 0) + at(&end.position, 0));
    got.push((at(&end.effort, 0) - at(&begin.effort, 0)) / (KI * mean * (end.stamp - begin.stamp)));
    let least = 0.1 * KI * ERROR;
    let wound = largest(&end.effort).max(least);
    bench.enable(false)?;
    must(largest(&bench.fresh()?.effort) == 0.0, || "a controller that stays on has no integral to clear".to_owned())?;
    bench.enable(true)?;
    got.push(kept(largest(&bench.fresh()?.effort) / wound));
    std::thread::sleep(Duration::from_millis(500));
    let wound = largest(&bench.fresh()?.effort).max(least);
    bench.reset()?;
    got.push(kept(largest(&bench.fresh()?.effort) / wound));
    let models = OF_LAW.iter().map(|(says, model)| ((*says).to_owned(), distance(&got, model))).collect();
    Ok(Diagnosis { cause: verdict(distance(&got, &LAW), models, 0.05, MEASURED_RATIO, 0.02), plot: None })
}

/// The stay in the experiment on goals [s].
const STAY: f64 = 1.0;

pub(super) fn of_dwell(bench: &mut Bench) -> Result<Diagnosis, String> {
    let mut goal = goals::wide(bench);
    set(&mut goal, "success_hold", json!(STAY));
    goals::listen(bench)?;
    let began = Instant::now();
    let id = bench.send_goal(&goal)?;
    goals::result(bench, &id, Duration::from_secs_f64(3.0 * STAY))?;
    let got = kept(began.elapsed().as_secs_f64() / STAY);
    let models = vec![("the goal is reached at the first entry, without the stay of success_hold".to_owned(), distance(&[got], &[0.0]))];
    Ok(Diagnosis { cause: verdict(distance(&[got], &[1.0]), models, 0.05, MEASURED_RATIO, 0.02), plot: None })
}

/// Whether an effort is left, as 0 or 1: its size depends on the time until it is read.
fn kept(ratio: f64) -> f64 {
    match ratio {
        ratio if ratio < 0.3 => 0.0,
        ratio if ratio > 0.7 => 1.0,
        ratio => ratio,
    }
}
