//! Heavy computations, whose results are known beforehand by other means.
//!
//! **Invariant:** no formula here is the program's: constant forces have closed forms, and a free arm keeps its energy.

use std::rc::Rc;
use std::time::Duration;

use serde_json::{Value, json};

use crate::ledger::{anything, succeeded};
use crate::wire::{Client, Door};
use crate::world::{Fault, World};

/// The part of a limit that is advised.
const ADVISED_PART: f64 = 0.8;
const METHODS: [&str; 4] = ["euler", "midpoint", "verlet", "rk4"];

/// Some heavy calls at once; their answers may come in any order.
pub async fn compute(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let mut client = Client::connect(&world, "computing client", Door::any(&mut rng)).await?;
    for _ in 0..rng.usize(1..6) {
        match rng.u8(..4) {
            0 => push_rollout(&mut client, &mut rng),
            1 => push_stability(&mut client, &mut rng),
            _ => {
                let steps = rng.u64(1..20_000);
                push_integration(&mut client, &mut rng, steps);
            }
        }
    }
    client.settle(|_| Ok(())).await
}

/// The same, gone before the answers; more than may wait, so that it is not even read.
pub async fn vanish(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let mut client = Client::connect(&world, "computing client that vanishes", Door::Tcp).await?;
    for _ in 0..rng.usize(1..40) {
        let args = json!({"function": "sin(t)^2+exp(-t)", "x0": 1, "dt": 1e-4, "steps": rng.u64(1000..200_000),
            "integrator": "rk4"});
        client.push_call(
            "/arm_sim/integration_step",
            args,
            json!({}),
            false,
            anything(),
        );
    }
    let bytes = client.take_out();
    client.send_deaf(&bytes, Duration::from_secs(1)).await;
    world.count("calls left behind", client.ledger.waiting() as u64);
    tokio::time::sleep(Duration::from_millis(rng.u64(..400))).await;
    if rng.bool() {
        client.reset();
    }
    Ok(())
}

/// A particle under a constant force: every method has a closed form for it.
pub fn push_integration(client: &mut Client, rng: &mut fastrand::Rng, steps: u64) {
    let x0 = client.world.number() as f64;
    let force = f64::from(rng.u32(1..1000)) / 16.0;
    let (v0, dt) = (f64::from(rng.i32(-100..100)) / 8.0, 1.0 / 1024.0);
    let method = METHODS[rng.usize(..METHODS.len())];
    let args = json!({"function": force.to_string(), "x0": x0, "xdot0": v0, "dt": dt, "steps": steps,
        "integrator": method});
    let check = move |response: &Value| {
        succeeded(response)?;
        let values = &response["values"];
        for key in ["times", "positions", "velocities"] {
            if values[key].as_array().map(Vec::len) != Some(steps as usize + 1) {
                return Err(format!("{key} are not {steps} and one"));
            }
        }
        for k in [0, 1, steps / 3, steps / 2, steps - 1, steps] {
            let t = k as f64 * dt;
            // Euler moves with the velocity at the start of each step, so it lags by half a step's gain in every one.
            let lag = if method == "euler" {
                0.5 * force * dt * t
            } else {
                0.0
            };
            let expected = [t, x0 + v0 * t + 0.5 * force * t * t - lag, v0 + force * t];
            for (key, expected) in ["times", "positions", "velocities"]
                .into_iter()
                .zip(expected)
            {
                let got = values[key][k as usize].as_f64().unwrap_or(f64::NAN);
                // Sums are compensated: some roundings of the largest term, which is not much above 1e6 here.
                if (got - expected).abs() > 1e-9 * expected.abs().max(1.0) || got.is_nan() {
                    return Err(format!("{method}, {key}[{k}] is {got}, not {expected}"));
                }
            }
        }
        Ok(())
    };
    client.world.count("computations asked", 1);
    // The program sets this aside: three numbers of up to 32 characters for every step.
    client.push_call(
        "/arm_sim/integration_step",
        args,
        json!({}),
        false,
        Box::new(check),
    );
}

/// An arm left to itself from a pose of this call's own.
fn push_rollout(client: &mut Client, rng: &mut fastrand::Rng) {
    let q0 = client.world.number() as f64 / 1024.0;
    let samples = rng.u64(2..500);
    let args = json!({"q0": [q0, 0.5], "duration": 2.0, "timestep": 0.001, "integrator": "rk4", "samples": samples,
        "params": {"gravity": 9.81, "masses": [1, 1], "lengths": [1, 1]}});
    let check = move |response: &Value| {
        succeeded(response)?;
        let values = &response["values"];
        let start = &values["positions"][0];
        if *start != json!([q0, 0.5]) || values["evaluations"] != 8000 {
            return Err(format!(
                "begins at {start} with {} evaluations",
                values["evaluations"]
            ));
        }
        let energy: Vec<f64> = values["energy"]
            .as_array()
            .into_iter()
            .flatten()
            .filter_map(Value::as_f64)
            .collect();
        // The fastest swings of this arm turn by some 0.02 rad a step. Runge-Kutta 4 is off by the fifth power of that
        // in each of 2000 steps, in parts of some 40 J: below 1e-3 J with room to spare.
        let drift = energy
            .iter()
            .fold(0.0_f64, |most, now| most.max((now - energy[0]).abs()));
        if energy.len() != samples as usize || drift.is_nan() || drift > 1e-3 {
            return Err(format!(
                "energy of {} samples, off by {drift} J",
                energy.len()
            ));
        }
        Ok(())
    };
    client.world.count("computations asked", 1);
    client.push_call("/study/rollout", args, json!({}), false, Box::new(check));
}

/// The limit of an arm with these gains, which the README gives.
fn push_stability(client: &mut Client, rng: &mut fastrand::Rng) {
    let integrator = METHODS[rng.usize(1..METHODS.len())];
    let args = json!({"integrator": integrator,
        "gains": {"kp": [1000, 250], "ki": [3000, 750], "kd": [110, 22]},
        "params": {"gravity": 9.81, "masses": [1, 1], "lengths": [1, 1]}, "setpoint": [0, 0]});
    let check = |response: &Value| {
        succeeded(response)?;
        let limit = response["values"]["timestep_limit_held"]
            .as_f64()
            .unwrap_or(f64::NAN);
        let advised = response["values"]["advised_timestep"]
            .as_f64()
            .unwrap_or(f64::NAN);
        // The advice is the smaller of two: the loop's limit in every pose, and that of the live arm's motion, which others push.
        let motion = response["values"]["timestep_limit_motion"]
            .as_f64()
            .map_or(f64::INFINITY, |motion| ADVISED_PART * motion);
        let is_for_motion = (advised / motion - 1.0).abs() < 1e-9;
        let is_advised = is_for_motion || advised > 0.002 && advised < motion;
        if limit > 0.002 && limit < 0.02 && is_advised && advised > 0.0 && advised < limit {
            return Ok(());
        }
        Err(format!(
            "a limit of {limit} s, {advised} s advised, {motion} s for the motion"
        ))
    };
    client.world.count("computations asked", 1);
    client.push_call("/study/stability", args, json!({}), false, Box::new(check));
}
