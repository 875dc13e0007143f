//! The cases that an independent check found wrong, replayed with its own numbers: arm, gains, pose, timestep.
//!
//! Each kind of case is tried on many others elsewhere, above all in `properties/`.

use std::f64::consts::{FRAC_PI_2, TAU};

use pendularm::math::arm::{Arm, State};
use pendularm::math::dynamics::mass_matrix;
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::Simulation;
use pendularm::report::experiments::reference::{Law, ReferenceMotion};
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::error_estimate::estimate_step;
use pendularm::study::motion::Motion;
use pendularm::study::rollout::{Rollout, RolloutRequest};
use pendularm::study::stability::{Rest, limit_held, limits};
use pendularm::study::taylor::TaylorReference;

fn default_at<const N: usize>(setpoint: [f64; N]) -> ControlLoop<N>
where
    Gains<N>: Default,
{
    ControlLoop::new(Arm::default(), Gains::default(), Setpoint::at(setpoint))
}

/// The headline named no pose: 8.21 ms is the limit bent, 6.56 ms bent the other way, and 4.32 ms that of the stretched
/// arm as it starts, and of all poses. To the three digits that the check gave.
#[test]
fn a_limit_belongs_to_its_pose_and_the_starting_pose_has_the_smallest() {
    for (setpoint, expected) in [
        ([0.5, 0.8], 8.21e-3),
        ([0.8, -0.6], 6.56e-3),
        ([0.0, 0.0], 4.32e-3),
    ] {
        let found = limits(&default_at(setpoint));
        let (held, least) = (found.held.unwrap(), found.minimum_held.unwrap());
        assert!((held - expected).abs() < 5e-6, "{setpoint:?}: {held}");
        assert!((least - 4.32e-3).abs() < 5e-6, "{setpoint:?}: {least}");
    }
}

/// Held at the start the arm wanders off by some tenths of a radian at 5 ms, and is lost at 8.2 ms; at 4.3 ms it stays.
#[test]
fn at_the_start_the_arm_does_what_its_limit_says() {
    let largest_at = |timestep: f64| {
        let mut live = default_at([0.0; 2])
            .with_timestep(timestep)
            .simulation(State::at_rest([1e-3; 2]));
        // Ten seconds leave nothing of the jolt that gravity gives at the start.
        let settling = (10.0 / timestep) as u64;
        live.advance(settling);
        let mut largest = 0.0_f64;
        for _ in 0..settling {
            if !live.step() {
                return f64::INFINITY;
            }
            let off = live.state().position.iter().map(|q| q.abs());
            largest = off.fold(largest, f64::max);
        }
        largest
    };
    assert!(largest_at(4.3e-3) < 1e-3);
    let wandering = largest_at(5e-3);
    // Either joint, at any time of ten seconds.
    assert!((0.1..1.0).contains(&wandering), "{wandering} rad");
    assert_eq!(largest_at(8.2e-3), f64::INFINITY);
}

/// Newton steps ran into a saddle, and all five answers were zero, with every method.
#[test]
fn none_of_the_answers_about_a_sagging_arm_is_zero() {
    let gains = Gains {
        kp: [8.0, 2.6667],
        ki: [0.0; 2],
        kd: [2.6667, 1.0],
    };
    let setpoint = Setpoint::at([1.694_544_183_420_622_3, -2.503_024_457_368_377_8]);
    for method in Method::ALL {
        let control = ControlLoop::new(Arm::default(), gains, setpoint).with_method(method);
        let found = limits(&control);
        assert_eq!(found.rest, Rest::Sagging, "{method}: {found:?}");
        for answer in [
            found.held,
            found.continuous,
            found.minimum_held,
            found.minimum_continuous,
            found.advised,
        ] {
            assert!(
                answer.is_some_and(|limit| limit > 0.01),
                "{method}: {found:?}"
            );
        }
        // It rests there: let go beside it, it comes back.
        let beside = State::at_rest(found.equilibrium.map(|q| q + 1e-2));
        let mut live = control.with_timestep(5e-3).simulation(beside);
        live.advance(20_000);
        let off = (0..2).map(|i| (live.state().position[i] - found.equilibrium[i]).abs());
        assert!(off.fold(0.0, f64::max) < 1e-6, "{method}");
    }
}

