//! Skips and stops.

use pendularm::math::trial::{ActionStatus, Changes, Rejection, Trial, TrialCommand};

use super::{
    assert_cleared, cancel, in_flight, preempted, reached, send, some, status, target, unwanted,
};

#[test]
fn skip_and_stop_are_for_running_trials() {
    let mut trial = Trial::default();
    for _ in 0..2 {
        assert_eq!(trial.skip(unwanted), Err(Rejection::NotRunning));
        assert_eq!(trial.stop(), Err(Rejection::NotRunning));
        trial.start(0.0, Changes::default(), some(1)).unwrap();
        trial.stop().unwrap();
    }
    assert_eq!(trial.tick(1e9), []);
    assert_eq!(Rejection::NotRunning.to_string(), "no trial is running");
}

#[test]
fn a_skip_abandons_the_target_uncounted_and_sends_another_one() {
    let mut trial = in_flight();
    let commands = trial.skip(some(2)).unwrap();
    assert_eq!(commands, [cancel("g1"), send(2, 2)]);
    let shown = status(&trial);
    assert_eq!((shown.running, shown.targets_reached), (true, 0));
    assert_cleared(&shown);
    // A success that was on its way when the target was abandoned does not count, before or after the next acceptance.
    assert_eq!(trial.concluded(reached("g1"), unwanted), []);
    assert_eq!(
        trial.accepted(2, "g2", unwanted),
        [TrialCommand::PublishStatus]
    );
    assert_eq!(trial.concluded(reached("g1"), unwanted), []);
    assert_eq!(status(&trial).targets_reached, 0);
    assert_eq!(status(&trial).action_status, ActionStatus::Active);
}

#[test]
fn a_skip_without_a_reachable_target_changes_nothing() {
    let mut trial = in_flight();
    let before = status(&trial);
    assert_eq!(trial.skip(|| None), Err(Rejection::NoTarget));
    assert_eq!(status(&trial), before);
    assert_eq!(trial.concluded(reached("g1"), some(2)).len(), 2);
}

#[test]
fn a_skip_while_a_goal_is_being_asked_for_cancels_it_once_it_has_a_name() {
    let mut trial = Trial::default();
    trial.start(0.0, Changes::default(), some(1)).unwrap();
    assert_eq!(trial.skip(some(2)), Ok(vec![send(2, 2)]));
    assert_eq!(trial.accepted(1, "g1", unwanted), [cancel("g1")]);
    assert_eq!(
        trial.accepted(2, "g2", unwanted),
        [TrialCommand::PublishStatus]
    );
    assert_eq!(trial.concluded(preempted("g1"), unwanted), []);
    assert_eq!(status(&trial).action_status, ActionStatus::Active);
    assert_eq!(status(&trial).target, Some(target(2)));
}

#[test]
fn a_stop_abandons_the_target_and_keeps_the_count() {
    let mut trial = in_flight();
    let _ = trial.concluded(reached("g1"), some(2));
    let _ = trial.accepted(2, "g2", unwanted);
    trial.feedback("g2", 0.2, &[0.0, 1.0]);
    assert_eq!(trial.tick(15.0), []);
    assert_eq!(
        trial.stop(),
        Ok(vec![cancel("g2"), TrialCommand::PublishStatus])
    );
    let shown = status(&trial);
    assert!(!shown.running);
    assert_cleared(&shown);
    assert_eq!((shown.targets_reached, shown.elapsed), (1, 5.0));
    assert_eq!(trial.concluded(reached("g2"), unwanted), []);
    trial.feedback("g2", 0.1, &[0.0, 1.0]);
    assert_eq!(trial.tick(500.0), []);
    assert_eq!(status(&trial), shown, "nothing changes any more");
    assert_eq!(trial.remaining(), None);
}

#[test]
fn a_goal_accepted_after_the_stop_is_cancelled() {
    let mut trial = Trial::default();
    trial.start(0.0, Changes::default(), some(1)).unwrap();
    assert_eq!(trial.stop(), Ok(vec![TrialCommand::PublishStatus]));
    assert_eq!(trial.accepted(1, "g1", unwanted), [cancel("g1")]);
    assert_eq!(trial.refused(1, unwanted), []);
    assert_cleared(&status(&trial));
    // Nor does the next trial take it for its own.
    trial.start(1.0, Changes::default(), some(2)).unwrap();
    assert_eq!(trial.accepted(1, "g1", unwanted), [cancel("g1")]);
    assert_eq!(
        trial.accepted(2, "g2", unwanted),
        [TrialCommand::PublishStatus]
    );
}
