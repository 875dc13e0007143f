//! Limits of the timestep divide stable from unstable, and no pose has a smaller one.

use std::f64::consts::{PI, TAU};

use pendularm::report::experiments::measure::{STEPS, growth};
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::linear::{Linear, equilibrium};
use pendularm::study::stability::{
    BEYOND, Rest, Sampling, largest_timestep, limit_held, limits, step_matrix,
};

use super::{Dice, Tally, cases, property, run, tells};
use crate::equilibrium::residual;

/// How far below and above a predicted limit the arm is watched.
const ASIDE: f64 = 0.03;

/// Least change, in factors e, of the slowest mode's energy during a run. With less the run is too short to show the
/// mode, since faster modes hide it in the first window.
const DECIDED: f64 = 12.0;

/// Growth of the energy of a small deviation at this timestep, infinite where it escapes, and whether the watch is long
/// enough for the slowest mode to show.
fn watched<const N: usize>(control: &ControlLoop<N>, linear: &Linear) -> (f64, bool) {
    let step = step_matrix(linear, control.method, Sampling::Held, control.timestep);
    let changes = 1.25 * STEPS as f64 * step.spectral_radius().ln();
    let growth = growth(control, Sampling::Held).unwrap_or(f64::INFINITY);
    (growth, changes.abs() > DECIDED)
}

/// At the resting pose there is no effort. A small deviation decays below the limit and grows beyond it, and always
/// grows in a loop that is unstable at every timestep.
fn a_limit_divides_decay_from_growth<const N: usize>(case: u64, tally: &mut Tally) {
    let control = Dice::of(case).control::<N>();
    let told = format!("case {case}: {control:?}");
    let rest = equilibrium(&control);
    let linear = Linear::at(&control, &rest.position, &rest.integrating);
    let load = pendularm::math::dynamics::gravity_load(&control.arm, &rest.position);
    let stiffest = control.gains.kp.iter().copied();
    let largest = load.map(f64::abs).into_iter().chain(stiffest);
    // Springs magnify what rounding makes of angles of some turns.
    assert!(
        residual(&control, &rest) <= 1e-12 * largest.fold(1.0, f64::max),
        "{told}: {rest:?}"
    );
    let mut judge = |timestep: f64, grows: bool| {
        let control = control.with_timestep(timestep);
        let (growth, is_shown) = watched(&control, &linear);
        // Measured decay is reliable; apparent growth may be the swing of a slow mode.
        if is_shown || (growth < 1.0 && !grows) {
            tally.tried += 1;
            assert_eq!(growth >= 1.0, grows, "{told}: {growth:e} at {timestep} s");
        } else {
            tally.open += 1;
        }
    };
    let rates = linear.flow().eigenvalues().into_iter();
    let fastest = rates
        .map(pendularm::study::matrix::Complex::modulus)
        .fold(0.0, f64::max);
    match limit_held(&control) {
        Some(0.0) => judge(0.02 / fastest, true),
        Some(limit) => {
            judge((1.0 - ASIDE) * limit, false);
            judge((1.0 + ASIDE) * limit, true);
        }
        None => judge(control.timestep, false),
    }
}