/// Nine poses of the second joint missed the worst: 4.09 ms were advised where the arm wanders half a radian about the
/// pose [0, 1.767], whose limit is 2.24 ms.
#[test]
fn the_timestep_that_was_advised_for_an_uneven_arm_is_beyond_its_limit() {
    let arm = Arm::new([2.6, 0.73], [0.8, 5.6], 0.0).unwrap();
    let gains = Gains {
        kp: [30668.0, 726.0],
        ki: [0.0; 2],
        kd: [68.5, 8.89],
    };
    let worst = [0.0, 1.767];
    let control = ControlLoop::new(arm, gains, Setpoint::at(worst)).with_method(Method::Euler);
    let found = limits(&control);
    let held = found.held.unwrap();
    assert!((held - 2.24e-3).abs() < 5e-6, "{held}");
    let wanders = |timestep: f64| {
        let start = State::at_rest(worst.map(|q| q + 1e-3));
        let mut live = control.with_timestep(timestep).simulation(start);
        let mut largest = 0.0_f64;
        for _ in 0..20_000 {
            if !live.step() {
                return f64::INFINITY;
            }
            let off = (0..2).map(|i| (live.state().position[i] - worst[i]).abs());
            largest = off.fold(largest, f64::max);
        }
        largest
    };
    let (before, now) = (wanders(4.09e-3), wanders(found.advised.unwrap()));
    assert!(before > 0.5, "{before} rad");
    assert!(now < 2e-3, "{now} rad");
}

/// When a free arm leaves the numbers, from where it starts \[s\]; none within `duration` \[s\].
fn lost_after<const N: usize>(
    arm: Arm<N>,
    start: State<N>,
    method: Method,
    timestep: f64,
    duration: f64,
) -> Option<f64> {
    let control = ControlLoop::free(arm).with_method(method);
    let mut live = control.with_timestep(timestep).simulation(start);
    let steps = (duration / timestep).ceil() as u64;
    (live.advance(steps) < steps).then(|| live.time())
}

/// 223 ms were advised to a free arm of 2 links with Verlet, and 221 ms to one of 3 with RK4; they were gone after 11 s at
/// 83 ms and 3 s at 138 ms. Without gravity nothing was said to limit an arm that 1 ms destroys in 20 ms.
#[test]
fn free_arms_leave_the_numbers_where_they_did_and_are_advised_less_now() {
    let (two, three) = (Arm::<2>::default(), Arm::<3>::default());
    let advised = |motion: Motion, linear: Option<f64>| {
        0.8 * motion.timestep.min(linear.unwrap_or(f64::INFINITY))
    };

    let control = ControlLoop::free(two).with_method(Method::Verlet);
    let now = advised(
        Motion::ahead(&control, &State::rest()),
        limits(&control).trusted(),
    );
    let lost = lost_after(two, State::rest(), Method::Verlet, 0.083, 12.0);
    assert!(lost.is_some(), "2 links, Verlet at 83 ms");
    assert!(now < 0.083, "{now}");
    assert_eq!(
        lost_after(two, State::rest(), Method::Verlet, now, 100.0),
        None
    );

    let control = ControlLoop::free(three);
    let now = advised(
        Motion::ahead(&control, &State::rest()),
        limits(&control).trusted(),
    );
    let lost = lost_after(three, State::rest(), Method::Rk4, 0.138, 4.0);
    assert!(lost.is_some(), "3 links, RK4 at 138 ms");
    assert!(now < 0.138, "{now}");
    assert_eq!(
        lost_after(three, State::rest(), Method::Rk4, now, 100.0),
        None
    );

    let weightless = Arm::new([1.0; 2], [1.0; 2], 0.0).unwrap();
    let spun = State {
        position: [0.0, 0.5],
        velocity: [1200.0, 0.0],
    };
    for method in [Method::Euler, Method::Midpoint, Method::Verlet] {
        let control = ControlLoop::free(weightless).with_method(method);
        assert_eq!(limits(&control).held, None);
        let now = advised(Motion::ahead(&control, &spun), None);
        assert!(now < 1e-3, "{method}: {now}");
        let lost = lost_after(weightless, spun, method, 1e-3, 0.02);
        assert!(lost.is_some(), "{method}");
        assert_eq!(
            lost_after(weightless, spun, method, now, 0.1),
            None,
            "{method}"
        );
    }
}

