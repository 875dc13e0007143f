//! "Dynamics".

use std::time::Duration;

use serde_json::json;

use crate::arm::Arm;
use crate::bench::{Bench, GRAVITY, Joints, shifted};
use crate::rules::control_services::uneven;
use crate::rules::pid::held;
use crate::values::{largest, list, minus, must, numbers_of};
use crate::{Check, Got};

/// The checks of this part.
pub const CHECKS: &[Check] = &[
    ("dynamics-1", |bench| {
        let arm = bench.arm()?;
        let pose = bench.reset()?;
        let load = largest(&arm.gravity_load(&pose));
        let joints = bench.joints_for(0.3)?.pop().ok_or("no joint states")?;
        let moved = largest(&minus(&joints.position, &pose));
        must(moved > 0.01 || load < 1e-9, || format!("moved {moved:.6} rad under a gravity load of {load:.2} N m"))?;
        Ok(format!("moved {moved:.3} rad"))
    }),
    ("dynamics-2", |bench| {
        let arm = Arm::of(bench.links, GRAVITY);
        holds(bench, &arm, [-0.6, 0.9, -0.5])?;
        holds(bench, &arm, [0.4, 0.3, 0.6])
    }),
    ("dynamics-3", |bench| {
        let arm = uneven(bench.links);
        bench.set_arm(&arm)?;
        holds(bench, &arm, [0.4, -1.0, 0.7])
    }),
    ("dynamics-4", |bench| {
        let pose = bench.float(0.0, 0.0, 0.0)?;
        let mut kp = bench.each(0.0);
        kp.splice(..1, [5.0]);
        bench.accepted("/pid_controller/set_gains", &json!({"kp": kp}))?;
        bench.hold(&shifted(&pose, 1.0))?;
        let Joints { velocity, effort, .. } = bench.joints_for(0.3)?.pop().ok_or("no joint states")?;
        let others = velocity.iter().zip(&effort).skip(1);
        for (rate, effort) in others {
            must(*effort == 0.0 && rate.abs() > 0.05, || format!("rates {}, efforts {}", list(&velocity), list(&[*effort])))?;
        }
        Ok(format!("rates {}", list(&velocity)))
    }),
    ("dynamics-5", |bench| {
        let arm = uneven(bench.links);
        bench.set_arm(&arm)?;
        bench.swing()?;
        let states: Vec<_> = bench.joints_for(0.5)?.iter().map(Joints::state).collect();
        let kinetic: Vec<f64> = states.iter().map(|state| arm.kinetic(state)).collect();
        let total: Vec<f64> = states.iter().zip(&kinetic).map(|(state, kinetic)| kinetic + arm.potential(&state.position)).collect();
        let exchanged = deviation(&kinetic, 1.0);
        must(exchanged > 0.1, || format!("kinetic energy changes by {exchanged:.4} J only"))?;
        let error = deviation(&total, exchanged);
        must(error < 1e-3, || format!("energy changes by {:.3} % of the {exchanged:.2} J exchanged", 100.0 * error))?;
        Ok(format!("constant to {error:.1e} while {exchanged:.2} J are exchanged"))
    }),
    ("dynamics-6", |bench| {
        let mut arm = uneven(bench.links);
        arm.gravity = 0.0;
        bench.set_arm(&arm)?;
        bench.swing()?;
        let momenta: Vec<f64> = bench.joints_for(0.5)?.iter().map(|joints| arm.momentum(&joints.state())).collect();
        let size = largest(&momenta);
        must(size > 0.1, || format!("an angular momentum of {size:.4} only"))?;
        let error = deviation(&momenta, size);
        must(error < 1e-3, || format!("it changes by {:.3} % of {size:.3} kg m^2/s", 100.0 * error))?;
        Ok(format!("{size:.3} kg m^2/s, constant to {error:.1e}"))
    }),
    ("dynamics-7", |bench| {
        bench.set_gravity(0.0)?;
        bench.swing()?;
        let states = bench.joints_for(0.6)?;
        let size = states.iter().map(|joints| largest(&joints.velocity)).fold(0.0, f64::max);
        let mut changes = Vec::new();
        for joint in 0..bench.links {
            let rates: Vec<f64> = states.iter().filter_map(|joints| joints.velocity.get(joint).copied()).collect();
            changes.push(deviation(&rates, size));
        }
        must(changes.iter().all(|change| *change > 0.02), || format!("relative changes {}", list(&changes)))?;
        Ok(format!("relative changes {}", list(&changes)))
    }),
    ("dynamics-8", |bench| {
        let got = diverged(bench);
        calm(bench)?;
        bench.reset()?;
        got
    }),
    ("dynamics-9", |bench| {
        let pose = bench.reset()?;
        let how = diverged(bench)?;
        calm(bench)?;
        bench.pause(true)?;
        bench.reset()?;
        bench.forget("/joint_states");
        let joints = bench.fresh()?;
        crate::values::near("position", &joints.position, &pose, 1e-9)?;
        bench.pause(false)?;
        Ok(format!("the starting pose after {how}"))
    }),
];

/// Holds a pose near the starting pose; passes if the effort there is the arm's gravity load.
fn holds(bench: &mut Bench, arm: &Arm, by: [f64; 3]) -> Got {
    held(bench, by, false)?;
    let Joints { position, effort, .. } = bench.at_rest()?;
    let load = arm.gravity_load(&position);
    let error = largest(&minus(&effort, &load)) / (largest(&load) + 1.0);
    must(error < 0.02, || format!("effort {} where G(q) is {}", list(&effort), list(&load)))?;
    Ok(format!("effort {}, G(q) {}", list(&effort), list(&load)))
}

/// The largest deviation of a quantity from its first value, over that value's size.
fn deviation(values: &[f64], size: f64) -> f64 {
    let first = values.first().copied().unwrap_or(f64::NAN);
    largest(&values.iter().map(|value| value - first).collect::<Vec<f64>>()) / size
}

/// Runs an aggressive controller at a timestep of 0.1 s. Returns the sign of divergence.
fn diverged(bench: &mut Bench) -> Got {
    let pose = bench.reset()?;
    bench.set_gains(2000.0, 0.0, 200.0)?;
    bench.accepted("/arm_sim/set_integrator", &json!({"method": "rk4", "timestep": 0.1}))?;
    bench.hold(&shifted(&pose, 1.0))?;
    bench.enable(true)?;
    bench.watch("/joint_states")?;
    let end = std::time::Instant::now() + Duration::from_secs(5);
    let mut worst: f64 = 0.0;
    while std::time::Instant::now() < end {
        let msg = bench.message("/joint_states", Duration::from_secs(3))?;
        // A state that is not finite may be published as null.
        let Ok(velocity) = numbers_of(&msg, "velocity", bench.links) else {
            return Ok("a rate that is not finite".to_owned());
        };
        worst = worst.max(largest(&velocity));
        if worst > 1e4 {
            return Ok(format!("{worst:.1e} rad/s"));
        }
    }
    Err(format!("at most {worst:.1} rad/s in 5 s"))
}

/// The next rule needs an arm that answers at its usual pace.
fn calm(bench: &mut Bench) -> Result<(), String> {
    bench.enable(false)?;
    bench.accepted("/arm_sim/set_integrator", &json!({"timestep": 0.001})).map(drop)
}