/// No pose has a smaller limit than the smallest, the advice is within it, and what is critical grows.
fn no_pose_is_worse_than_the_worst<const N: usize>(case: u64, tally: &mut Tally) {
    let mut dice = Dice::of(case);
    let control = dice.control::<N>();
    let told = format!("case {case}: {control:?}");
    let found = limits(&control);
    let least = found.minimum_held.unwrap_or(f64::INFINITY);
    assert!(
        // A loop that runs away in some pose is advised for its setpoint alone.
        least == 0.0 || found.advised.is_none_or(|advised| advised <= least),
        "{told}: {found:?}"
    );
    // A loop that clearly runs away is reported as such, and one that is stable at some timestep is not.
    let is_said = found.rest == Rest::Unstable;
    assert!(
        if is_said {
            found.held == Some(0.0)
        } else {
            !runs_away(&control)
        },
        "{told}: {found:?}"
    );
    // A limit counts growth of 1e-11, which may be slightly below or above the bound.
    assert!(
        found.bound.is_none_or(|bound| bound <= 1.0001 * least),
        "{told}: {found:?}"
    );
    if let Some(critical) = found.critical {
        // A swing grows by about a twentieth of the square of its rotation per step.
        let is_shown = TAU * critical.frequency * BEYOND * least > 1e-6;
        let growth = critical.growth_per_step;
        assert!(
            (growth > 1.0 || (growth == 1.0 && !is_shown))
                && critical.joint < N
                && critical.frequency <= 0.500_001 / (BEYOND * least),
            "{told}: {found:?}"
        );
    }
    for _ in 0..5 {
        let pose = std::array::from_fn(|_| PI * dice.any());
        let linear = Linear::at_pose(&control, &pose);
        // A pose from which gravity pulls the arm away says nothing about timesteps.
        let held = largest_timestep(&linear, control.method, Sampling::Held);
        let Some(held) = held.filter(|held| *held > 0.0) else {
            tally.open += 1;
            continue;
        };
        tally.tried += 1;
        if let Some(bound) = found.bound {
            assert!(
                held >= 0.999 * bound,
                "{told}: {held} at {pose:?}, {found:?}"
            );
        }
        // Some other pose runs away.
        if least == 0.0 {
            continue;
        }
        // A search alone may miss the worst pose by a little.
        let within = if found.certified { 0.99 } else { 0.9 };
        assert!(
            held >= within * least,
            "{told}: {held} at {pose:?}, {found:?}"
        );
    }
}

/// Whether the loop leaves its resting pose in continuous time.
fn runs_away<const N: usize>(control: &ControlLoop<N>) -> bool {
    let modes = Linear::at_setpoint(control).flow().eigenvalues();
    let fastest = modes.iter().map(|mode| mode.modulus()).fold(0.0, f64::max);
    modes.iter().any(|mode| mode.re > 1e-9 * fastest)
}

#[test]
fn limits_divide_decay_from_growth_on_random_loops() {
    tells(property!(a_limit_divides_decay_from_growth, 300, 1_000_000));
}

#[test]
fn no_pose_of_a_random_loop_is_worse_than_the_worst() {
    tells(property!(no_pose_is_worse_than_the_worst, 80, 20_000));
}

/// Its gains diverge without gravity, in a pose that gravity stabilises. The critical motion is the one without gravity.
#[test]
fn a_critical_motion_grows_also_if_only_the_weightless_arm_is_unstable() {
    no_pose_is_worse_than_the_worst::<3>(285, &mut Tally::default());
    let critical = limits(&Dice::of(285).control::<3>()).critical.unwrap();
    assert!(critical.growth_per_step > 1.0, "{critical:?}");
}

/// Two slow swings of almost the same rate, beside a damping rate of 20,000/s.
#[test]
fn swings_of_almost_the_same_rate_limit_nothing() {
    no_pose_is_worse_than_the_worst::<2>(658, &mut Tally::default());
}

/// In the first loop a damped joint without a spring falls, by 1e-11 of itself per step. In the second a swing grows by
/// 2e-16.
#[test]
fn a_critical_motion_may_grow_by_less_than_rounding() {
    for case in [195, 197] {
        no_pose_is_worse_than_the_worst::<3>(case, &mut Tally::default());
        let critical = limits(&Dice::of(case).control::<3>()).critical.unwrap();
        assert!(
            critical.growth_per_step < 1.0 + 1e-11,
            "{case}: {critical:?}"
        );
    }
}

/// Beyond a narrow unstable interval the loop is stable again.
#[test]
fn a_loop_that_is_stable_beyond_its_limit_has_no_critical_motion() {
    let control = Dice::of(20_766).control::<2>();
    let found = limits(&control);
    let linear = Linear::at_pose(&control, &found.worst_pose.unwrap());
    let radius = |part: f64| {
        let h = part * found.minimum_held.unwrap();
        step_matrix(&linear, control.method, Sampling::Held, h).spectral_radius()
    };
    assert!(radius(0.99) < 1.0 && radius(1.05) > 1.0 && radius(BEYOND) < 1.0);
    assert_eq!(found.critical, None);
}
