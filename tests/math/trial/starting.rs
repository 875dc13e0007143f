//! Starts of a trial: settings, the first goal, a start while another trial is running.

use pendularm::math::goal::Criteria;
use pendularm::math::trial::{Changes, Rejection, Settings, Trial, TrialCommand};

use super::{
    assert_cleared, cancel, in_flight, preempted, reached, send, some, status, target, unwanted,
};

#[test]
fn there_is_no_status_and_no_clock_before_the_first_start() {
    let mut trial = Trial::default();
    assert_eq!(trial.status(), None);
    assert!(!trial.running());
    assert_eq!(trial.remaining(), None);
    assert_eq!(trial.tick(5.0), []);
    assert_eq!(trial.status(), None);
}

#[test]
fn a_start_sends_a_first_goal_with_the_settings_in_force() {
    let mut trial = Trial::default();
    let changes = Changes {
        duration: Some(5.0),
        epsilon: Some(0.1),
        success_hold: Some(0.0),
    };
    let commands = trial.start(10.0, changes, some(1)).unwrap();
    let criteria = Criteria {
        epsilon: 0.1,
        success_hold: 0.0,
    };
    assert_eq!(
        commands,
        [TrialCommand::SendGoal {
            ticket: 1,
            target: target(1),
            criteria
        }]
    );
    let status = status(&trial);
    assert!(status.running);
    assert_eq!(
        (status.elapsed, status.duration, status.targets_reached),
        (0.0, 5.0, 0)
    );
    // Nothing is in flight until somebody has said so.
    assert_cleared(&status);
}

#[test]
fn settings_default_to_the_documented_ones_and_are_kept_for_later_starts() {
    let mut trial = Trial::default();
    let first = Settings {
        duration: 60.0,
        criteria: Criteria {
            epsilon: 0.02,
            success_hold: 0.5,
        },
    };
    assert_eq!(trial.settings(), first);
    let changes = Changes {
        epsilon: Some(0.2),
        ..Changes::default()
    };
    trial.start(0.0, changes, some(1)).unwrap();
    let changes = Changes {
        duration: Some(7.0),
        ..Changes::default()
    };
    trial.start(0.0, changes, some(2)).unwrap();
    trial.stop().unwrap();
    trial.start(0.0, Changes::default(), some(3)).unwrap();
    let kept = Settings {
        duration: 7.0,
        criteria: Criteria {
            epsilon: 0.2,
            success_hold: 0.5,
        },
    };
    assert_eq!(trial.settings(), kept);
}

#[test]
fn a_start_without_a_reachable_target_changes_nothing() {
    let mut trial = in_flight();
    let _ = trial.tick(12.0);
    let before = status(&trial);
    let changes = Changes {
        duration: Some(1.0),
        ..Changes::default()
    };
    assert_eq!(
        trial.start(12.0, changes, || None),
        Err(Rejection::NoTarget)
    );
    assert_eq!(status(&trial), before);
    assert_eq!(trial.settings(), Settings::default());
    // The goal in flight still counts.
    assert_eq!(trial.concluded(reached("g1"), some(2)).len(), 2);
    // Nor does a trial come into being.
    let mut none = Trial::default();
    assert_eq!(none.start(0.0, changes, || None), Err(Rejection::NoTarget));
    assert_eq!(none.status(), None);
    assert_eq!(
        Rejection::NoTarget.to_string(),
        "no reachable target could be sampled for the arm's present lengths"
    );
}

#[test]
fn a_start_while_running_cancels_the_goal_and_counts_and_times_afresh() {
    let mut trial = in_flight();
    assert_eq!(trial.concluded(reached("g1"), some(2)).len(), 2);
    assert_eq!(
        trial.accepted(2, "g2", unwanted),
        [TrialCommand::PublishStatus]
    );
    trial.feedback("g2", 0.3, &[0.0, 0.0]);
    assert_eq!(trial.tick(30.0), []);
    let commands = trial.start(30.0, Changes::default(), some(3)).unwrap();
    assert_eq!(commands, [cancel("g2"), send(3, 3)]);
    let status = status(&trial);
    assert!(status.running);
    assert_eq!((status.elapsed, status.targets_reached), (0.0, 0));
    assert_cleared(&status);
    // The end of the goal of the trial before is nobody's success.
    assert_eq!(trial.concluded(preempted("g2"), unwanted), []);
    assert_eq!(
        trial.accepted(3, "g3", unwanted),
        [TrialCommand::PublishStatus]
    );
    assert_eq!(trial.concluded(reached("g2"), unwanted), []);
    assert_eq!(self::status(&trial).targets_reached, 0);
}
