//! The live loop: motion against 50-digit references, determinism, what each call changes and what it keeps.

use std::collections::HashMap;
use std::ops::ControlFlow;

use pendularm::math::arm::{Arm, State};
use pendularm::math::dynamics::forward_dynamics;
use pendularm::math::integrator::{Method, increment, two_sum};
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::Simulation;
use serde::Deserialize;

/// A motion under constant efforts, with the truncation error of each method: `[q, q̇, energy]` at each sample.
#[derive(Deserialize)]
struct Case {
    name: String,
    n: usize,
    masses: Vec<f64>,
    lengths: Vec<f64>,
    gravity: f64,
    tau: Vec<f64>,
    q0: Vec<f64>,
    qdot0: Vec<f64>,
    times: Vec<f64>,
    q: Vec<Vec<f64>>,
    qdot: Vec<Vec<f64>>,
    growth_max: Vec<f64>,
    #[serde(rename = "method_error_dt")]
    dt: f64,
    /// A method that is not among them is held to what halving its timestep makes of its motion.
    method_error: HashMap<String, Vec<[f64; 3]>>,
}

#[derive(Deserialize)]
struct Oracle {
    cases: Vec<Case>,
}

fn array<const N: usize>(values: &[f64]) -> [f64; N] {
    values.try_into().unwrap()
}

fn no_gains<const N: usize>() -> Gains<N> {
    Gains {
        kp: [0.0; N],
        ki: [0.0; N],
        kd: [0.0; N],
    }
}

/// Steps under constant efforts with nothing but the method and the dynamics, summed as the simulation sums.
struct Offline<const N: usize> {
    arm: Arm<N>,
    method: Method,
    dt: f64,
    tau: [f64; N],
    state: State<N>,
    carry: State<N>,
}

impl<const N: usize> Offline<N> {
    fn step(&mut self) {
        let State {
            position: q,
            velocity: v,
        } = &mut self.state;
        let acceleration =
            |_, q: &[f64; N], v: &[f64; N]| forward_dynamics(&self.arm, q, v, &self.tau);
        let (dq, dv) = increment(self.method, acceleration, 0.0, q, v, self.dt);
        for i in 0..N {
            (q[i], self.carry.position[i]) = two_sum(q[i], dq[i] + self.carry.position[i]);
            (v[i], self.carry.velocity[i]) = two_sum(v[i], dv[i] + self.carry.velocity[i]);
        }
    }
}

#[test]
fn motion_shows_each_methods_truncation_error_and_nothing_else() {
    let oracle: Oracle = serde_json::from_str(include_str!("../data/trajectories.json")).unwrap();
    for case in oracle.cases {
        match case.n {
            1 => check_motion::<1>(&case),
            2 => check_motion::<2>(&case),
            3 => check_motion::<3>(&case),
            4 => check_motion::<4>(&case),
            n => panic!("{n} links"),
        }
    }
}

fn check_motion<const N: usize>(case: &Case) {
    let arm = Arm::<N>::new(array(&case.lengths), array(&case.masses), case.gravity).unwrap();
    let start = State {
        position: array(&case.q0),
        velocity: array(&case.qdot0),
    };
    for method in Method::ALL {
        let mut live = Simulation::new(arm, no_gains());
        live.set_method(method);
        live.set_timestep(case.dt);
        live.set_state(start);
        let stepper = |dt: f64| Offline {
            arm,
            method,
            dt,
            tau: array(&case.tau),
            state: start,
            carry: State::rest(),
        };
        let (mut offline, mut finer) = (stepper(case.dt), stepper(0.5 * case.dt));
        let stored = case.method_error.get(method.name());
        let mut steps = 0;
        for (sample, time) in case.times.iter().enumerate() {
            let more = (time / case.dt).round() as u64 - steps;
            steps += more;
            (0..more).for_each(|_| offline.step());
            (0..2 * more).for_each(|_| finer.step());
            let halved = Truncation::by_halving(method, &offline.state, &finer.state);
            let stored = stored.map(|errors| Truncation::stored(errors[sample]));
            for expected in stored.into_iter().chain([halved]) {
                check_sample(case, method, sample, &offline.state, &expected);
            }
            // The live arm has no effort but its controller's, which is off.
            if offline.tau == [0.0; N] {
                live.advance(more);
                assert_eq!(live.state(), &offline.state, "{} {method}", case.name);
            }
        }
    }
}

