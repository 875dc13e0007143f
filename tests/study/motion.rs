//! The predicted timestep limit of a motion, against runs: hardly any arm diverges below it, and most do far beyond it.

use std::f64::consts::{FRAC_PI_2, TAU};

use pendularm::math::arm::{Arm, State};
use pendularm::math::dynamics::{energy, potential_energy};
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::motion::Motion;
use pendularm::study::stability::{limit_held, limits};

use crate::properties::advised;
use crate::stored::gains;

/// Whether the energy above that of the hanging arm doubles within `duration`, or the numbers end.
fn is_lost<const N: usize>(free: &ControlLoop<N>, state: &State<N>, duration: f64) -> bool {
    let (arm, timestep) = (&free.arm, free.timestep);
    let mut hanging = [0.0; N];
    hanging[0] = -FRAC_PI_2;
    let lowest = potential_energy(arm, &hanging);
    let mut live = free.simulation(*state);
    let most = 2.0 * (energy(arm, state) - lowest);
    let steps = (duration / timestep).ceil() as u64;
    // Not finite is not at most anything.
    (0..steps).any(|_| !(live.step() && energy(arm, live.state()) - lowest <= most))
}

#[test]
fn a_loop_at_rest_without_dynamics_has_no_limit() {
    let weightless = Arm::<3>::default().weightless();
    let free = ControlLoop::free(weightless).with_method(Method::Euler);
    let at_rest = ControlLoop::new(weightless, Gains::default(), Setpoint::default());
    for control in [free, at_rest] {
        let motion = Motion::ahead(&control, &State::rest());
        assert_eq!((motion.speed, motion.timestep), (0.0, f64::INFINITY));
    }
    // Where there is gravity an arm sags a little before its integrals hold it.
    let sagging = ControlLoop::new(Arm::<3>::default(), Gains::default(), Setpoint::default());
    let sagging = Motion::ahead(&sagging, &State::rest());
    assert!((0.1..5.0).contains(&sagging.speed), "{sagging:?}");
}

fn size(rng: &mut fastrand::Rng, decades: f64) -> f64 {
    10_f64.powf(decades * (2.0 * rng.f64() - 1.0))
}

fn uneven<const N: usize>(rng: &mut fastrand::Rng, gravity: f64) -> Arm<N> {
    let lengths = std::array::from_fn(|_| size(rng, 0.3));
    let masses = std::array::from_fn(|_| size(rng, 0.5));
    Arm::new(lengths, masses, gravity).unwrap()
}

/// Free arms, spun at 2 to 50 rad/s or falling from anywhere. Under gravity the limits of Euler and midpoint are zero
/// by linearisation already.
fn check_free<const N: usize>(seed: u64, cases: usize) {
    let mut rng = fastrand::Rng::with_seed(seed);
    let (mut within, mut beyond, mut lost) = (0, 0, 0);
    for case in 0..cases {
        let methods = Method::ALL.into_iter();
        for (method, gravity) in methods.flat_map(|one| [(one, 0.0), (one, 9.81)]) {
            let arm = uneven::<N>(&mut rng, gravity);
            let spin = 10.0 * size(&mut rng, 0.7);
            let mut state = State::at_rest(std::array::from_fn(|_| TAU * rng.f64()));
            if gravity == 0.0 {
                state.velocity = std::array::from_fn(|_| spin * (2.0 * rng.f64() - 1.0));
            }
            let swings = matches!(method, Method::Euler | Method::Midpoint) && gravity > 0.0;
            if swings {
                continue;
            }
            // A small swing about the hanging pose is slow, and limited by its frequency.
            let free = ControlLoop::free(arm).with_method(method);
            let linear = limit_held(&free).unwrap_or(f64::INFINITY);
            let limit = Motion::ahead(&free, &state).timestep.min(linear);
            if is_lost(&free.with_timestep(0.8 * limit), &state, 4.0) {
                println!("seed {seed} case {case} {method} {arm:?} {state:?} {limit}");
                within += 1;
            }
            beyond += 1;
            lost += usize::from(is_lost(&free.with_timestep(5.0 * limit), &state, 4.0));
        }
    }
    assert!(50 * within <= beyond, "{within} of {beyond}");
    assert!(10 * lost > 6 * beyond, "{lost} of {beyond}");
}

#[test]
fn free_arms_are_carried_within_the_limit_and_lost_at_a_multiple_of_it() {
    check_free::<2>(31, 60);
    check_free::<3>(32, 40);
}

