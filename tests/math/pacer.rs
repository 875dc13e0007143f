//! Simulation time runs at wall time: how many whole steps are due, at any timestep, after any delay.

use std::time::Duration;

use pendularm::math::pacer::{CATCH_UP, Pacer};
use proptest::prelude::*;

const SECOND: u64 = 1_000_000_000;
/// The arm wakes 60 times a second.
const WAKE: u64 = SECOND / 60;
const TEN_DAYS: u64 = 10 * 86_400 * SECOND;

fn ns(nanoseconds: u64) -> Duration {
    Duration::from_nanos(nanoseconds)
}

/// The timestep that a client writes as this many nanoseconds in decimal.
fn seconds(nanoseconds: u64) -> f64 {
    format!("{nanoseconds}e-9").parse().unwrap()
}

#[test]
fn the_pace_after_a_stall_is_the_usual_one() {
    let mut pacer = Pacer::new(Duration::ZERO, 0.001);
    let woken = 3600 * SECOND + 456_789;
    let due = pacer.due(ns(woken));
    pacer.took(due);
    for k in 1..=100 {
        assert_eq!(pacer.due(ns(woken + k * 10_000_000)), 10, "{k}");
        pacer.took(10);
    }
}

#[test]
fn a_restart_discards_the_unfinished_fraction_and_the_due_steps() {
    let mut pacer = Pacer::new(Duration::ZERO, 0.01);
    assert_eq!(pacer.due(ns(109_000_000)), 10);
    pacer.restart(ns(109_000_000), 0.01);
    assert_eq!(pacer.due(ns(109_000_000)), 0);
    assert_eq!(pacer.due(ns(118_999_999)), 0);
    assert_eq!(pacer.due(ns(119_000_000)), 1);
    pacer.restart(ns(119_000_000), 0.002);
    assert_eq!(pacer.due(ns(129_000_000)), 5);
}

#[test]
fn the_arm_is_behind_by_the_time_since_its_last_step_was_due() {
    let mut pacer = Pacer::new(ns(5 * SECOND), 0.01);
    let now = ns(5 * SECOND + 209_000_000);
    assert_eq!(pacer.due(now), 20);
    for (taken, behind) in [(0, 0.209), (5, 0.159), (15, 0.009)] {
        pacer.took(taken);
        assert!((pacer.behind(now) - behind).abs() < 1e-12, "{behind}");
    }
}

#[test]
fn a_clock_that_runs_backwards_makes_no_step_due() {
    let mut pacer = Pacer::new(ns(5 * SECOND), 0.001);
    assert_eq!(pacer.due(ns(4 * SECOND)), 0);
    let due = pacer.due(ns(5 * SECOND + 100_000_000));
    pacer.took(due);
    assert_eq!(pacer.due(ns(5 * SECOND + 50_000_000)), 0);
    assert_eq!(pacer.due(ns(5 * SECOND + 101_000_000)), 1);
}

/// Too large to count or too small to matter, a timestep never panics, overflows or loops.
#[test]
fn absurd_timesteps_do_no_harm() {
    let never = [1e300, f64::MAX, 1e12, f64::INFINITY, f64::NAN, -1.0];
    for timestep in never {
        let mut pacer = Pacer::new(Duration::ZERO, timestep);
        assert!((1..60_000).all(|k| pacer.due(ns(k * WAKE)) == 0));
    }
    for timestep in [1e-320, f64::from_bits(1), f64::MIN_POSITIVE, 1e-30, 0.0] {
        let mut pacer = Pacer::new(Duration::ZERO, timestep);
        assert_eq!(pacer.due(Duration::ZERO), 0);
        // The arm takes as many steps as its time allows, since the caller limits only the time.
        for k in 1..100_000 {
            assert!(pacer.due(ns(k * WAKE)) > 1_000_000, "{timestep}");
            pacer.took(1_000_000);
        }
    }
    let mut pacer = Pacer::new(Duration::ZERO, 0.001);
    assert_eq!(pacer.due(Duration::MAX), 251);
    pacer.took(u64::MAX);
    pacer.took(u64::MAX);
    assert_eq!(pacer.due(Duration::MAX), 0);
}

/// Timesteps from 1 µs to 20 s in whole nanoseconds, evenly over the decades.
fn timestep() -> impl Strategy<Value = u64> {
    (3.0..10.3f64).prop_map(|exponent| 10f64.powf(exponent).round() as u64)
}

/// Frequencies that are no whole number of nanoseconds, nor of anything binary.
#[test]
fn at_every_whole_frequency_every_whole_second_has_all_its_steps() {
    for hertz in 1..=1000 {
        for second in [1, 2, 3, 10, 3600, 864_000] {
            let mut pacer = Pacer::new(Duration::ZERO, 1.0 / hertz as f64);
            pacer.took(hertz * second - 1);
            let due = [0, 1].map(|before| pacer.due(ns(second * SECOND - before)));
            assert_eq!(due, [1, 0], "{hertz} Hz, {second} s");
        }
    }
}

proptest! {
    #[test]
    fn a_step_is_due_in_the_nanosecond_in_which_it_is_complete_and_not_before(
        step in timestep(),
        share in 0.0..1.0f64,
    ) {
        let count = 1 + ((TEN_DAYS / step) as f64 * share) as u64;
        let mut pacer = Pacer::new(Duration::ZERO, seconds(step));
        pacer.took(count - 1);
        prop_assert_eq!(pacer.due(ns(count * step - 1)), 0);
        prop_assert_eq!(pacer.due(ns(count * step)), 1);
    }

    /// The number of whole steps is checked in integers, without rounding.
    #[test]
    fn polls_less_than_a_quarter_of_a_second_apart_lose_nothing(
        step in timestep(),
        start in 0..100_000 * SECOND,
        gaps in prop::collection::vec(0..250_000_000u64, 1..300),
    ) {
        let mut pacer = Pacer::new(ns(start), seconds(step));
        let mut now = start;
        let mut total = 0;
        for gap in gaps {
            now += gap;
            let due = pacer.due(ns(now));
            pacer.took(due);
            total += due;
            prop_assert_eq!(total, (now - start) / step);
        }
    }

    #[test]
    fn no_poll_answers_more_than_the_bound_and_the_sum_never_runs_ahead_of_the_clock(
        step in timestep(),
        polls in prop::collection::vec((0..3 * SECOND, 0.0..1.0f64), 1..100),
    ) {
        let bound = CATCH_UP.as_nanos() as u64 / step + 1;
        let mut pacer = Pacer::new(Duration::ZERO, seconds(step));
        let mut now = 0;
        let mut total = 0;
        for (gap, share) in polls {
            now += gap;
            let due = pacer.due(ns(now));
            prop_assert!(due <= bound);
            // A second query at the same time has the same answer.
            prop_assert_eq!(pacer.due(ns(now)), due);
            let taken = (due as f64 * share) as u64;
            pacer.took(taken);
            total += taken;
            prop_assert!(total <= now / step);
        }
    }
}
