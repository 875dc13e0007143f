//! An independent recomputation of the study found these sentences false; here each is tried on its own example.

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::report::experiments::error::scenes;
use pendularm::report::experiments::nonlinear::PeriodicSwing;
use pendularm::report::experiments::reference::{Law, ReferenceMotion};
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::motion::Motion;
use pendularm::study::planner::{PlanError, Planned, Planning, Task};
use pendularm::study::rollout::{Rollout, RolloutRequest};
use pendularm::study::stability::{ADVISED_PART, limits};

/// The timestep that `/study/stability` advises.
pub(crate) fn advised<const N: usize>(control: &ControlLoop<N>, state: &State<N>) -> f64 {
    let motion = Motion::ahead(control, state).timestep;
    let limits = limits(control).advised.unwrap_or(f64::INFINITY);
    limits.min(ADVISED_PART * motion)
}

fn two(kp: [f64; 2], ki: [f64; 2], kd: [f64; 2]) -> Gains<2> {
    Gains { kp, ki, kd }
}

/// Whether the arm stays within the finite numbers, and ends slower than it may fall.
fn survives<const N: usize>(
    control: &ControlLoop<N>,
    start: State<N>,
    timestep: f64,
    duration: f64,
) -> bool {
    let mut live = control.with_timestep(timestep).simulation(start);
    let steps = (duration / timestep).ceil() as u64;
    live.advance(steps) == steps && live.state().velocity.iter().all(|v| v.abs() < 50.0)
}

// ---- 1: the periodic swing ------------------------------------------------------------------------------------------

/// A secant search jumped to another orbit at 1.5 rad. The swing that begins at small amplitude is stable up to 1.89 rad.
#[test]
fn a_periodic_swing_is_continued_in_amplitude() {
    let swing = PeriodicSwing::of(1.5).unwrap();
    assert!(
        (swing.start.position[1] + 0.48957).abs() < 1e-5,
        "{swing:?}"
    );
    assert!((swing.period - 2.57052).abs() < 1e-5, "{swing:?}");
    for (amplitude, modulus) in [
        (1.5, 1.0),
        (1.8, 1.0),
        (1.89, 1.0),
        (1.9, 1.68),
        (2.0, 10.35),
    ] {
        let swing = PeriodicSwing::of(amplitude).unwrap();
        let seen = swing.transverse(Method::Rk4, 4096);
        assert!(
            (seen / modulus - 1.0).abs() < 5e-3,
            "{amplitude}: {seen} {swing:?}"
        );
    }
}

// ---- 2: numbers that were run ---------------------------------------------------------------------------------------

/// Between two runs the error is no power law: 20.3 ms were printed where 18.0 ms is the longest timestep.
#[test]
fn the_first_headline_is_a_run() {
    let all = scenes();
    let swing = all.iter().find(|scene| scene.name() == "swing-2").unwrap();
    for (steps, error) in [(69, 2.5e-4), (78, 3.4e-4), (99, 1.65e-4), (110, 1.0e-4)] {
        let seen = swing.run(Method::Rk4, steps).error;
        assert!((seen / error - 1.0).abs() < 0.05, "{steps}: {seen:e}");
    }
}

/// The number that follows `before` in the README, in the unit that follows it.
pub(crate) fn printed(text: &str, before: &str) -> f64 {
    let after = text
        .split_once(before)
        .unwrap_or_else(|| panic!("{before}"))
        .1;
    let mut words = after.split(|c: char| c.is_whitespace() || "*,;".contains(c));
    let mut number = words.next().unwrap().to_owned();
    if let Some((mantissa, power)) = number.clone().split_once("·10") {
        let digits = power.chars().map(|digit| match digit {
            '⁻' => '-',
            _ => char::from_digit(
                "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().position(|one| one == digit).unwrap() as u32,
                10,
            )
            .unwrap(),
        });
        number = format!("{mantissa}e{}", digits.collect::<String>());
    }
    let unit = match words.next().map(|unit| unit.trim_end_matches('.')) {
        Some("ms") => 1e-3,
        Some("µs") => 1e-6,
        _ => 1.0,
    };
    let number = number.trim_end_matches('.').parse::<f64>();
    unit * number.unwrap_or_else(|why| panic!("{before}: {why}"))
}