/// A live arm without gravity takes another way through the dynamics (`weightless_dynamics`); the offline one does not.
#[test]
fn without_gravity_an_arm_moves_by_the_same_bits() {
    fn check<const N: usize>() {
        let arm = Arm::<N>::new([0.7; N], [1.3; N], 0.0).unwrap();
        let start = State {
            position: std::array::from_fn(|i| 2.5 - 1.1 * i as f64),
            velocity: std::array::from_fn(|i| 3.0 - 4.0 * i as f64),
        };
        for method in Method::ALL {
            let mut live = Simulation::new(arm, no_gains());
            live.set_method(method);
            live.set_state(start);
            let mut offline = Offline {
                arm,
                method,
                dt: live.timestep(),
                tau: [0.0; N],
                state: start,
                carry: State::rest(),
            };
            (0..5000).for_each(|_| offline.step());
            live.advance(5000);
            assert_eq!(live.state(), &offline.state, "{N} links, {method}");
        }
    }
    check::<1>();
    check::<2>();
    check::<3>();
}

/// The largest truncation error of a position and of a velocity, each with what it may be off by.
struct Truncation {
    q: [f64; 2],
    qd: [f64; 2],
}

impl Truncation {
    /// Three digits.
    fn stored([q, qd, _]: [f64; 3]) -> Self {
        Self {
            q: [q, 0.01 * q],
            qd: [qd, 0.01 * qd],
        }
    }

    /// Half the timestep leaves `2⁻ᵖ` of the error, as long as that is small: one of more than a thousandth says
    /// nothing. Where one of the two errors passes through zero, the next order is left of it: a share of the other.
    fn by_halving<const N: usize>(method: Method, whole: &State<N>, halves: &State<N>) -> Self {
        let share = 1.0 - 0.5_f64.powi(method.order() as i32);
        let error = |one: &[f64; N], other: &[f64; N]| apart(one, other) / share;
        let q = error(&whole.position, &halves.position);
        let qd = error(&whole.velocity, &halves.velocity);
        let larger = q.max(qd);
        let doubt = if larger < 1e-3 {
            0.2 * larger
        } else {
            f64::INFINITY
        };
        Self {
            q: [q, doubt],
            qd: [qd, doubt],
        }
    }
}

fn apart<const N: usize>(one: &[f64; N], other: &[f64]) -> f64 {
    (0..N)
        .map(|i| (one[i] - other[i]).abs())
        .fold(0.0, f64::max)
}

/// Beside the truncation error stands what rounding makes of the motion, which no method can avoid: a unit in the last
/// place on the way, amplified as the oracle says.
fn check_sample<const N: usize>(
    case: &Case,
    method: Method,
    sample: usize,
    state: &State<N>,
    expected: &Truncation,
) {
    let (q, qd) = (&case.q[sample], &case.qdot[sample]);
    let size = q
        .iter()
        .chain(qd)
        .fold(1.0, |size: f64, x| size.max(x.abs()));
    let rounding = 1e-15 * case.growth_max[sample] * size;
    for (name, got, want, [error, doubt]) in [
        ("q", &state.position, q, expected.q),
        ("qd", &state.velocity, qd, expected.qd),
    ] {
        let off = apart(got, want);
        assert!(
            (off - error).abs() <= doubt + rounding,
            "{} n={N} {method} {name} at {} s: off by {off}, expected {error}",
            case.name,
            case.times[sample],
        );
    }
}

/// Two links swinging under control, away from anything special.
fn moving(method: Method) -> Simulation<2> {
    let mut simulation = Simulation::new(Arm::default(), Gains::default());
    simulation.set_method(method);
    simulation.set_setpoint(Setpoint {
        position: [0.7, -1.1],
        velocity: [0.1, 0.0],
    });
    simulation.enable(true);
    simulation
}

