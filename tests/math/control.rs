//! The control law: its terms, its integral, its state, and the discrete loop in 50 digits.

use pendularm::math::arm::{Arm, State};
use pendularm::math::pid::{Gains, INTEGRAL_LIMIT, Pid, Setpoint};
use pendularm::math::simulation::Simulation;
use serde::Deserialize;

/// One closed loop of the oracle, per sample `k`: state after `k` steps, integral and effort of step `k`.
#[derive(Deserialize)]
struct Case {
    name: String,
    n: usize,
    masses: Vec<f64>,
    lengths: Vec<f64>,
    gravity: f64,
    q0: Vec<f64>,
    qdot0: Vec<f64>,
    setpoint: Vec<f64>,
    setpoint_vel: Vec<f64>,
    kp: Vec<f64>,
    ki: Vec<f64>,
    kd: Vec<f64>,
    dt: f64,
    method: String,
    samples: Vec<u64>,
    q: Vec<Vec<f64>>,
    qdot: Vec<Vec<f64>>,
    integral: Vec<Vec<f64>>,
    tau: Vec<Vec<f64>>,
    float64_diff: Vec<f64>,
}

#[derive(Deserialize)]
struct Oracle {
    cases: Vec<Case>,
}

fn oracle() -> Vec<Case> {
    let oracle: Oracle = serde_json::from_str(include_str!("../data/closed_loop.json")).unwrap();
    oracle.cases
}

fn array<const N: usize>(values: &[f64]) -> [f64; N] {
    values.try_into().unwrap()
}

fn simulation<const N: usize>(case: &Case) -> Simulation<N> {
    let arm = Arm::new(array(&case.lengths), array(&case.masses), case.gravity).unwrap();
    let gains = Gains {
        kp: array(&case.kp),
        ki: array(&case.ki),
        kd: array(&case.kd),
    };
    let mut simulation = Simulation::new(arm, gains);
    simulation.set_method(case.method.parse().unwrap());
    simulation.set_timestep(case.dt);
    simulation.set_state(State {
        position: array(&case.q0),
        velocity: array(&case.qdot0),
    });
    simulation.set_setpoint(Setpoint {
        position: array(&case.setpoint),
        velocity: array(&case.setpoint_vel),
    });
    simulation.enable(true);
    simulation
}

#[test]
fn the_closed_loop_agrees_with_50_digits_at_every_sample() {
    for case in oracle() {
        match case.n {
            2 => check_loop::<2>(&case),
            3 => check_loop::<3>(&case),
            n => panic!("{n} links"),
        }
    }
}

fn check_loop<const N: usize>(case: &Case) {
    let mut simulation = simulation::<N>(case);
    for (k, &sample) in case.samples.iter().enumerate() {
        simulation.advance(sample - simulation.steps());
        assert_eq!(simulation.steps(), sample);
        // The oracle's tolerance: a hundred times the error of a plain float64 run of the same loop, at least 1e-12.
        let tolerance = (100.0 * case.float64_diff[k]).max(1e-12);
        // An error of the state becomes an effort by way of the gains.
        let gain = (0..N).map(|i| case.kp[i] + case.ki[i] + case.kd[i]);
        let effort_tolerance = tolerance * gain.fold(1.0, f64::max);
        for (name, got, want, tolerance) in [
            ("q", &simulation.state().position, &case.q[k], tolerance),
            ("qd", &simulation.state().velocity, &case.qdot[k], tolerance),
            (
                "integral",
                simulation.pid().integral(),
                &case.integral[k],
                tolerance,
            ),
            (
                "effort",
                simulation.effort(),
                &case.tau[k],
                effort_tolerance,
            ),
        ] {
            for i in 0..N {
                let off = (got[i] - want[i]).abs();
                assert!(
                    off <= tolerance * want[i].abs().max(1.0),
                    "{} n={N} {name}[{i}] at step {sample}: {} off by {off}",
                    case.name,
                    got[i],
                );
            }
        }
    }
}

fn pid() -> Pid<2> {
    let mut pid = Pid::new(Gains {
        kp: [4.0, 8.0],
        ki: [16.0, 2.0],
        kd: [0.5, 1.0],
    });
    pid.set_setpoint(Setpoint {
        position: [1.0, -2.0],
        velocity: [0.25, 0.0],
    });
    pid.enable(true);
    pid
}

const AT: State<2> = State {
    position: [0.5, -1.0],
    velocity: [0.75, -4.0],
};

#[test]
fn the_integral_stops_at_its_limit_and_comes_back_from_it_at_once() {
    let mut pid = pid();
    for _ in 0..1000 {
        pid.commit(pid.control(&AT, 1.0).integral);
    }
    assert_eq!(pid.integral(), &[INTEGRAL_LIMIT, -INTEGRAL_LIMIT]);
    let beyond = State {
        position: [2.0, -3.0],
        velocity: [0.0; 2],
    };
    pid.commit(pid.control(&beyond, 1.0).integral);
    assert_eq!(
        pid.integral(),
        &[INTEGRAL_LIMIT - 1.0, 1.0 - INTEGRAL_LIMIT]
    );
}

#[test]
fn enabling_what_is_enabled_changes_nothing() {
    let mut pid = pid();
    pid.commit([3.0, -4.0]);
    let before = pid.clone();
    pid.enable(true);
    assert_eq!(pid, before);
}

#[test]
fn changing_gains_or_setpoint_keeps_the_integral() {
    let mut pid = pid();
    pid.commit([3.0, -4.0]);
    pid.set_gains(Gains {
        kp: [1.0; 2],
        ki: [1.0; 2],
        kd: [1.0; 2],
    });
    assert_eq!(pid.integral(), &[3.0, -4.0]);
    let setpoint = Setpoint {
        position: [0.5, 1.0],
        velocity: [-1.0, 2.0],
    };
    pid.set_setpoint(setpoint);
    assert_eq!(pid.integral(), &[3.0, -4.0]);
    assert_eq!(pid.gains().kp, [1.0; 2]);
    assert_eq!(pid.setpoint(), &setpoint);
}
