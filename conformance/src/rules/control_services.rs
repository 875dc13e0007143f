//! "Simulation-control services".

use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::arm::Arm;
use crate::bench::{Bench, GRAVITY, apply_alone, has, is_query, is_switched, point, same, shifted};
use crate::rules::pid::{SMALL, changes, wound_up};
use crate::values::{largest, list, must, near, number, numbers_of};
use crate::{Check, Got};

/// The checks of this part.
pub const CHECKS: &[Check] = &[
    ("set_integrator-1", |bench| {
        for method in crate::method::METHODS {
            bench.accepted(SET_INTEGRATOR, &json!({"method": method, "timestep": 0.002}))?;
            let values = bench.accepted(SET_INTEGRATOR, &json!({}))?;
            has(&json!({"method": method, "timestep": 0.002}), &values)?;
        }
        Ok("all four".to_owned())
    }),
    ("set_integrator-2", |bench| {
        let before = json!({"method": "rk4", "timestep": 0.001});
        apply_alone(bench, SET_INTEGRATOR, before, &[("method", json!("verlet")), ("timestep", json!(0.003))])
    }),
    ("set_integrator-3", |bench| is_query(bench, SET_INTEGRATOR, &["method", "timestep"])),
    ("set_integrator-4", |bench| rejects_and_keeps(bench, SET_INTEGRATOR, &json!({"method": "leapfrog"}), &json!({"method": "rk4"}))),
    ("set_integrator-5", |bench| {
        rejects_and_keeps(bench, SET_INTEGRATOR, &json!({"timestep": 0}), &json!({"timestep": 0.001}))?;
        rejects_and_keeps(bench, SET_INTEGRATOR, &json!({"timestep": -0.001}), &json!({"timestep": 0.001}))
    }),
    ("set_integrator-6", |bench| steps_by(bench, "euler")),
    ("set_integrator-7", |bench| steps_by(bench, "midpoint")),
    ("set_integrator-8", |bench| steps_by(bench, "verlet")),
    ("set_integrator-9", |bench| steps_by(bench, "rk4")),
    ("set_params-1", |bench| {
        let values = bench.found()?.setting(SET_PARAMS)?;
        let gravity = number(&values, "gravity")?;
        near("gravity", &[gravity], &[GRAVITY], 1e-9)?;
        Ok(gravity.to_string())
    }),
    ("set_params-2", |bench| {
        let arm = bench.arm()?;
        let is_positive = arm.masses.iter().chain(&arm.lengths).all(|value| *value > 0.0);
        must(is_positive, || format!("masses {}, lengths {}", list(&arm.masses), list(&arm.lengths)))?;
        is_query(bench, SET_PARAMS, &PARAMS)
    }),
    ("set_params-3", |bench| {
        let before = json!({"gravity": 9.81, "masses": bench.each(1.0), "lengths": bench.each(1.0)});
        let changes = [("gravity", json!(5.0)), ("masses", json!(bench.each(1.5))), ("lengths", json!(bench.each(0.75)))];
        apply_alone(bench, SET_PARAMS, before, &changes)
    }),
    ("set_params-4", |bench| {
        let long = vec![1.0; bench.links + 1];
        rejects_arrays(bench, [&[2.0], &long])
    }),
    ("set_params-5", |bench| {
        let [mut zero, mut negative] = [bench.each(1.0), bench.each(1.0)];
        zero.splice(..1, [0.0]);
        negative.splice(..1, [-1.0]);
        rejects_arrays(bench, [&zero, &negative])
    }),
    ("set_params-6", |bench| {
        let request = json!({"gravity": -9.81, "masses": bench.each(2.0)});
        let expected = json!({"gravity": 9.81, "masses": bench.each(2.0), "lengths": bench.each(1.0)});
        rejects_and_keeps(bench, SET_PARAMS, &request, &expected)
    }),
    ("set_params-7", |bench| {
        let answer = bench.rejected(SET_PARAMS, &json!({"gravity": -1.0, "lengths": bench.each(0.5)}))?;
        let expected = json!({"gravity": 9.81, "masses": bench.each(1.0), "lengths": bench.each(0.5)});
        has(&expected, &answer.values)?;
        Ok(answer.values.to_string())
    }),
    ("set_params-8", |bench| {
        let arm = uneven(bench.links);
        bench.set_arm(&arm)?;
        bench.swing()?;
        bench.accepted(SET_INTEGRATOR, &json!({"timestep": 0.005}))?;
        let steps = bench.follows(&arm, "rk4", 0.005)?;
        Ok(format!("{steps} steps of that arm"))
    }),
    ("set_params-9", |bench| {
        bench.set_gravity(0.0)?;
        let pose = bench.reset()?;
        bench.stays_at(&pose, 0.4, 1e-9)
    }),
    ("pause-1", |bench| {
        bench.swing()?;
        bench.pause(true)?;
        let states = bench.joints_for(0.4)?;
        let first = states.first().ok_or("no joint states")?;
        must(largest(&first.velocity) > 0.0, || "the arm was at rest before".to_owned())?;
        for joints in &states {
            near("position", &joints.position, &first.position, 1e-12)?;
            near("velocity", &joints.velocity, &first.velocity, 1e-12)?;
        }
        Ok(format!("{} messages with one state", states.len()))
    }),
    ("pause-2", |bench| {
        bench.pause(true)?;
        bench.accepted(SET_PARAMS, &json!({"gravity": 3.0}))?;
        bench.accepted(SET_INTEGRATOR, &json!({"timestep": 0.002}))?;
        bench.set_gains(1.0, 0.0, 0.0)?;
        bench.enable(true)?;
        bench.integrate("t", [0.0, 0.0, 0.1], 2, "rk4")?;
        bench.accepted("/ik/solve", &json!({"x": 1.0, "y": 0.5}))?;
        bench.reset()?;
        Ok("7 accepted calls".to_owned())
    }),
    ("pause-3", |bench| {
        bench.swing()?;
        bench.accepted(SET_INTEGRATOR, &json!({"timestep": 0.005}))?;
        bench.pause(true)?;
        let frozen = bench.fresh()?;
        sleep(Duration::from_millis(400));
        let resumed = Instant::now();
        bench.pause(false)?;
        let after = bench.fresh()?;
        // The arm can only have moved while it was running again, with some tolerance for its clock.
        let limit = (resumed.elapsed().as_secs_f64() + 0.2) / 0.005;
        let arm = Arm::of(bench.links, GRAVITY);
        let (mut own, mut steps) = (frozen.state(), 0);
        while f64::from(steps) < limit {
            if near("position", &after.position, &own.position, 1e-6).is_ok() {
                must(steps > 0, || "the arm does not move again".to_owned())?;
                return Ok(format!("{steps} steps after the frozen state"));
            }
            own = crate::method::step("rk4", &own, 0.0, 0.005, |_, q, v| arm.free_acceleration(q, v));
            steps += 1;
        }
        Err(format!("{} does not follow from {} in {limit:.0} steps", list(&after.position), list(&frozen.position)))
    }),
    ("pause-4", |bench| is_switched(bench, "/arm_sim/pause")),
    ("pause-5", |bench| {
        wound_up(bench, 500)?;
        bench.pause(true)?;
        let before = bench.fresh()?.effort;
        sleep(Duration::from_millis(700));
        bench.pause(false)?;
        let after = bench.fresh()?.effort;
        changes(&before, &after, |before, after| before > 0.0 && after < 1.7 * before)
    }),
    ("reset-1", |bench| {
        let mut answers = Vec::new();
        for milliseconds in [0, 300] {
            bench.swing()?;
            sleep(Duration::from_millis(milliseconds));
            let values = bench.accepted("/arm_sim/reset", &json!({}))?;
            answers.push((numbers_of(&values, "position", bench.links)?, numbers_of(&values, "velocity", bench.links)?));
        }
        let [(first, rate), (second, other)] = answers.as_slice() else {
            return Err("no answers".to_owned());
        };
        near("position", second, first, 1e-12)?;
        near("velocity", other, rate, 1e-12)?;
        Ok(list(first))
    }),
    ("reset-2", |bench| {
        bench.swing()?;
        bench.pause(true)?;
        let pose = bench.reset()?;
        let joints = bench.fresh()?;
        near("position", &joints.position, &pose, 1e-9)?;
        Ok(list(&joints.position))
    }),
    ("reset-3", |bench| {
        let pose = bench.float(0.5, 0.0, 0.5)?;
        bench.command(&json!([point(&shifted(&pose, 1.0), &bench.each(0.5))]))?;
        sleep(Duration::from_millis(300));
        bench.reset()?;
        bench.stays_at(&pose, 0.2, 1e-6)
    }),
    ("reset-4", |bench| {
        let before = wound_up(bench, 500)?;
        bench.reset()?;
        let after = bench.fresh()?.effort;
        changes(&before, &after, |_, after| after.abs() < 0.01 * SMALL)
    }),
    ("reset-5", |bench| {
        sleep(Duration::from_millis(1200));
        bench.reset()?;
        let stamp = bench.fresh()?.stamp;
        // Wall time counts from 1970.
        must(!(1.0..1e9).contains(&stamp), || format!("{stamp} s"))?;
        Ok(format!("{stamp:.3} s"))
    }),
    ("reset-6", |bench| {
        bench.accepted(SET_INTEGRATOR, &json!({"method": "verlet", "timestep": 0.002}))?;
        bench.set_arm(&uneven(bench.links))?;
        bench.set_gains(4.0, 3.0, 2.0)?;
        bench.enable(true)?;
        bench.pause(true)?;
        let services: [(&str, &[&str]); 5] = [
            (SET_INTEGRATOR, &["method", "timestep"]),
            (SET_PARAMS, &PARAMS),
            ("/pid_controller/set_gains", &["kp", "ki", "kd"]),
            ("/pid_controller/enable", &["data"]),
            ("/arm_sim/pause", &["data"]),
        ];
        let mut before = Vec::new();
        for (service, _) in services {
            before.push(bench.accepted(service, &json!({}))?);
        }
        bench.reset()?;
        for ((service, members), before) in services.into_iter().zip(&before) {
            let after = bench.accepted(service, &json!({}))?;
            same(before, &after, members).map_err(|why| format!("{service}: {why}"))?;
        }
        Ok("all as before".to_owned())
    }),
];