#[test]
fn a_simulation_starts_in_the_starting_pose_with_runge_kutta_at_a_millisecond_and_no_control() {
    let simulation = Simulation::new(Arm::default(), Gains::<3>::default());
    assert_eq!(simulation.state(), &State::rest());
    assert_eq!(simulation.state().position, [0.0; 3]);
    assert_eq!(simulation.method(), Method::Rk4);
    assert_eq!(simulation.timestep(), 0.001);
    assert!(!simulation.pid().is_enabled());
    assert_eq!(simulation.effort(), &[0.0; 3]);
    assert_eq!((simulation.time(), simulation.steps()), (0.0, 0));
    assert_eq!(simulation.divergence(), None);
}

#[test]
fn many_steps_at_once_are_the_same_bits_as_one_by_one() {
    for method in Method::ALL {
        for on in [false, true] {
            let mut at_once = moving(method);
            at_once.enable(on);
            let mut one_by_one = at_once.clone();
            assert_eq!(at_once.advance(1000), 1000);
            for _ in 0..1000 {
                assert!(one_by_one.step());
            }
            assert_eq!(at_once, one_by_one, "{method}");
        }
    }
}

/// The law runs on the state at the start and its effort is held through all stages: the step is the one that the
/// offline stepper takes under that effort.
#[test]
fn a_step_runs_the_control_law_once_and_holds_its_effort() {
    for method in Method::ALL {
        let mut simulation = moving(method);
        simulation.advance(100);
        let state = *simulation.state();
        simulation.set_state(state);
        let control = simulation.pid().control(&state, simulation.timestep());
        let mut offline = Offline {
            arm: *simulation.arm(),
            method,
            dt: simulation.timestep(),
            tau: control.effort,
            state,
            carry: State::rest(),
        };
        offline.step();
        assert!(simulation.step());
        assert_eq!(simulation.state(), &offline.state, "{method}");
        assert_eq!(simulation.effort(), &control.effort);
        assert_eq!(simulation.pid().integral(), &control.integral);
    }
}

#[test]
fn without_control_the_arm_falls_and_the_effort_is_zero() {
    let mut simulation = Simulation::new(Arm::<2>::default(), Gains::default());
    simulation.advance(100);
    assert!(simulation.state().position[0] < -0.05);
    assert_eq!(simulation.effort(), &[0.0; 2]);
    assert_eq!(simulation.pid().integral(), &[0.0; 2]);
}

#[test]
fn an_arm_at_rest_without_gravity_stays_where_it_is_to_the_last_bit() {
    let arm = Arm::new([1.0, 0.5, 2.0], [1.0, 3.0, 0.1], 0.0).unwrap();
    let start = State {
        position: [0.3, 4.0, -1e8],
        velocity: [0.0; 3],
    };
    for method in Method::ALL {
        let mut simulation = Simulation::new(arm, no_gains());
        simulation.set_method(method);
        simulation.set_state(start);
        simulation.advance(1000);
        assert_eq!(simulation.state(), &start);
        assert_eq!(simulation.time(), 1.0);
    }
}

/// A link that turns at 0.1 rad/s without gravity moves by the same increment each step: a million of them add up to
/// that product, where a plain sum would be thousands of units in the last place off.
#[test]
fn a_million_tiny_steps_lose_no_digit() {
    let arm = Arm::new([1.0], [1.0], 0.0).unwrap();
    let mut simulation = Simulation::new(arm, no_gains());
    simulation.set_method(Method::Euler);
    simulation.set_timestep(1e-6);
    simulation.set_state(State {
        position: [0.0],
        velocity: [0.1],
    });
    simulation.advance(1_000_000);
    let [q] = simulation.state().position;
    assert!((q - 1e6 * (1e-6 * 0.1)).abs() <= 0.1 * f64::EPSILON, "{q}");
    assert_eq!(simulation.time(), 1.0);
}

#[test]
fn time_is_a_product_and_goes_on_over_a_new_timestep() {
    let mut simulation = moving(Method::Rk4);
    simulation.advance(100_000);
    assert_eq!(simulation.time(), 100.0);
    simulation.set_timestep(0.0003);
    assert_eq!(simulation.time(), 100.0);
    simulation.advance(7);
    assert_eq!(simulation.time(), 100.0 + 7.0 * 0.0003);
    assert_eq!(simulation.steps(), 100_007);
    simulation.set_method(Method::Euler);
    assert_eq!(simulation.time(), 100.0 + 7.0 * 0.0003);
}

