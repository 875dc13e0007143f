//! Plans, against references of twice the digits: their error is within the allowed one.

use std::f64::consts::PI;

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::kinematics::forward;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::report::experiments::reference::{Law, ReferenceMotion};
use pendularm::study::beside::largest_distance;
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::method::named;
use pendularm::study::paused::at_once;
use pendularm::study::planner::{self, Candidate, MAX_DURATION, PlanError, Planned, Task};

use crate::reference::state;
use crate::stored::gains;

pub(crate) fn plan<const N: usize>(task: Task<N>) -> Result<Planned, PlanError> {
    at_once(planner::plan(task))
}

/// A move from rest, and its continuous law.
pub(crate) fn moving(
    gains: Gains<2>,
    setpoint: [f64; 2],
    duration: f64,
    error: f64,
) -> (Task<2>, Law<2>) {
    let setpoint = Setpoint::at(setpoint);
    let control = ControlLoop::new(Arm::default(), gains, setpoint);
    let task = Task {
        control,
        ..falling(Arm::default(), duration, error)
    };
    (task, Law::Continuous(gains, setpoint))
}

/// Plans, and passes if every candidate is within the error for the first seconds.
fn planned_within(span: f64, task: Task<2>, law: &Law<2>) -> Planned {
    let planned = plan(task).unwrap();
    for candidate in &planned.candidates {
        let seen = error_within(span, &task, law, candidate);
        assert!(seen <= task.error, "{candidate:?}: {seen:e}");
    }
    planned
}

/// The largest distance of the end effector from the reference within the first seconds, at fifty instants.
pub(crate) fn error_within<const N: usize>(
    span: f64,
    task: &Task<N>,
    law: &Law<N>,
    candidate: &Candidate,
) -> f64 {
    let steps = (span / candidate.timestep).round() as usize;
    let every = (steps / 50).max(1);
    let count = steps / every;
    let spacing = candidate.timestep * every as f64;
    let truth = ReferenceMotion::new(&task.control.arm, &task.start, law, spacing * count as f64);
    let control = task.control.with_method(candidate.method);
    let mut live = control
        .with_timestep(candidate.timestep)
        .simulation(task.start);
    let tip = |state: &State<N>| forward(task.control.arm.lengths(), &state.position).position;
    (1..=count)
        .map(|sample| {
            live.advance(every as u64);
            tip(live.state()).distance(tip(&state(&truth, spacing * sample as f64)))
        })
        .fold(0.0, f64::max)
}

/// Under control the held effort causes the error, so that the method with the fewest evaluations wins.
#[test]
fn a_planned_move_under_control_stays_within_its_error_of_the_continuous_law() {
    let (task, law) = moving(Gains::default(), [0.8, -0.6], 2.0, 5e-3);
    let planned = planned_within(task.duration, task, &law);
    assert_eq!(planned.best.method, Method::Euler, "{planned:?}");
    let costs = planned.candidates.iter().map(|one| one.evaluations);
    assert!(costs.is_sorted_by(|one, other| one >= other));
}

/// A run has whole periods, and not one period more than the duration needs.
#[test]
fn a_plan_with_a_control_period_lasts_at_least_its_duration() {
    for (duration, period, count) in [(0.0059, 0.004, 2), (0.1, 0.003, 34), (0.006, 0.0012, 5)] {
        let (mut task, _) = moving(Gains::default(), [0.8, -0.6], duration, 1e-3);
        task.control.period.period = period;
        let best = plan(task).unwrap().best;
        let run = best.evaluations as f64 / f64::from(best.method.evaluations()) * best.timestep;
        assert!((run / period - f64::from(count)).abs() < 1e-9, "{best:?}");
    }
}

/// A stiff loop has its largest error in its first milliseconds, a fast link at some angle of every turn: the planned run
/// is compared after each step.
#[test]
fn no_peak_is_overlooked() {
    for (kp, kd, error) in [
        ([20000.0, 5000.0], [300.0, 60.0], 0.01),
        ([20000.0, 9000.0], [1000.0, 100.0], 0.003),
    ] {
        let (task, law) = moving(gains(kp, [0.0; 2], kd), [0.5, 0.5], 4.0, error);
        planned_within(0.05, task, &law);
    }
    let turning = Task {
        start: State {
            position: [0.0; 2],
            // A turn in 50 ms.
            velocity: [0.0, 40.0 * PI],
        },
        ..falling(Arm::default().weightless(), 1.0, 0.02)
    };
    planned_within(1.0, turning, &Law::FREE);
}

#[test]
fn a_chaotic_motion_is_not_planned() {
    let swing = |duration| plan(falling(Arm::default(), duration, 1e-3));
    assert!(matches!(swing(100.0), Err(PlanError::Unknown(_))));
    let long = MAX_DURATION.next_up();
    assert_eq!(swing(long), Err(PlanError::TooLong(long)));
}