fn swing_error(start: State<2>, timestep: f64, duration: f64) -> (Option<f64>, f64, f64) {
    let request = RolloutRequest {
        control: ControlLoop::free(Arm::default()).with_timestep(timestep),
        start,
        duration,
        samples: 101,
        reference: true,
    };
    let mut rollout = Rollout::new(request).unwrap();
    while rollout.advance(u64::MAX) > 0 {}
    let deviation = rollout.deviation().unwrap();
    let mut before = 0.0;
    let intervals: Vec<f64> = rollout.times()[1..]
        .iter()
        .map(|time| time - std::mem::replace(&mut before, *time))
        .collect();
    let truth = ReferenceMotion::between(&request.control.arm, &start, &Law::FREE, &intervals);
    let off = (0..truth.len()).map(|index| {
        let position = &rollout.positions()[index + 1];
        truth.angle_error(index, position).unwrap()
    });
    let off = off.fold(0.0, f64::max);
    println!(
        "{duration} s: {:?} served, {off:e} true, ± {:e}",
        deviation.known(),
        deviation.largest_uncertainty()
    );
    (deviation.known(), off, deviation.largest_uncertainty())
}

/// 1.34e-12 was served where 4.41e-12 was true; 4.06 rad for 3.78 after 27 s of chaos, 2.92 for 0.94 after 30 s. The
/// served value is now true within its uncertainty, and where that is of one size with the error none is.
#[test]
fn an_error_that_is_hardly_known_is_not_served() {
    let beside = State::at_rest([0.4, -0.3]);
    let (served, true_error, uncertainty) = swing_error(beside, 1e-4, 5.0);
    let off = (served.unwrap() - true_error).abs();
    assert!(off <= 2.0 * uncertainty, "{off:e} ± {uncertainty:e}");
    let (served, true_error, uncertainty) = swing_error(beside, 1e-5, 5.0);
    assert_eq!(served, None);
    assert!(true_error < 1e-12 && uncertainty > 0.05 * true_error);
    for duration in [20.0, 24.0, 27.0, 30.0] {
        let (served, true_error, uncertainty) = swing_error(State::rest(), 1e-3, duration);
        if let Some(served) = served {
            assert!(
                (served - true_error).abs() <= 2.0 * uncertainty,
                "{duration} s: {served} for {true_error} ± {uncertainty}"
            );
        }
        assert!(
            duration < 30.0 || served.is_none(),
            "{duration} s: {served:?}"
        );
    }
}

/// At 26 s 61 µs are off by 2.6e-3 rad and 10 µs by 5.9e-6: truncation ended the comparison there, not the digits of a
/// double.
#[test]
fn at_26_seconds_a_sixth_of_the_timestep_is_hundreds_of_times_nearer() {
    let arm = Arm::<2>::default();
    let truth = ReferenceMotion::of(&arm, &State::rest(), &Law::FREE, 26.0, 1);
    let off = |timestep: f64, every: u64| {
        let control = ControlLoop::free(arm).with_timestep(timestep);
        let mut live = control.simulation(State::rest());
        assert_eq!(live.advance(every), every);
        truth.angle_error(0, &live.state().position).unwrap()
    };
    let coarse = off(0.5_f64.powi(14), 26 << 14);
    let fine = off(1e-5, 2_600_000);
    assert!((coarse / 2.6e-3 - 1.0).abs() < 0.05, "{coarse:e}");
    // Rounding has a part in this one, and chaos magnifies it.
    assert!((1e-6..2e-5).contains(&fine), "{fine:e}");
}

/// A joint whose integral is too strong for its damping runs away at some 1.3/s, beside another whose damping makes a rate
/// of 1e12/s: it was said to be stable.
#[test]
fn slow_growth_beside_a_joint_of_enormous_damping_is_seen() {
    let arm = Arm::<2>::default();
    for (kd, bend) in [(1e9, 0.0), (1e11, 0.0), (1e11, 0.9), (1e13, 1.7)] {
        for (part, runs_away) in [(0.8, false), (0.99, false), (1.01, true), (1.6, true)] {
            for method in Method::ALL {
                check_braked(&arm, [20.0, kd], bend, part, method, runs_away);
            }
        }
    }
    let mut rng = fastrand::Rng::with_seed(72);
    let mut size = |decades: f64| 10_f64.powf(decades * (2.0 * rng.f64() - 1.0));
    for case in 0..100 {
        let arm = Arm::new([size(0.5), size(0.5)], [size(0.5), size(0.5)], 9.81).unwrap();
        let (damping, brake) = (20.0 * size(0.5), 1e11 * size(2.0));
        let (bend, runs_away) = (size(1.0), case % 2 == 0);
        let part = if runs_away { 1.1 } else { 0.9 };
        let method = Method::ALL[case % Method::ALL.len()];
        check_braked(&arm, [damping, brake], bend, part, method, runs_away);
    }
}