/// The plans of docs/study.md are run again.
#[test]
fn the_plans_of_the_study_are_runs() {
    let study = include_str!("../../docs/study.md");
    let servo = Task {
        control: ControlLoop::new(
            Arm::<2>::default(),
            Gains::default(),
            Setpoint::at([0.8, -0.6]),
        ),
        start: State::rest(),
        duration: 4.0,
        error: 0.01,
    };
    for (task, before, method) in [
        (servo, "take Euler ", Method::Euler),
        (free(Arm::default(), 10.0, 1e-6), "takes RK4 ", Method::Rk4),
    ] {
        let planned = plan(task).unwrap();
        let best = planned.best().unwrap();
        assert_eq!(best.method, method, "{planned:?}");
        assert!(
            (printed(study, before) / best.timestep - 1.0).abs() < 5e-3,
            "{planned:?}"
        );
    }
}

// ---- 3: advice ------------------------------------------------------------------------------------------------------

/// Soft springs sag, and the arm falls: nothing was said to move, and the arm left the numbers within 3 s.
#[test]
fn springs_that_will_sag_count_their_fall() {
    let rk4 = [
        (two([4.6, 0.93], [0.0; 2], [0.95, 0.19]), [-1.1, -1.3]),
        (two([1e-3; 2], [0.0; 2], [1e-3; 2]), [0.0; 2]),
    ];
    let verlet = [
        (two([4.5, 0.9], [0.0; 2], [1.3, 0.27]), [0.0; 2]),
        (two([2.0, 0.667], [0.0; 2], [0.2, 0.0667]), [0.0; 2]),
    ];
    for (method, cases) in [(Method::Rk4, rk4), (Method::Verlet, verlet)] {
        for (gains, setpoint) in cases {
            let control = ControlLoop::new(Arm::<2>::default(), gains, Setpoint::at(setpoint));
            let control = control.with_method(method);
            let start = State::at_rest(setpoint);
            let timestep = advised(&control, &start);
            assert!(
                survives(&control, start, timestep, 30.0),
                "{gains:?}: {timestep}"
            );
            let free = advised(&ControlLoop::free(control.arm).with_method(method), &start);
            assert!(timestep <= 2.0 * free, "{gains:?}: {timestep}, free {free}");
        }
    }
}

/// Asked at one setpoint the minimum over all poses was 39.6 ms, asked at another 2.76 ms. The loop runs away where an
/// integral acts and springs are too soft, so there is none.
#[test]
fn a_minimum_over_all_poses_does_not_depend_on_the_setpoint() {
    let gains = two([15.0, 23.0], [0.49, 7.5], [1.6, 3.5]);
    let at = |setpoint| ControlLoop::new(Arm::<2>::default(), gains, Setpoint::at(setpoint));
    for setpoint in [[0.0, 0.0], [0.537, 0.9821], [-1.5, 0.2]] {
        let found = limits(&at(setpoint));
        assert_eq!(found.minimum_held, Some(0.0), "{setpoint:?}: {found:?}");
        assert!(!found.certified && found.bound.is_none(), "{found:?}");
    }
    let near = at([0.537, 0.9821]);
    assert!(limits(&near).advised.unwrap() < 2.76e-3);
}

