//! A goal's entry and dwell at every physics step, and the cadence of its feedback, in simulation time alone.

use glam::{DVec2, dvec2};
use pendularm::math::goal::{Cadence, Criteria, Goal, Outcome};
use proptest::prelude::*;

const TARGET: DVec2 = dvec2(1.0, 0.5);
const THERE: DVec2 = TARGET;
const AWAY: DVec2 = dvec2(1.5, 0.5);

/// A timestep whose multiples, and those of a second, are exact: the test counts rules, not rounding.
const H: f64 = 0.125;

fn goal(epsilon: f64, success_hold: f64, start: f64) -> Goal {
    let criteria = Criteria {
        epsilon,
        success_hold,
    };
    Goal::new(TARGET, criteria, start)
}

#[test]
fn a_goal_tells_its_age_and_its_end_by_name() {
    let goal = goal(0.1, 0.5, 3.0);
    let ages = [5.5, 3.0, 2.0].map(|time| goal.elapsed(time));
    assert_eq!(
        ages,
        [2.5, 0.0, 0.0],
        "a clock set back makes none negative"
    );
    let ends = [Outcome::Reached, Outcome::Preempted].map(Outcome::name);
    assert_eq!(ends, ["reached", "preempted"]);
}

/// The step (counted from 1) after which a goal is reached, by `success_hold`, timestep and the steps at which the end
/// effector is within epsilon.
#[test]
fn a_goal_is_reached_after_staying_within_epsilon_for_success_hold() {
    type Row = (&'static str, f64, f64, fn(u32) -> bool, Option<u32>);
    let rows: [Row; 8] = [
        ("entered at the 3rd step", 0.5, H, |k| k >= 3, Some(7)),
        ("passed through", 0.5, H, |k| (3..=6).contains(&k), None),
        ("left one step too early", 0.625, H, |k| k != 6, Some(12)),
        (
            "left nine times",
            0.5,
            H,
            |k| k % 5 != 0 || k > 49,
            Some(50),
        ),
        ("no hold: the first entry", 0.0, H, |k| k >= 5, Some(5)),
        ("no hold: there at once", 0.0, H, |_| true, Some(1)),
        ("never there", 0.0, H, |_| false, None),
        // The only known states are two consecutive steps within epsilon, two seconds apart.
        ("steps longer than the hold", 0.5, 2.0, |k| k >= 2, Some(3)),
    ];
    for (name, hold, h, is_there, expected) in rows {
        let mut goal = goal(0.1, hold, 0.0);
        let path = |k| if is_there(k) { THERE } else { AWAY };
        let reached = (1..=100).find(|&k| goal.judge(f64::from(k) * h, path(k)));
        assert_eq!(reached, expected, "{name}");
    }
}

#[test]
fn the_edge_of_epsilon_is_within_and_a_hand_that_is_nowhere_is_not() {
    let mut at_edge = goal(0.5, 0.0, 0.0);
    assert_eq!(at_edge.distance(AWAY), 0.5);
    assert!(at_edge.judge(H, AWAY));
    let nowhere = [DVec2::NAN, DVec2::INFINITY, dvec2(f64::MAX, -f64::MAX)];
    for beyond in nowhere.into_iter().chain([dvec2(1.5f64.next_up(), 0.5)]) {
        assert!(!at_edge.judge(H, beyond), "{beyond}");
    }
    assert!(at_edge.distance(dvec2(1e300, 1e300)).is_finite());
}

/// While paused the arm takes no step, and the goal is not judged. A second query at the same time has the same answer.
#[test]
fn a_pause_neither_helps_nor_harms_the_dwell_and_a_clock_set_back_starts_it_over() {
    let mut goal = goal(0.1, 0.5, 100.0);
    for k in [1, 2, 3, 4].into_iter().chain([4; 1000]) {
        assert!(!goal.judge(100.0 + f64::from(k) * H, THERE));
    }
    let mut ahead = goal;
    assert!(ahead.judge(100.0 + 5.0 * H, THERE));
    for k in 1..=4 {
        assert!(!goal.judge(f64::from(k) * H, THERE));
    }
    assert!(goal.judge(5.0 * H, THERE));
    assert_eq!(goal.elapsed(0.5), 0.0);
}

proptest! {
    #[test]
    fn rounding_of_the_clock_never_costs_or_saves_a_step(
        // The clock is base + k·timestep, at any time of a month, for timesteps that decimals name.
        base in prop_oneof![Just(0.0), 0.0..3e6f64],
        (h, per_hold, hold) in prop_oneof![
            Just((0.001, 500u32, 0.5)),
            Just((0.002, 250, 0.5)),
            Just((0.0001, 3000, 0.3)),
            Just((0.003, 100, 0.3)),
            Just((0.1, 7, 0.7)),
            Just((0.01, 29, 0.29)),
            Just((1e-5, 10_000, 0.1)),
        ],
        first in 1u32..5000,
    ) {
        let mut goal = goal(0.1, hold, base);
        let reached = (1..=first + 2 * per_hold).find(|&k| {
            goal.judge(base + f64::from(k) * h, if k < first { AWAY } else { THERE })
        });
        prop_assert_eq!(reached, Some(first + per_hold));
    }
}

// ---------------------------------------------------------------------------------------------------------- feedback

/// The steps (counted from 1) after which feedback is due, of steps of `h` seconds.
fn due(cadence: &mut Cadence, base: f64, h: f64, steps: u32) -> Vec<u32> {
    (1..=steps)
        .filter(|&k| cadence.due(base + f64::from(k) * h))
        .collect()
}

#[test]
fn feedback_comes_sixty_times_per_second_of_progress_or_once_per_longer_step() {
    let hertz = |rate: f64| 1.0 / rate;
    for (base, h, steps, expected) in [
        (0.0, 0.001, 10_000, 600),
        (1234.567, 1e-4, 100_000, 600),
        (2.5e6, hertz(240.0), 2400, 600),
        (0.0, hertz(60.0), 600, 600),
        (2.5e6, 0.001, 10_000, 600),
        (0.0, 0.02, 100, 100),
        (0.0, 0.1, 100, 100),
        (0.0, 7.0, 100, 100),
    ] {
        let steps = due(&mut Cadence::default(), base, h, steps);
        assert_eq!(steps.len(), expected, "h = {h} from {base}");
    }
}

#[test]
fn progress_without_a_request_is_not_invented() {
    let mut cadence = Cadence::default();
    let rows = [(0.0, true), (10.0, true), (10.001, false), (10.001, false)];
    for (time, is_due) in rows.into_iter().chain([(10.02, true)]) {
        assert_eq!(cadence.due(time), is_due, "{time}");
    }
}

#[test]
fn feedback_starts_afresh_when_the_clock_is_set_back() {
    let mut cadence = Cadence::default();
    due(&mut cadence, 100.0, 0.001, 1000);
    assert_eq!(due(&mut cadence, 0.0, 0.001, 1000).len(), 60);
}
