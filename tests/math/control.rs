//! The control law, against the discrete loop in 50 digits. `simulation/rules.rs` has its inputs.

use pendularm::math::arm::State;
use pendularm::math::pid::{Gains, INTEGRAL_LIMIT, Pid, Setpoint};
use pendularm::math::simulation::Simulation;
use serde_json::Value;

use crate::stored::{arm, array, entries, for_links, gains, list, method, number, start};

/// A closed loop of the oracle at its start.
fn simulation<const N: usize>(case: &Value) -> Simulation<N> {
    let [kp, ki, kd] = ["kp", "ki", "kd"].map(|name| array(&case[name]));
    let mut simulation = Simulation::new(arm(case), gains(kp, ki, kd));
    simulation.set_method(method(case));
    simulation.set_timestep(number(&case["dt"]));
    simulation.set_state(start(case));
    simulation.set_setpoint(Setpoint {
        position: array(&case["setpoint"]),
        velocity: array(&case["setpoint_vel"]),
    });
    simulation.enable(true);
    simulation
}

#[test]
fn the_closed_loop_agrees_with_50_digits_at_every_sample() {
    for case in entries(include_str!("../data/closed_loop.json"), "cases") {
        for_links!(case, check_loop(&case));
    }
}

/// Per sample `k` the oracle has the state after `k` steps, and the integral and the effort of step `k`.
fn check_loop<const N: usize>(case: &Value) {
    let mut simulation = simulation::<N>(case);
    for (k, sample) in list(&case["samples"]).into_iter().enumerate() {
        simulation.advance(sample as u64 - simulation.steps());
        assert_eq!(simulation.steps(), sample as u64);
        // The oracle's tolerance: a hundred times the error of a plain float64 run of the same loop, at least 1e-12.
        let tolerance = (100.0 * number(&case["float64_diff"][k])).max(1e-12);
        // An error of the state becomes an effort by way of the gains.
        let gain = |i: usize| ["kp", "ki", "kd"].map(|name| number(&case[name][i]));
        let gain = (0..N).map(|i| gain(i).iter().sum());
        let effort_tolerance = tolerance * gain.fold(1.0, f64::max);
        let (state, integral) = (simulation.state(), simulation.pid().integral());
        for (name, got, tolerance) in [
            ("q", &state.position, tolerance),
            ("qdot", &state.velocity, tolerance),
            ("integral", integral, tolerance),
            ("tau", simulation.effort(), effort_tolerance),
        ] {
            let want = array::<N>(&case[name][k]);
            for i in 0..N {
                let off = (got[i] - want[i]).abs();
                let told = format!("{} n={N} {name}[{i}] at step {sample}", case["name"]);
                assert!(off <= tolerance * want[i].abs().max(1.0), "{told}: {off}");
            }
        }
    }
}

/// A closed loop of the oracle has the upper one, and comes back from it.
#[test]
fn the_integral_has_a_lower_limit_too() {
    let mut pid = Pid::<2>::new(Gains::default());
    pid.set_setpoint(Setpoint::at([1.0, -1.0]));
    let far = pid.control(&State::rest(), 1000.0).integral;
    assert_eq!(far, [INTEGRAL_LIMIT, -INTEGRAL_LIMIT]);
}
