//! The default gains meet their requirements on the default arms, for every setpoint.

use std::f64::consts::TAU;
use std::ops::ControlFlow;

use pendularm::math::arm::{Arm, State};
use pendularm::math::dynamics::gravity_load;
use pendularm::math::integrator::Method;
use pendularm::math::kinematics::forward;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::Simulation;

/// Largest remaining error of a joint \[rad\] and of the end effector \[m\].
const TOLERANCE: f64 = 0.02;
/// Time to get there \[s\].
const SETTLING: f64 = 4.0;
/// Time for which it must stay there \[s\].
const STAYING: f64 = 4.0;

/// With links of 1 m.
fn arrived<const N: usize>(q: &[f64; N], setpoint: &[f64; N]) -> bool {
    let tip = |q: &[f64; N]| forward(&[1.0; N], q).position;
    let is_near = |(q, setpoint): (&f64, &f64)| (q - setpoint).abs() <= TOLERANCE;
    q.iter().zip(setpoint).all(is_near) && tip(q).distance(tip(setpoint)) <= TOLERANCE
}

/// The last time at which the arm is away from a new setpoint \[s after the change\].
fn settling_time<const N: usize>(simulation: &mut Simulation<N>, setpoint: [f64; N]) -> f64 {
    simulation.set_setpoint(Setpoint::at(setpoint));
    simulation.enable(true);
    let start = simulation.time();
    let mut away = 0.0;
    let steps = ((SETTLING + STAYING) / simulation.timestep()).round() as u64;
    let taken = simulation.advance_with(steps, |now| {
        if !arrived(&now.state().position, &setpoint) {
            away = now.time() - start;
        }
        ControlFlow::Continue(())
    });
    assert_eq!(taken, steps, "diverged on the way to {setpoint:?}");
    away
}

/// Every combination of whole turns, then as many random setpoints within them.
fn setpoints<const N: usize>(random: usize) -> Vec<[f64; N]> {
    let turns = [-TAU, 0.0, TAU];
    let corners = (0..3_usize.pow(N as u32))
        .map(|corner| std::array::from_fn(|i| turns[corner / 3_usize.pow(i as u32) % 3]));
    let mut rng = fastrand::Rng::with_seed(1);
    corners
        .chain((0..random).map(|_| std::array::from_fn(|_| TAU * (2.0 * rng.f64() - 1.0))))
        .collect()
}

/// Up to two turns at every joint, in which a 3-link arm reaches speeds near the limit of 3 ms.
#[test]
fn from_any_setpoint_within_a_turn_any_other_is_reached_in_four_seconds() {
    fn check<const N: usize>(gains: Gains<N>, method: Method, timestep: f64) {
        let mut rng = fastrand::Rng::with_seed(2);
        for setpoint in setpoints(50) {
            let mut simulation = Simulation::new(Arm::default(), gains);
            simulation.set_method(method);
            simulation.set_timestep(timestep);
            let from = std::array::from_fn(|_| TAU * (2.0 * rng.f64() - 1.0));
            simulation.set_state(State::at_rest(from));
            let time = settling_time(&mut simulation, setpoint);
            let told = format!("n={N} {method}: {time} s, {from:?} to {setpoint:?}");
            assert!(time <= SETTLING, "{told}");
        }
    }
    check::<2>(Gains::default(), Method::Rk4, 0.001);
    check::<3>(Gains::default(), Method::Rk4, 0.001);
    for method in Method::ALL {
        check::<2>(Gains::default(), method, 0.003);
        check::<3>(Gains::default(), method, 0.003);
    }
}

/// Largest difference between effort and gravity load, in parts of the load \[1\]. It counts from the first instant at
/// which the arm is within tolerance and slower than 0.01 rad/s. The load counts as at least a tenth of the stretched
/// arm's.
fn ringing(arm: Arm<3>, free: u64, setpoint: [f64; 3]) -> f64 {
    let mut simulation = Simulation::new(arm, Gains::default());
    simulation.advance(free);
    simulation.set_setpoint(Setpoint::at(setpoint));
    simulation.enable(true);
    let least = 0.1 * gravity_load(&arm, &[0.0; 3])[0];
    let (start, mut at_rest, mut worst) = (simulation.time(), false, 0.0_f64);
    simulation.advance_with(8000, |now| {
        let State { position, velocity } = now.state();
        let is_slow = velocity.iter().all(|velocity| velocity.abs() < 0.01);
        at_rest |= is_slow && now.time() > start + 0.05 && arrived(position, &setpoint);
        if at_rest {
            let load = gravity_load(&arm, position);
            let largest = load.iter().fold(least, |max, load| max.max(load.abs()));
            for (effort, load) in now.effort().iter().zip(load) {
                worst = worst.max((effort - load).abs() / largest);
            }
        }
        ControlFlow::Continue(())
    });
    assert!(at_rest, "never at rest at {setpoint:?}");
    worst
}

/// The 3-link arm oscillates, and more so with heavy links. With too weak damping half of the moves exceed 2 %, and the
/// worst is 25 % off.
#[test]
fn the_effort_of_three_links_is_near_the_load_once_they_are_slow() {
    let heavy = Arm::new([1.0; 3], [2.0; 3], 9.81).expect("an arm");
    for (arm, over_allowed, worst_allowed) in [(Arm::default(), 8, 0.1), (heavy, 24, 0.15)] {
        let mut rng = fastrand::Rng::with_seed(3);
        let (mut over, mut worst) = (0, 0.0_f64);
        for case in 0..60 {
            let scale = if case % 2 == 0 { TAU } else { 1.5 };
            let setpoint = std::array::from_fn(|_| scale * (2.0 * rng.f64() - 1.0));
            let off = ringing(arm, 10_000 * (case % 4 / 2), setpoint);
            over += u32::from(off > 0.02);
            worst = worst.max(off);
        }
        let told = format!("{over} of 60 over 2 %, worst {worst}");
        assert!(over <= over_allowed && worst <= worst_allowed, "{told}");
    }
}