pub(crate) fn falling(arm: Arm<2>, duration: f64, error: f64) -> Task<2> {
    Task {
        control: ControlLoop::free(arm),
        start: State::rest(),
        duration,
        error,
    }
}

/// The error is not monotone in the number of steps, so that a bisection would miss the fewest.
#[test]
fn a_plan_has_the_fewest_evaluations_of_all_whole_numbers_of_steps() {
    let even = Arm::<2>::default();
    let long = Arm::new([100.0; 2], [1.0; 2], 9.81).unwrap();
    for (task, evaluations) in [
        (falling(even, 2.0, 1e-4), 276),
        (falling(even, 2.0, 1e-3), 208),
        (falling(long, 10.0, 0.1), 80),
    ] {
        let planned = plan(task).unwrap();
        let is_best = planned.best.evaluations <= evaluations;
        assert!(is_best, "{evaluations}: {planned:?}");
    }
}

/// Without an advised timestep nothing is run, and the error gives the reason.
#[test]
fn a_plan_without_a_run_gives_the_reason() {
    let gains = gains([20.0, 5.0], [10.0, 2.0], [8.0, 2.0]);
    let (task, _) = moving(gains, [0.5, 0.5], 4.0, 5e-2);
    let mut rare = moving(Gains::default(), [1.0, 0.0], 4.0, 5e-2).0;
    rare.control.period.period = 6e-3;
    for task in [task, rare] {
        let why = plan(task).unwrap_err().to_string();
        let is_reason = why.contains("unstable") && !why.contains("4000000");
        assert!(is_reason, "{why}");
    }
}

#[test]
fn a_run_that_diverges_is_infinitely_far_off_however_far_is_allowed() {
    let arm = Arm::<2>::default();
    let boxed = |timestep| {
        let control = ControlLoop::free(arm).with_timestep(timestep);
        Box::new(control.simulation(State::rest()))
    };
    // The first step of 1e308 s is not finite.
    for [run, reference] in [[1e308, 1e-3], [1e-3, 1e308]].map(|pair| pair.map(boxed)) {
        let off = largest_distance(&arm, (run, 1_000_000), (reference, 1), f64::INFINITY);
        assert!(at_once(off).is_infinite());
    }
}

/// The program's text for a plan: its numbers are short, and it starts in the given state with the given clocks.
#[test]
fn the_text_of_a_plan_has_short_numbers() {
    use pendularm::plan::{Links, PlanOptions, run};
    let options = PlanOptions {
        error: 0.1,
        controller: false,
        duration: Some(1e-300),
        links: Links::Two,
        setpoint: vec![],
        position: vec![],
        velocity: vec![],
        control_period: None,
        delay: false,
    };
    let text = run(&options).unwrap();
    assert!(text.lines().all(|line| line.len() < 160), "{text}");
    let text = run(&PlanOptions {
        error: 0.01,
        controller: true,
        duration: Some(0.1),
        setpoint: vec![0.3, 0.2],
        position: vec![0.2, 0.1],
        control_period: Some(0.002),
        delay: true,
        ..options
    })
    .unwrap();
    assert!(text.contains("control period 2.0000e-3 s"), "{text}");
}

/// The plan of a method of one's own is measured beside the others. Its own tableau costs Runge-Kutta 4 the same.
#[test]
fn a_method_of_ones_own_is_planned_beside_the_arms() {
    let beside = |task: Task<2>, name| {
        let pair = named(name).unwrap().pair().clone();
        at_once(planner::plan_beside(task, Some(pair))).unwrap()
    };
    let falling = |error| falling(Arm::default(), 2.0, error);
    let held = gains([200.0, 100.0], [20.0, 10.0], [30.0, 12.0]);
    let (moving, _) = moving(held, [1.0, -0.5], 2.0, 0.01);
    for task in [falling(1e-6), moving] {
        let planned = beside(task, "rk4");
        let is_rk4 = |one: &&Candidate| one.method == Method::Rk4;
        let alone = planned.candidates.iter().find(is_rk4);
        let own = planned.own.unwrap();
        assert!(own.error <= task.error, "{planned:?}");
        // Under control both timesteps are a part of a limit, over all poses or at the setpoint.
        if let Some(alone) = alone.filter(|_| task.control.is_free()) {
            let ratio = own.evaluations as f64 / alone.evaluations as f64;
            assert!((ratio - 1.0).abs() < 0.02, "{planned:?}");
        }
        let without = at_once(planner::plan(task)).unwrap();
        assert_eq!((without.best, without.own), (planned.best, None));
    }
    let five = beside(falling(1e-9), "dormand_prince5");
    assert!(
        five.own.unwrap().evaluations < five.best.evaluations,
        "{five:?}"
    );
    assert_eq!(beside(falling(1e-6), "euler").own, None);
}