/// Moves of up to four turns with gains of all dampings. The assumed speed is within a factor of four of the true
/// motion's, and within both limits the arm arrives.
fn check_moves<const N: usize>(seed: u64, cases: usize) {
    let mut rng = fastrand::Rng::with_seed(seed);
    for case in 0..cases {
        let arm = uneven::<N>(&mut rng, 9.81);
        let (lengths, masses) = (arm.lengths(), arm.masses());
        let pace = 15.0 * size(&mut rng, 0.3);
        let damping = size(&mut rng, 0.3);
        let inertia: [f64; N] = std::array::from_fn(|i| {
            let (reach, mass): (f64, f64) = (lengths[i..].iter().sum(), masses[i..].iter().sum());
            mass * reach * reach / 3.0
        });
        let kp = inertia.map(|inertia| inertia * pace * pace);
        let kd = inertia.map(|inertia| 2.0 * damping * inertia * pace);
        let gains = gains(kp, [0.0; N], kd);
        let amplitude = TAU * size(&mut rng, 0.6);
        let position = std::array::from_fn(|_| amplitude * (2.0 * rng.f64() - 1.0));
        let setpoint = Setpoint::at(position);
        let duration = 20.0 / pace * (1.0 + 2.0 * damping);
        let method = Method::ALL[case % Method::ALL.len()];
        let control = ControlLoop::new(arm, gains, setpoint).with_method(method);
        let motion = Motion::ahead(&control, &State::rest());
        let told = format!("seed {seed} case {case} {method} {arm:?} {gains:?} {setpoint:?}");
        let run = |timestep: f64| {
            let mut live = control.with_timestep(timestep).simulation(State::rest());
            let mut peak: f64 = 0.0;
            for _ in 0..(duration / timestep).ceil() as u64 {
                assert!(live.step(), "{told}: diverged at {timestep} s");
                let mut rate = 0.0;
                for velocity in live.state().velocity {
                    rate += velocity;
                    peak = peak.max(rate.abs());
                }
            }
            let off = (0..N).map(|i| (live.state().position[i] - setpoint.position[i]).abs());
            (peak, off.fold(0.0, f64::max))
        };
        let linear = limits(&control).minimum_held.unwrap();
        let (peak, off) = run(0.8 * linear.min(motion.timestep));
        assert!(off < 0.2 * amplitude.max(1.0), "{told}: {off} rad off");
        let ratio = motion.speed / peak;
        let is_near = (0.25..4.0).contains(&ratio);
        assert!(is_near, "{told}: {ratio} times {peak} rad/s");
    }
}

#[test]
fn moves_are_carried_at_a_speed_that_is_known_before() {
    check_moves::<2>(33, 32);
    check_moves::<3>(34, 20);
}

/// Two even links, stretched, have `M = (4/3 1/2; 1/2 1/3)` in the angles of the links, and `(M⁻¹)₂₂ = 48/7`. From the
/// starting pose the arm falls by `2 · 9.81` J, which the last link alone might have.
#[test]
fn the_speed_assumed_is_that_of_all_energy_in_one_link() {
    let speed = Motion::ahead(&ControlLoop::free(Arm::<2>::default()), &State::rest()).speed;
    let expected = (2.0 * 2.0 * 9.81 * 48.0 / 7.0_f64).sqrt();
    assert!((speed / expected - 1.0).abs() < 1e-12, "{speed}");
}

/// The integral makes a large move faster: without it 8.76 ms would be advised, which loses the arm after 0.2 s.
#[test]
fn integrals_count_in_the_speed_of_a_move() {
    let arm = Arm::new([1.14, 0.91], [5.7, 3.2], 9.81).unwrap();
    let gains = gains([970.0, 170.0], [6600.0, 550.0], [100.0, 36.0]);
    let control =
        ControlLoop::new(arm, gains, Setpoint::at([11.8, 0.2])).with_method(Method::Verlet);
    let timestep = advised(&control, &State::rest());
    let mut live = control.with_timestep(timestep).simulation(State::rest());
    let steps = (20.0 / timestep) as u64;
    assert_eq!(live.advance(steps), steps, "{timestep}");
    let off = (live.state().position[0] - 11.8).abs();
    assert!(off < 1e-2, "{timestep}: {off}");
    assert!(Motion::ahead(&control, &State::rest()).speed > 93.0);
}