/// A hanging arm with its elbow bent and braked, and `part` of the integral that the shoulder bears. As the elbow does not
/// move, `J s³ + kd s² + (kp + G') s + ki` is stable as far as `kd (kp + G') > J ki`.
fn check_braked(arm: &Arm<2>, kd: [f64; 2], bend: f64, part: f64, method: Method, runs_away: bool) {
    let pose = [-FRAC_PI_2, bend];
    let inertia = mass_matrix(arm, &pose)[0][0];
    let ([l1, l2], [m1, m2]) = (*arm.lengths(), *arm.masses());
    let weight = arm.gravity() * ((0.5 * m1 + m2) * l1 + 0.5 * m2 * l2 * f64::cos(bend));
    let gains = Gains {
        kp: [100.0; 2],
        ki: [part * kd[0] * (100.0 + weight) / inertia, 1.0],
        kd,
    };
    let control = ControlLoop::new(*arm, gains, Setpoint::at(pose)).with_method(method);
    let found = limits(&control);
    let told = format!("{part}: {found:?} {bend} {gains:?} {arm:?}");
    assert_eq!(found.held == Some(0.0), runs_away, "{told}");
    assert_eq!(found.rest == Rest::Unstable, runs_away, "{told}");
    assert_eq!(limit_held(&control) == Some(0.0), runs_away, "{told}");
}

/// From the starting pose the live estimate was 0.31 of midpoint's error and 0.63 of Verlet's, and said nothing of
/// velocities.
#[test]
fn the_error_of_the_first_step_from_the_start_is_estimated() {
    fn check<const N: usize>() {
        for (method, h) in Method::ALL
            .into_iter()
            .flat_map(|one| [(one, 1e-3), (one, 2e-3), (one, 1e-2)])
        {
            let arm = Arm::<N>::default();
            let start = State::<N>::rest();
            let seen = estimate_step(&arm, &start, &[0.0; N], method, h).unwrap();
            let mut truth = TaylorReference::new(start);
            assert!(truth.follow(&arm, &[0.0; N], h));
            let mut live = Simulation::new(arm, pendularm::study::control_loop::no_control());
            live.set_method(method);
            live.set_timestep(h);
            live.advance(1);
            let off = |a: &[f64; N], b: &[f64; N]| {
                (0..N).map(|i| (a[i] - b[i]).abs()).fold(0.0, f64::max)
            };
            let position = off(&truth.state().position, &live.state().position);
            let velocity = off(&truth.state().velocity, &live.state().velocity);
            // RK4's at 1 ms is lost in rounding.
            for (seen, exact) in [
                (seen.local_error, position),
                (seen.velocity_error, velocity),
            ] {
                assert!(
                    exact < 1e-14 || (seen / exact - 1.0).abs() < 0.1,
                    "{N} {method} {h}: {seen:e} for {exact:e}"
                );
            }
        }
    }
    check::<2>();
    check::<3>();
}

/// At the timestep that was advised 6 of 40 Euler moves of up to 8π a joint were lost, and 26 of 40 of up to 16π. The limit
/// of the motion keeps all of them.
#[test]
fn moves_of_many_turns_are_kept_within_the_advice() {
    let mut rng = fastrand::Rng::with_seed(71);
    let still = limits(&default_at([0.0; 3]).with_method(Method::Euler))
        .trusted()
        .unwrap();
    let mut lost_before = 0;
    for case in 0..80 {
        let turns = if case % 2 == 0 { 4.0 } else { 8.0 };
        let setpoint = std::array::from_fn(|_| turns * TAU * (2.0 * rng.f64() - 1.0));
        let control = default_at::<3>(setpoint).with_method(Method::Euler);
        let survives = |timestep: f64| {
            let mut live = control.with_timestep(timestep).simulation(State::rest());
            let steps = (10.0 / timestep) as u64;
            let whole = live.advance(steps) == steps;
            let off = (0..3).map(|i| (live.state().position[i] - setpoint[i]).abs());
            whole && off.fold(0.0, f64::max) < 0.1
        };
        lost_before += u32::from(!survives(0.8 * still));
        let motion = Motion::ahead(&control, &State::rest());
        let advised = 0.8 * still.min(motion.timestep);
        assert!(survives(advised), "case {case}: {advised} s, {setpoint:?}");
    }
    println!("{lost_before} of 80 lost at rest's own advice");
    assert!(lost_before > 10, "{lost_before}");
}