#[test]
fn setting_the_same_timestep_again_does_not_turn_time_into_a_sum() {
    let mut simulation = moving(Method::Euler);
    for _ in 0..1000 {
        simulation.set_timestep(0.0001);
        simulation.step();
    }
    assert_eq!(simulation.time(), 1000.0 * 0.0001);
}

#[test]
fn a_reset_puts_back_pose_clock_setpoint_integral_and_effort_and_nothing_else() {
    let mut simulation = moving(Method::Verlet);
    simulation.set_timestep(0.002);
    simulation.set_arm(Arm::new([0.5, 1.5], [2.0, 1.0], 3.7).unwrap());
    let mut expected = Simulation::new(*simulation.arm(), *simulation.pid().gains());
    expected.set_method(Method::Verlet);
    expected.set_timestep(0.002);
    expected.enable(true);
    simulation.advance(333);
    assert_ne!(simulation.effort(), &[0.0; 2]);
    simulation.reset();
    assert_eq!(simulation, expected);
    assert_eq!(simulation.time(), 0.0);
    assert!(simulation.pid().is_enabled());
}

#[test]
fn new_gains_are_those_of_the_next_step() {
    let mut simulation = moving(Method::Rk4);
    simulation.enable(true);
    simulation.set_gains(no_gains());
    assert_eq!(simulation.pid().gains(), &no_gains());
    simulation.step();
    assert_eq!(simulation.effort(), &[0.0; 2]);
}

#[test]
fn disabling_control_zeroes_the_effort_at_once_and_leaves_the_motion() {
    let mut simulation = moving(Method::Rk4);
    simulation.advance(50);
    let state = *simulation.state();
    assert_ne!(simulation.effort(), &[0.0; 2]);
    simulation.enable(false);
    assert_eq!(simulation.effort(), &[0.0; 2]);
    assert_eq!(simulation.state(), &state);
    let setpoint = *simulation.pid().setpoint();
    simulation.enable(true);
    assert_eq!(
        simulation.effort(),
        &[0.0; 2],
        "no step has been taken since"
    );
    assert_eq!(simulation.pid().integral(), &[0.0; 2]);
    assert_eq!(simulation.pid().setpoint(), &setpoint);
}

#[test]
fn new_parameters_keep_the_joints_where_they_are() {
    let mut simulation = moving(Method::Rk4);
    simulation.advance(50);
    let mut heavier = simulation.clone();
    heavier.set_arm(Arm::new([1.0, 1.0], [1.0, 4.0], 9.81).unwrap());
    assert_eq!(heavier.state(), simulation.state());
    heavier.step();
    simulation.step();
    assert_ne!(heavier.state(), simulation.state());
}

#[test]
fn a_state_that_is_put_in_carries_nothing_over_from_the_old_one() {
    let mut simulation = moving(Method::Rk4);
    simulation.enable(false);
    simulation.advance(1234);
    let state = *simulation.state();
    let mut fresh = Simulation::new(*simulation.arm(), *simulation.pid().gains());
    simulation.set_state(state);
    fresh.set_state(state);
    simulation.advance(100);
    fresh.advance(100);
    assert_eq!(simulation.state(), fresh.state());
}

