//! Arms in the lanes of a register against the same arms alone: every bit of every simulation.

use std::f64::consts::TAU;

use fastrand::Rng;
use pendularm::math::arm::{Arm, State};
use pendularm::math::dynamics::{self, forward_dynamics};
use pendularm::math::integrator::Method;
use pendularm::math::limits::{AntiWindup, Limits};
use pendularm::math::number::Registers;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::sensors::{Sensors, VelocitySource};
use pendularm::math::simulation::{ControlPeriod, Simulation, batch};

/// Sizes around the point at which the sine's reduction needs the C library (2e5 rad), and far beyond.
const FAR: [f64; 5] = [1.9e5, 2.1e5, 1e9, 1e16, 1e300];

fn between(rng: &mut Rng, least: f64, most: f64) -> f64 {
    least + (most - least) * rng.f64()
}

/// Evenly distributed over the powers of ten between the two.
fn of_any_size(rng: &mut Rng, least: f64, most: f64) -> f64 {
    10_f64.powf(between(rng, least.log10(), most.log10()))
}

fn each<const N: usize>(mut value: impl FnMut() -> f64) -> [f64; N] {
    std::array::from_fn(|_| value())
}

fn any_state<const N: usize>(rng: &mut Rng) -> State<N> {
    let mut state = State {
        position: each(|| between(rng, -2.0 * TAU, 2.0 * TAU)),
        velocity: each(|| between(rng, -5.0, 5.0)),
    };
    match rng.u32(..8) {
        0 => state.position[rng.usize(..N)] = *rng.choice(&FAR).unwrap(),
        1 => state.velocity[rng.usize(..N)] = -rng.choice(&FAR).unwrap(),
        2 => state = State::rest(),
        3 => state.position = each(|| -0.0),
        _ => {}
    }
    state
}

/// An arm in any state: weightless, turned many times, pushed, off, commanded, driven, sampled, about to diverge, or
/// diverged.
fn any_simulation<const N: usize>(rng: &mut Rng) -> Simulation<N> {
    let gravity = if rng.u32(..3) == 0 { 0.0 } else { 9.81 };
    let arm = Arm::new(
        each(|| of_any_size(rng, 0.1, 10.0)),
        each(|| of_any_size(rng, 0.1, 10.0)),
        gravity,
    );
    let gains = Gains {
        kp: each(|| between(rng, 0.0, 2000.0)),
        ki: each(|| between(rng, 0.0, 3000.0)),
        kd: each(|| between(rng, 0.0, 100.0)),
    };
    let mut arm = arm.unwrap();
    if rng.u32(..3) == 0 {
        arm = arm.with_friction(each(|| between(rng, 0.0, 5.0))).unwrap();
    }
    let mut simulation = Simulation::new(arm, gains);
    simulation.set_method(*rng.choice(Method::ALL.iter()).unwrap());
    // The larger ones diverge within some steps.
    simulation.set_timestep(of_any_size(rng, 1e-5, 0.5));
    simulation.set_state(any_state(rng));
    simulation.enable(rng.bool());
    if rng.bool() {
        simulation.set_control_period(ControlPeriod {
            period: simulation.timestep() * between(rng, 0.0, 12.0),
            delay: if rng.bool() { rng.u8(..3) } else { 0 },
        });
    }
    simulation.set_setpoint(Setpoint {
        position: each(|| between(rng, -TAU, TAU)),
        velocity: each(|| between(rng, -1.0, 1.0)),
    });
    // A carry, an integral and a clock that are no zeros.
    simulation.advance(rng.u64(..3));
    if rng.bool() {
        simulation.set_timestep(of_any_size(rng, 1e-5, 1e-2));
    }
    match rng.u32(..8) {
        0 => simulation.drive(Some(each(|| between(rng, -20.0, 20.0)))),
        1 if !simulation.pid().is_enabled() => {
            simulation.set_command(each(|| between(rng, -20.0, 20.0)));
        }
        _ => {}
    }
    if rng.u32(..3) == 0 {
        simulation.set_limits(Limits {
            effort: rng.bool().then(|| each(|| between(rng, 0.0, 50.0))),
            anti_windup: *rng.choice(AntiWindup::ALL.iter()).unwrap(),
            tracking_time: of_any_size(rng, 1e-4, 10.0),
        });
    }
    if rng.u32(..3) == 0 {
        simulation.set_sensors(Sensors {
            encoder_step: each(|| {
                if rng.bool() {
                    between(rng, 0.0, 0.01)
                } else {
                    0.0
                }
            }),
            velocity: *rng.choice(VelocitySource::ALL.iter()).unwrap(),
        });
    }
    if rng.u32(..3) == 0 {
        let duration = simulation.timestep() * between(rng, 0.1, 40.0);
        simulation.disturb(each(|| between(rng, -20.0, 20.0)), duration);
    }
    simulation
}

/// Every number with its sign, also that of zero.
fn shown<const N: usize>(simulation: &Simulation<N>) -> String {
    format!("{simulation:?}")
}