const SET_INTEGRATOR: &str = "/arm_sim/set_integrator";
const SET_PARAMS: &str = "/arm_sim/set_params";
const PARAMS: [&str; 3] = ["gravity", "masses", "lengths"];

/// Passes if the request is rejected, and the service then returns the members of `expected`.
fn rejects_and_keeps(bench: &mut Bench, service: &str, request: &Value, expected: &Value) -> Got {
    let status = bench.rejected(service, request)?.status;
    let values = bench.accepted(service, &json!({}))?;
    has(expected, &values)?;
    Ok(status)
}

fn steps_by(bench: &mut Bench, method: &str) -> Got {
    bench.swing()?;
    bench.accepted(SET_INTEGRATOR, &json!({"method": method, "timestep": 0.01}))?;
    let arm = Arm::of(bench.links, GRAVITY);
    let steps = bench.follows(&arm, method, 0.01)?;
    Ok(format!("{steps} steps of {method}"))
}

/// Passes if each array in place of masses or lengths is rejected, and the gravity beside it is applied.
fn rejects_arrays(bench: &mut Bench, arrays: [&[f64]; 2]) -> Got {
    let mut status = String::new();
    for (name, array) in ["masses", "lengths"].into_iter().flat_map(|name| arrays.map(|array| (name, array))) {
        bench.set_gravity(GRAVITY)?;
        let expected = json!({"gravity": 2.5, "masses": bench.each(1.0), "lengths": bench.each(1.0)});
        status = rejects_and_keeps(bench, SET_PARAMS, &json!({"gravity": 2.5, name: array}), &expected)?;
    }
    Ok(status)
}

/// An arm whose links are all different.
pub(crate) fn uneven(links: usize) -> Arm {
    let take = |values: [f64; 3]| values.into_iter().take(links).collect();
    Arm { masses: take([1.4, 0.9, 0.6]), lengths: take([0.8, 1.1, 0.7]), gravity: 6.5 }
}