#[test]
fn an_observer_sees_every_step_in_order_and_may_end_the_advance() {
    let mut simulation = moving(Method::Midpoint);
    simulation.advance(10);
    let mut seen = Vec::new();
    let taken = simulation.advance_with(100, |now| {
        seen.push(now.steps());
        if now.steps() == 15 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    assert_eq!(taken, 5);
    assert_eq!(seen, [11, 12, 13, 14, 15]);
    assert_eq!(simulation.steps(), 15);
}

/// How many steps have the push in their effort.
fn pushed_steps(timestep: f64, duration: f64, before: u64) -> u64 {
    let mut simulation = Simulation::<2>::new(Arm::default(), Gains::default());
    simulation.set_timestep(timestep);
    simulation.advance(before);
    simulation.disturb([1.0, 0.0], duration);
    let mut pushed = 0;
    for _ in 0..200 {
        simulation.step();
        pushed += u64::from(simulation.effort()[0] != 0.0);
    }
    pushed
}

/// Steps begin at 0, dt, 2 dt, ...: `duration / dt` of them before `duration`, rounded up. In binary 1.1 / 0.1 is a little more than 11.
#[test]
fn a_disturbance_is_in_every_step_that_begins_within_its_time() {
    for before in [0, 1, 7, 1000] {
        assert_eq!(pushed_steps(0.1, 1.1, before), 11);
        assert_eq!(pushed_steps(0.1, 0.3, before), 3);
        assert_eq!(pushed_steps(0.1, 0.7, before), 7);
        assert_eq!(pushed_steps(0.1, 0.25, before), 3);
        assert_eq!(pushed_steps(0.001, 0.1, before), 100);
        assert_eq!(pushed_steps(0.001, 1e-9, before), 1);
        assert_eq!(pushed_steps(0.001, 5e-324, before), 1);
        assert_eq!(pushed_steps(0.001, f64::MAX, before), 200);
    }
}

#[test]
fn an_arm_whose_disturbance_is_over_steps_as_one_that_never_had_any() {
    let state = |push: bool| {
        let mut simulation = Simulation::<3>::new(Arm::default(), Gains::default());
        simulation.enable(true);
        if push {
            simulation.disturb([0.0; 3], 0.05);
        }
        simulation.advance(100);
        simulation
    };
    // Adding zeros changes no bit of an effort other than a zero's sign, which moves nothing.
    assert_eq!(state(true), state(false));
    let mut pushed = state(false);
    pushed.disturb([1.0; 3], 1.0);
    pushed.reset();
    let mut fresh = state(false);
    fresh.reset();
    assert_eq!(pushed, fresh);
}

/// A prediction of a step has to know the effort that it will be taken with.
#[test]
fn the_effort_of_the_next_step_is_what_that_step_is_then_taken_with() {
    for on in [false, true] {
        let mut simulation = moving(Method::Rk4);
        simulation.enable(on);
        simulation.disturb([3.0, -5.0], 0.01);
        for step in 0..20 {
            let told = simulation.effort_of_next_step();
            simulation.step();
            assert_eq!(simulation.effort(), &told, "step {step}");
            assert_eq!(told == [0.0; 2], !on && step >= 10, "step {step}");
        }
    }
}

/// The arm has stood still for 2^30 s; numbers there are 2^-22 s apart, which is a step, and the push is shorter.
#[test]
fn a_disturbance_shorter_than_the_clock_can_tell_is_in_one_step() {
    let arm = Arm::new([1.0; 2], [1.0; 2], 0.0).unwrap();
    let mut simulation = Simulation::<2>::new(arm, Gains::default());
    simulation.set_timestep(2.0_f64.powi(30));
    simulation.advance(1);
    simulation.set_timestep(2.0_f64.powi(-22));
    simulation.disturb([1.0, 0.0], 1e-9);
    for effort in [[1.0, 0.0], [0.0, 0.0]] {
        assert_eq!(simulation.effort_of_next_step(), effort);
        simulation.advance(1);
        assert_eq!(simulation.effort(), &effort);
    }
}

/// A torque of 1 N m for 1 s at the base of the stretched, weightless arm at rest (both links 1 m, 1 kg, rods): work in is kinetic energy gained, so
/// turning faster by the same push either way round is symmetric.
#[test]
fn opposite_disturbances_move_the_weightless_arm_in_mirrored_ways() {
    let run = |sign: f64| {
        let arm = Arm::new([1.0; 2], [1.0; 2], 0.0).unwrap();
        let mut simulation = Simulation::<2>::new(arm, Gains::default());
        simulation.disturb([sign, -0.5 * sign], 1.0);
        simulation.advance(2000);
        *simulation.state()
    };
    let (there, back) = (run(1.0), run(-1.0));
    assert_ne!(there.position, [0.0; 2]);
    assert_eq!(there.position, back.position.map(|q| -q));
    assert_eq!(there.velocity, back.velocity.map(|v| -v));
}
