//! The control law: its terms, its integral, what it keeps and forgets, and the discrete loop in 50 digits.

use pendularm::math::arm::{Arm, State};
use pendularm::math::dynamics::gravity_load;
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
    #[serde(rename = "tau_minus_G_final")]
    tau_minus_load: f64,
    pd_rest: Option<Vec<f64>>,
    settled: bool,
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
        // The oracle's guide: a hundred times what a plain float64 run of the same loop is off, at least 1e-12.
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

/// At rest `τ = G(q)`: nothing else turns the joints. How far each loop is from that after ten seconds the oracle knows
/// to three digits; for those that have come to rest it is 1e-6 N m at most.
#[test]
fn once_settled_the_effort_is_the_gravity_load() {
    let cases = oracle();
    let settled = cases.iter().filter(|case| case.settled);
    assert!(settled.clone().count() >= 4);
    assert!(settled.clone().all(|case| case.tau_minus_load <= 1e-6));
    for case in &cases {
        match case.n {
            2 => check_load::<2>(case),
            3 => check_load::<3>(case),
            n => panic!("{n} links"),
        }
    }
}

fn check_load<const N: usize>(case: &Case) {
    let mut simulation = simulation::<N>(case);
    simulation.advance(10_000);
    let load = gravity_load(simulation.arm(), &simulation.state().position);
    let off = (0..N).map(|i| (simulation.effort()[i] - load[i]).abs());
    let off = off.fold(0.0, f64::max);
    // Three digits of it, and the rounding of a gain of 1000 times positions good to 1e-13.
    assert!(
        (off - case.tau_minus_load).abs() <= 0.01 * case.tau_minus_load + 1e-10,
        "{} n={N}: effort and load differ by {off}",
        case.name,
    );
}

/// The pose at which the arm stays without an integral term follows from `kp (q* - q) = G(q)`, which the oracle has solved.
#[test]
fn without_an_integral_term_the_arm_sags_below_its_setpoint() {
    let case = oracle().into_iter().find(|case| case.name == "pd_only");
    let case = case.unwrap();
    let rest = case.pd_rest.clone().unwrap();
    let mut simulation = simulation::<2>(&case);
    simulation.advance(20_000);
    for (q, (rest, setpoint)) in simulation
        .state()
        .position
        .iter()
        .zip(rest.iter().zip(&case.setpoint))
    {
        assert!((q - rest).abs() < 1e-9, "{q} and {rest}");
        assert!(q < &(setpoint - 0.05));
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

/// Powers of two, so that every product and sum is exact.
#[test]
fn the_effort_is_the_sum_of_three_terms_with_this_steps_error_in_the_integral_already() {
    let control = pid().control(&AT, 0.125);
    assert_eq!(control.integral, [0.0625, -0.125]);
    // kp e + ki I + kd ė, joint by joint.
    assert_eq!(control.effort, [2.0 + 1.0 - 0.25, -8.0 - 0.25 + 4.0]);
}

#[test]
fn the_law_changes_nothing_until_its_integral_is_committed() {
    let mut pid = pid();
    let before = pid.clone();
    let control = pid.control(&AT, 0.125);
    assert_eq!(pid, before);
    pid.commit(control.integral);
    assert_eq!(pid.integral(), &[0.0625, -0.125]);
    assert_eq!(pid.control(&AT, 0.125).integral, [0.125, -0.25]);
}

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
fn going_from_off_to_on_zeroes_the_integral() {
    let mut pid = pid();
    pid.commit([3.0, -4.0]);
    pid.enable(false);
    assert!(!pid.is_enabled());
    pid.enable(true);
    assert!(pid.is_enabled());
    assert_eq!(pid.integral(), &[0.0; 2]);
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

#[test]
fn a_reset_forgets_setpoint_and_integral_and_keeps_gains_and_on() {
    let mut pid = pid();
    pid.commit([3.0, -4.0]);
    let gains = *pid.gains();
    pid.reset();
    assert_eq!(pid.setpoint(), &Setpoint::default());
    assert_eq!(pid.integral(), &[0.0; 2]);
    assert_eq!(pid.gains(), &gains);
    assert!(pid.is_enabled());
}

#[test]
fn a_controller_starts_off_with_its_setpoint_at_the_starting_pose_at_rest() {
    let pid = Pid::new(Gains::<3>::default());
    assert!(!pid.is_enabled());
    assert_eq!(pid.setpoint().position, [0.0; 3]);
    assert_eq!(pid.setpoint().velocity, [0.0; 3]);
    assert_eq!(pid.integral(), &[0.0; 3]);
}
