//! A trial's clock: the end of the duration, rounding, resets and pauses.

use pendularm::math::trial::{Changes, Rejection, Trial, TrialCommand};

use super::{assert_cleared, cancel, in_flight, reached, some, status, unwanted};

#[test]
fn the_end_of_the_duration_cancels_the_target_in_flight_uncounted() {
    let mut trial = in_flight();
    assert_eq!(trial.tick(69.9), []);
    assert!((trial.remaining().unwrap() - 0.1).abs() < 1e-12);
    assert_eq!(
        trial.tick(70.0),
        [cancel("g1"), TrialCommand::PublishStatus]
    );
    let shown = status(&trial);
    assert!(!shown.running);
    assert_cleared(&shown);
    assert_eq!(
        (shown.elapsed, shown.duration, shown.targets_reached),
        (60.0, 60.0, 0)
    );
    assert_eq!(trial.concluded(reached("g1"), unwanted), []);
    assert_eq!(trial.tick(71.0), []);
    assert_eq!(trial.skip(unwanted), Err(Rejection::NotRunning));
    assert_eq!(status(&trial), shown);
}

#[test]
fn the_end_of_the_duration_drops_a_target_that_is_being_asked_for() {
    let mut trial = Trial::default();
    trial.start(0.0, Changes::default(), some(1)).unwrap();
    assert_eq!(trial.tick(60.0), [TrialCommand::PublishStatus]);
    assert_eq!(trial.accepted(1, "g1", unwanted), [cancel("g1")]);
    assert_cleared(&status(&trial));
}

#[test]
fn a_time_told_late_does_not_show_more_than_the_duration() {
    let mut trial = in_flight();
    assert_eq!(trial.tick(1e6).len(), 2);
    assert_eq!(status(&trial).elapsed, 60.0);
}

#[test]
fn the_end_is_not_missed_by_rounding() {
    // A clock of 1 ms steps that has run for a day shows 60.1 s as that, or as 1e-11 s less.
    let changes = Changes {
        duration: Some(60.1),
        ..Changes::default()
    };
    let mut trial = Trial::default();
    for start in 0..1000u32 {
        let steps = 86_400_000 + 7919 * start;
        let at = |k: u32| f64::from(steps + k) * 0.001;
        trial.start(at(0), changes, some(1)).unwrap();
        assert_eq!(trial.tick(at(60_099)), []);
        assert_eq!(trial.tick(at(60_100)), [TrialCommand::PublishStatus]);
    }
}

/// A difference rounds once; a sum of differences would round at every one of them.
#[test]
fn what_has_elapsed_is_one_difference_however_often_the_same_time_is_told() {
    let mut trial = Trial::default();
    let start = 0.1;
    trial.start(start, Changes::default(), some(1)).unwrap();
    for tenth in 2..=500 {
        let now = f64::from(tenth) / 10.0;
        assert_eq!(trial.tick(now), []);
        assert_eq!(trial.tick(now), []);
        assert_eq!(status(&trial).elapsed, now - start);
    }
}

#[test]
fn a_reset_of_the_simulation_clock_adds_nothing_and_takes_nothing_away() {
    let mut trial = in_flight();
    assert_eq!(trial.tick(25.0), []);
    assert_eq!(trial.tick(0.0), [], "the reset");
    assert_eq!(status(&trial).elapsed, 15.0);
    assert_eq!(trial.tick(5.0), []);
    assert_eq!(status(&trial).elapsed, 20.0);
    assert_eq!(trial.tick(2.0), [], "another one");
    assert_eq!(trial.tick(41.0), []);
    assert_eq!(status(&trial).elapsed, 59.0);
    assert_eq!(
        trial.tick(42.0),
        [cancel("g1"), TrialCommand::PublishStatus]
    );
}

#[test]
fn a_paused_clock_pauses_the_trial() {
    let mut trial = in_flight();
    for _ in 0..1000 {
        assert_eq!(trial.tick(11.0), []);
    }
    assert_eq!(status(&trial).elapsed, 1.0);
}
