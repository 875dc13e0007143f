//! Planned runs and returned errors, against motions of twice the digits.

use std::f64::consts::PI;

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::report::experiments::reference::{Law, ReferenceMotion};
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::paused::at_once;
use pendularm::study::planner::{Task, plan};
use pendularm::study::rollout::{RolloutRequest, rollout};

use super::{Dice, Tally, cases, property, run, tells};
use crate::planner::error_within;

/// A state to begin with, and a time for which the motion from there is known.
fn start<const N: usize>(dice: &mut Dice, arm: &Arm<N>) -> (State<N>, f64) {
    let reach = arm.reach();
    let state = State {
        position: std::array::from_fn(|_| PI * dice.any()),
        velocity: std::array::from_fn(|_| dice.any() / reach.sqrt()),
    };
    (state, (0.5 + 1.5 * dice.0.f64()) * reach.sqrt().min(2.0))
}

/// A planned run is within the allowed error of a motion of twice the digits.
fn a_plan_keeps_its_error<const N: usize>(case: u64, tally: &mut Tally) {
    let mut dice = Dice::of(case);
    let arm = dice.arm::<N>();
    let (start, duration) = start(&mut dice, &arm);
    let error = arm.reach() * 1e-4 * dice.size(2.0);
    let task = Task {
        control: ControlLoop::free(arm),
        start,
        duration,
        error,
    };
    let Ok(planned) = at_once(plan(task)) else {
        tally.open += 1;
        return;
    };
    for candidate in &planned.candidates {
        let off = error_within(duration, &task, &Law::FREE, candidate);
        assert!(off <= error, "case {case}: {off:e} {task:?} {candidate:?}");
        tally.tried += 1;
    }
}

/// The true error is within the uncertainty of a rollout's error, for regular and for chaotic motions.
fn an_uncertainty_holds_the_true_error<const N: usize>(case: u64, tally: &mut Tally) {
    let mut dice = Dice::of(case);
    let arm = dice.arm::<N>();
    let (start, mut duration) = start(&mut dice, &arm);
    let wild = if dice.one_in(2) { 10.0 } else { 1.0 };
    duration *= wild;
    let control =
        ControlLoop::free(arm).with_method(Method::ALL[dice.0.usize(0..Method::ALL.len())]);
    let timestep = duration / (wild * f64::from(dice.0.u32(100..4000)));
    let request = RolloutRequest {
        control: control.with_timestep(timestep),
        start,
        duration,
        samples: 5,
        reference: true,
    };
    let made = at_once(rollout(request)).unwrap();
    let (Some(error), Some(uncertainty)) = made.known(made.deviation.as_ref()) else {
        tally.open += 1;
        return;
    };
    let truth = ReferenceMotion::new(&arm, &start, &Law::FREE, duration);
    let samples = made.times.iter().zip(&made.positions);
    let off = samples.map(|(time, position)| truth.angle_error(*time, position));
    let off = off.fold(0.0, f64::max);
    tally.tried += 1;
    if (error - off).abs() > uncertainty {
        println!("case {case}: {error:e} ± {uncertainty:e}: {off:e} {request:?}");
        tally.outside += 1;
    }
}

#[test]
fn plans_for_random_arms_keep_their_error() {
    tells(property!(a_plan_keeps_its_error, 12, 10_000));
}

#[test]
fn uncertainties_of_random_rollouts_hold_the_true_error() {
    let tally = property!(an_uncertainty_holds_the_true_error, 40, 1_000_000);
    assert!(tally.outside <= tally.tried / 100, "{tally:?}");
    tells(tally);
}
