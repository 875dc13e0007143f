//! "Inverse kinematics": `/ik/solve`.

use std::f64::consts::{PI, TAU};

use fastrand::Rng;
use serde_json::{Value, json};

use crate::arm::Arm;
use crate::bench::{Bench, GRAVITY};
use crate::values::{list, must, near, numbers_of};
use crate::{Check, Got};

const SOLVE: &str = "/ik/solve";

/// The checks of this part.
pub const CHECKS: &[Check] = &[
    ("ik-1", round_trip),
    ("ik-2", round_trip),
    ("ik-3", |bench| {
        let (mut draws, arm) = (Rng::with_seed(8), Arm::of(bench.links, GRAVITY));
        for _ in 0..10 {
            let (x, y, _) = arm.end_effector(&pose(&mut draws, bench.links));
            reaches(bench, &arm, &json!({"x": x, "y": y}), (x, y), None, 1e-6)?;
        }
        Ok("10 targets reached".to_owned())
    }),
    ("ik-4", |bench| {
        let arm = Arm::of(bench.links, GRAVITY);
        for phi in [-2.0, 0.0, 1.0, 100.0] {
            reaches(bench, &arm, &json!({"x": 1.1, "y": -0.6, "phi": phi}), (1.1, -0.6), None, 1e-6)?;
        }
        Ok("4 targets reached".to_owned())
    }),
    ("ik-5", |bench| {
        let wrong = [json!({"x": "1", "y": 1.0}), json!({"x": 1.0, "y": null}), json!({"x": 1.0, "y": [0.5]})];
        bench.rejects(SOLVE, &[json!({}), json!({"x": 1.0}), json!({"y": 1.0})])?;
        bench.rejects(SOLVE, &wrong)
    }),
    ("ik-6", |bench| {
        let reach = Arm::of(bench.links, GRAVITY).lengths.iter().sum::<f64>();
        rejects_at(bench, &[1.001 * reach, 10.0 * reach])
    }),
    ("ik-7", |bench| {
        bench.set_arm(&unequal())?;
        rejects_at(bench, &[0.399, 0.1, 0.0])
    }),
    ("ik-8", |bench| {
        // 1.5 m away, links of 1 m: with phi pointing back at the base the wrist is 2.5 m away.
        let arm = Arm::of(3, GRAVITY);
        let status = bench.rejected(SOLVE, &json!({"x": 1.5, "y": 0.0, "phi": PI}))?.status;
        reaches(bench, &arm, &json!({"x": 1.5, "y": 0.0, "phi": 0.0}), (1.5, 0.0), Some(0.0), 1e-6)?;
        Ok(status)
    }),
    ("ik-9", |bench| {
        let arm = Arm { lengths: [0.7, 0.3, 0.1].into_iter().take(bench.links).collect(), ..Arm::of(bench.links, GRAVITY) };
        bench.set_arm(&arm)?;
        let reach: f64 = arm.lengths.iter().sum();
        for heading in directions(24) {
            let (x, y) = (reach * heading.cos(), reach * heading.sin());
            let target = target(bench, x, y, heading);
            reaches(bench, &arm, &target, (x, y), None, 1e-4)?;
        }
        Ok("24 solutions".to_owned())
    }),
    ("ik-10", |bench| {
        let arm = unequal();
        bench.set_arm(&arm)?;
        for heading in directions(24) {
            let (x, y) = (0.4 * heading.cos(), 0.4 * heading.sin());
            reaches(bench, &arm, &json!({"x": x, "y": y}), (x, y), None, 1e-4)?;
        }
        Ok("24 solutions".to_owned())
    }),
    ("ik-11", |bench| {
        let long = Arm { lengths: bench.each(2.0), ..Arm::of(bench.links, GRAVITY) };
        bench.set_arm(&long)?;
        let far = 1.9 * bench.each(1.0).iter().sum::<f64>();
        let wide = target(bench, far, 0.1, 0.0);
        reaches(bench, &long, &wide, (far, 0.1), None, 1e-6)?;
        bench.set_arm(&Arm::of(bench.links, GRAVITY))?;
        bench.rejects(SOLVE, &[wide])
    }),
    ("ik-12", |bench| {
        bench.swing()?;
        bench.pause(true)?;
        let before = bench.fresh()?;
        let target = target(bench, 0.8, 0.9, 0.5);
        bench.accepted(SOLVE, &target)?;
        let after = bench.fresh()?;
        near("position", &after.position, &before.position, 1e-12)?;
        must(after.effort == before.effort, || format!("effort {} after {}", list(&after.effort), list(&before.effort)))?;
        Ok("the same state".to_owned())
    }),
];

/// Any pose of an arm.
fn pose(draws: &mut Rng, links: usize) -> Vec<f64> {
    (0..links).map(|_| TAU * (draws.f64() - 0.5)).collect()
}

/// The difference of two angles in whole turns taken away.
fn turned(angle: f64, other: f64) -> f64 {
    (angle - other + PI).rem_euclid(TAU) - PI
}

/// Solves and passes if the solution reaches the target to a tolerance.
fn reaches(bench: &mut Bench, arm: &Arm, target: &Value, (x, y): (f64, f64), phi: Option<f64>, tolerance: f64) -> Result<Vec<f64>, String> {
    let values = bench.accepted(SOLVE, target)?;
    let positions = numbers_of(&values, "positions", bench.links)?;
    let (got_x, got_y, heading) = arm.end_effector(&positions);
    near(&format!("x and y of {} for {target}", list(&positions)), &[got_x, got_y], &[x, y], tolerance)?;
    if let Some(phi) = phi {
        near(&format!("orientation error of {} for {target}", list(&positions)), &[turned(heading, phi)], &[0.0], tolerance)?;
    }
    Ok(positions)
}

fn target(bench: &Bench, x: f64, y: f64, phi: f64) -> Value {
    if bench.links == 3 { json!({"x": x, "y": y, "phi": phi}) } else { json!({"x": x, "y": y}) }
}

fn round_trip(bench: &mut Bench) -> Got {
    let mut draws = Rng::with_seed(7);
    let uneven = Arm { lengths: [0.9, 0.7, 0.4].into_iter().take(bench.links).collect(), ..Arm::of(bench.links, GRAVITY) };
    let mut last = Vec::new();
    for arm in [Arm::of(bench.links, GRAVITY), uneven] {
        bench.set_arm(&arm)?;
        for _ in 0..20 {
            let pose = pose(&mut draws, bench.links);
            let (x, y, phi) = arm.end_effector(&pose);
            let target = target(bench, x, y, phi);
            let phi = (bench.links == 3).then_some(phi);
            last = reaches(bench, &arm, &target, (x, y), phi, 1e-6)?;
        }
    }
    Ok(format!("40 targets reached, the last by {}", list(&last)))
}

fn directions(count: u32) -> impl Iterator<Item = f64> {
    (0..count).map(move |k| TAU * f64::from(k) / f64::from(count))
}

/// Passes if targets at these distances are rejected, in 8 directions.
fn rejects_at(bench: &mut Bench, distances: &[f64]) -> Got {
    let places = directions(8).flat_map(|heading| distances.iter().map(move |distance| (heading, distance)));
    let targets: Vec<Value> =
        places.map(|(heading, distance)| target(bench, distance * heading.cos(), distance * heading.sin(), heading)).collect();
    bench.rejects(SOLVE, &targets)
}

/// 2 links of 1 m and 0.6 m.
fn unequal() -> Arm {
    Arm { lengths: vec![1.0, 0.6], ..Arm::of(2, GRAVITY) }
}