/// Steps `count` arms together, then alone, and counts those that diverged on the way.
fn compare<const N: usize>(registers: Registers, rng: &mut Rng, count: usize) -> usize {
    let mut together: Vec<Simulation<N>> = (0..count).map(|_| any_simulation(rng)).collect();
    let mut alone = together.clone();
    let mut diverged = 0;
    for _ in 0..3 {
        let alike = rng.bool().then(|| rng.u64(1..60));
        let steps: Vec<u64> = (0..count)
            .map(|_| alike.unwrap_or_else(|| rng.u64(..60)))
            .collect();
        registers.advance(together.iter_mut().zip(steps.iter().copied()));
        for ((one, other), &steps) in alone.iter_mut().zip(&together).zip(&steps) {
            let before = one.clone();
            let was_diverged = one.divergence().is_some();
            one.advance(steps);
            diverged += usize::from(one.divergence().is_some() && !was_diverged);
            assert_eq!(
                shown(other),
                shown(one),
                "{steps} steps in {} lanes from {before:?}",
                registers.lanes()
            );
        }
    }
    diverged
}

#[test]
fn a_lane_has_the_bits_of_an_arm_that_is_stepped_alone() {
    let mut rng = Rng::with_seed(1);
    for registers in Registers::all() {
        let mut diverged = 0;
        for count in (1..40).chain([64, 100, 129, 300, 1500]) {
            diverged += compare::<2>(registers, &mut rng, count);
            diverged += compare::<3>(registers, &mut rng, count);
        }
        assert!(diverged > 300, "only {diverged} diverged");
    }
}

#[test]
fn a_lane_ends_where_time_ends_too() {
    let weightless = Arm::new([1.0; 2], [1.0; 2], 0.0).unwrap();
    let mut arms = vec![Simulation::<2>::new(weightless, Gains::default()); 16];
    arms[3].set_timestep(1e308);
    arms[5].set_timestep(1e307);
    let mut alone = arms.clone();
    batch::advance(arms.iter_mut().map(|arm| (arm, 100)));
    for (index, (arm, alone)) in arms.iter().zip(&mut alone).enumerate() {
        alone.advance(100);
        assert_eq!(shown(arm), shown(alone), "arm {index}");
        assert_eq!(arm.divergence().is_some(), [3, 5].contains(&index));
    }
}

/// Accelerations in columns, with a number after the last state that must stay unchanged.
fn accelerations<const N: usize>(registers: Registers, count: usize, rng: &mut Rng) {
    let arm = Arm::new(
        each(|| of_any_size(rng, 0.1, 10.0)),
        each(|| of_any_size(rng, 0.1, 10.0)),
        9.81,
    )
    .unwrap();
    let states: Vec<State<N>> = (0..count).map(|_| any_state(rng)).collect();
    let efforts: Vec<[f64; N]> = (0..count)
        .map(|_| each(|| between(rng, -20.0, 20.0)))
        .collect();
    let column = |value: &dyn Fn(usize) -> f64| -> Vec<f64> { (0..count).map(value).collect() };
    let q: [Vec<f64>; N] = std::array::from_fn(|i| column(&|k| states[k].position[i]));
    let qd: [Vec<f64>; N] = std::array::from_fn(|i| column(&|k| states[k].velocity[i]));
    let tau: [Vec<f64>; N] = std::array::from_fn(|i| column(&|k| efforts[k][i]));
    let mut qdd: [Vec<f64>; N] = std::array::from_fn(|_| vec![7.0; count + 1]);
    registers.forward_dynamics(
        &arm,
        q.each_ref().map(Vec::as_slice),
        qd.each_ref().map(Vec::as_slice),
        tau.each_ref().map(Vec::as_slice),
        qdd.each_mut().map(Vec::as_mut_slice),
    );
    for (k, (state, effort)) in states.iter().zip(&efforts).enumerate() {
        let want = forward_dynamics(&arm, &state.position, &state.velocity, effort);
        let got: [f64; N] = std::array::from_fn(|i| qdd[i][k]);
        // Not a number has many bits.
        let bits = |x: f64| if x.is_nan() { None } else { Some(x.to_bits()) };
        assert_eq!(
            got.map(bits),
            want.map(bits),
            "state {k} of {count} in {} lanes: {state:?}",
            registers.lanes()
        );
    }
    assert!(
        qdd.iter()
            .all(|column| column[count].to_bits() == 7.0_f64.to_bits())
    );
}

#[test]
fn the_acceleration_of_a_state_has_the_same_bits_in_every_lane() {
    let mut rng = Rng::with_seed(4);
    for registers in Registers::all() {
        for count in (0..40).chain([64, 100, 129, 300]) {
            accelerations::<1>(registers, count, &mut rng);
            accelerations::<2>(registers, count, &mut rng);
            accelerations::<3>(registers, count, &mut rng);
        }
    }
}

#[test]
fn the_shortest_column_says_how_many_states_there_are() {
    let (long, short) = ([0.5; 50], [0.25; 40]);
    let (mut first, mut second) = ([7.0; 50], [7.0; 50]);
    let arm = Arm::<2>::default();
    dynamics::batch::forward_dynamics(
        &arm,
        [&long, &long],
        [&long, &short],
        [&long, &long],
        [&mut first, &mut second],
    );
    let want = forward_dynamics(&arm, &[0.5; 2], &[0.5, 0.25], &[0.5; 2]);
    assert_eq!([first[39], second[39]], want);
    assert_eq!([first[40], second[40]], [7.0; 2]);
}