/// The integral makes a large move faster: 8.76 ms were advised, and lost the arm after 0.2 s.
#[test]
fn integrals_count_in_the_speed_of_a_move() {
    let arm = Arm::new([1.14, 0.91], [5.7, 3.2], 9.81).unwrap();
    let gains = two([970.0, 170.0], [6600.0, 550.0], [100.0, 36.0]);
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

// ---- 4: plans -------------------------------------------------------------------------------------------------------

fn plan<const N: usize>(task: Task<N>) -> Result<Planned, PlanError> {
    let mut planning = Planning::new(task)?;
    loop {
        if let Some(planned) = planning.advance() {
            return planned;
        }
    }
}

fn free(arm: Arm<2>, duration: f64, error: f64) -> Task<2> {
    Task {
        control: ControlLoop::free(arm),
        start: State::rest(),
        duration,
        error,
    }
}

/// Steps were whole parts of 50 ms, and bisection missed runs where the error is not monotone.
#[test]
fn a_plan_has_the_fewest_evaluations_of_all_whole_numbers_of_steps() {
    let even = Arm::<2>::default();
    let long = Arm::new([100.0; 2], [1.0; 2], 9.81).unwrap();
    for (task, evaluations) in [
        (free(even, 2.0, 1e-4), 276),
        (free(even, 2.0, 1e-3), 208),
        (free(long, 10.0, 0.1), 80),
    ] {
        let planned = plan(task).unwrap();
        let best = planned.best().unwrap();
        assert!(
            best.evaluations <= evaluations,
            "{evaluations}: {planned:?}"
        );
    }
}

/// Nothing is run where nothing is advised, and the answer says so.
#[test]
fn a_plan_that_ran_nothing_says_why() {
    let gains = two([20.0, 5.0], [10.0, 2.0], [8.0, 2.0]);
    let task = Task {
        control: ControlLoop::new(Arm::<2>::default(), gains, Setpoint::at([0.5, 0.5])),
        start: State::rest(),
        duration: 4.0,
        error: 5e-2,
    };
    let why = plan(task).unwrap_err().to_string();
    assert!(
        why.contains("unstable") && !why.contains("4000000"),
        "{why}"
    );
}

// ---- 5: uncertainty -------------------------------------------------------------------------------------------------

/// The error of a rollout, its uncertainty, and the truth.
fn rollout_error<const N: usize>(
    start: State<N>,
    timestep: f64,
    duration: f64,
) -> (Option<f64>, f64, f64) {
    let request = RolloutRequest {
        control: ControlLoop::free(Arm::default()).with_timestep(timestep),
        start,
        duration,
        samples: 101,
        reference: true,
    };
    let mut rollout = Rollout::new(request).unwrap();
    while rollout.advance(u64::MAX) > 0 {}
    let mut before = 0.0;
    let times = rollout.times()[1..].iter();
    let intervals: Vec<f64> = times
        .map(|time| time - std::mem::replace(&mut before, *time))
        .collect();
    let truth = ReferenceMotion::between(&request.control.arm, &start, &Law::FREE, &intervals);
    let off = (0..truth.len()).map(|index| {
        let position = &rollout.positions()[index + 1];
        truth.angle_error(index, position).unwrap()
    });
    let (known, uncertainty) = rollout.known(rollout.deviation());
    (known, uncertainty.unwrap(), off.fold(0.0, f64::max))
}

/// 4.49261e-7 ± 3.3e-12 was answered where the truth is 4.49041e-7, and 46.4 ± 1.8 where it is 67.66.
#[test]
fn an_uncertainty_holds_the_truth() {
    let swing = State::at_rest([2.9, -1.5]);
    let (known, uncertainty, truth) = rollout_error(swing, 2e-4, 15.0);
    if let Some(error) = known {
        assert!(
            (error - truth).abs() <= uncertainty,
            "{error} ± {uncertainty:e}: {truth}"
        );
    }
    let chaos = State {
        position: [
            -0.138_385_801_444_578_68,
            -2.268_683_925_566_427_3,
            0.730_119_733_251_523_7,
        ],
        velocity: [
            3.380_475_563_088_675,
            3.921_663_647_209_602,
            -5.841_560_440_036_96,
        ],
    };
    let timestep = 0.240_455_119_997_936_62e-3;
    let (known, uncertainty, truth) = rollout_error(chaos, timestep, 60_000.0 * timestep);
    if let Some(error) = known {
        assert!(
            (error - truth).abs() <= uncertainty,
            "{error} ± {uncertainty:e}: {truth}"
        );
    }
    // Nothing is known better than to a last digit.
    let hanging = State::at_rest([-std::f64::consts::FRAC_PI_2, 0.0]);
    let (_, uncertainty, _) = rollout_error(hanging, 1e-3, 1.0);
    assert!(uncertainty >= f64::EPSILON, "{uncertainty:e}");
}
