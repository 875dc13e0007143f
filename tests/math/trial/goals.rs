//! A goal's progress: accepted, reported on, reached, preempted or refused, and the status that shows it.

use pendularm::math::trial::{ATTEMPTS, ActionStatus, Changes, Trial, TrialCommand};

use super::{assert_cleared, in_flight, preempted, reached, send, some, status, target, unwanted};

#[test]
fn a_status_goes_by_the_name_that_messages_use() {
    for (status, name) in [
        (ActionStatus::Idle, "idle"),
        (ActionStatus::Active, "active"),
        (ActionStatus::Reached, "reached"),
        (ActionStatus::Preempted, "preempted"),
    ] {
        assert_eq!((status.name(), &*status.to_string()), (name, name));
    }
}

#[test]
fn an_accepted_goal_is_shown_as_active() {
    let mut trial = Trial::default();
    trial.start(0.0, Changes::default(), some(1)).unwrap();
    assert_eq!(
        trial.accepted(1, "g1", unwanted),
        [TrialCommand::PublishStatus]
    );
    let status = status(&trial);
    assert_eq!(status.action_status, ActionStatus::Active);
    assert_eq!(status.target, Some(target(1)));
    assert_eq!((status.error, status.desired_positions), (None, None));
}

#[test]
fn feedback_on_the_goal_in_flight_is_shown_and_other_feedback_is_not() {
    let mut trial = in_flight();
    trial.feedback("g0", 9.0, &[9.0, 9.0]);
    trial.feedback("g2", 9.0, &[9.0, 9.0]);
    let shown = status(&trial);
    assert_eq!(shown.error, Some(0.8));
    assert_eq!(shown.desired_positions, Some(vec![0.1, 0.2]));
    trial.feedback("g1", 0.4, &[0.3, 0.2]);
    let shown = status(&trial);
    assert_eq!(
        (shown.error, shown.desired_positions),
        (Some(0.4), Some(vec![0.3, 0.2]))
    );
}

#[test]
fn a_reached_target_is_counted_and_the_next_one_sent() {
    let mut trial = in_flight();
    assert_eq!(
        trial.concluded(reached("g1"), some(2)),
        [TrialCommand::PublishStatus, send(2, 2)]
    );
    let shown = status(&trial);
    assert_eq!(
        (shown.targets_reached, shown.action_status),
        (1, ActionStatus::Reached)
    );
    assert_eq!((shown.target, shown.error), (Some(target(1)), Some(0.015)));
    assert_eq!(
        trial.accepted(2, "g2", unwanted),
        [TrialCommand::PublishStatus]
    );
    let shown = status(&trial);
    assert_eq!(
        (shown.targets_reached, shown.action_status),
        (1, ActionStatus::Active)
    );
    assert_eq!((shown.target, shown.error), (Some(target(2)), None));
    for n in 2..50 {
        let goal = format!("g{n}");
        assert_eq!(trial.concluded(reached(&goal), some(n + 1)).len(), 2);
        let next = format!("g{}", n + 1);
        assert_eq!(
            trial.accepted(u64::from(n) + 1, &next, unwanted),
            [TrialCommand::PublishStatus]
        );
    }
    assert_eq!(status(&trial).targets_reached, 49);
}

#[test]
fn a_result_counts_once() {
    let mut trial = in_flight();
    assert_eq!(trial.concluded(reached("g1"), some(2)).len(), 2);
    assert_eq!(trial.concluded(reached("g1"), unwanted), []);
    assert_eq!(
        trial.accepted(2, "g2", unwanted),
        [TrialCommand::PublishStatus]
    );
    assert_eq!(trial.concluded(reached("g1"), unwanted), []);
    assert_eq!(status(&trial).targets_reached, 1);
}

#[test]
fn a_reached_target_without_a_next_one_waits_for_a_skip() {
    let mut trial = in_flight();
    assert_eq!(
        trial.concluded(reached("g1"), || None),
        [TrialCommand::PublishStatus]
    );
    assert!(trial.running());
    assert_eq!(status(&trial).targets_reached, 1);
    assert_eq!(trial.skip(some(2)), Ok(vec![send(2, 2)]));
}

#[test]
fn a_result_that_overtakes_the_acceptance_counts_all_the_same() {
    let mut trial = in_flight();
    trial.skip(some(2)).unwrap();
    // The old goal's end and the new one's, both before anybody has said what the new one is called.
    assert_eq!(trial.concluded(preempted("g1"), unwanted), []);
    assert_eq!(trial.concluded(reached("g2"), unwanted), []);
    assert_eq!(status(&trial).targets_reached, 0);
    assert_eq!(
        trial.accepted(2, "g2", some(3)),
        [
            TrialCommand::PublishStatus,
            TrialCommand::PublishStatus,
            send(3, 3)
        ]
    );
    assert_eq!(status(&trial).targets_reached, 1);
    assert_eq!(status(&trial).action_status, ActionStatus::Reached);
    // Strangers' results, in any number, stand in nobody's way.
    for n in 0..1000 {
        assert_eq!(
            trial.concluded(reached(&format!("stranger{n}")), unwanted),
            []
        );
    }
    assert_eq!(trial.concluded(preempted("g3"), unwanted), []);
    let _ = trial.accepted(3, "g3", unwanted);
    assert_eq!(status(&trial).action_status, ActionStatus::Preempted);
    assert_eq!(status(&trial).targets_reached, 1);
}

#[test]
fn a_goal_preempted_by_somebody_else_is_shown_and_not_replaced() {
    let mut trial = in_flight();
    assert_eq!(
        trial.concluded(preempted("g1"), unwanted),
        [TrialCommand::PublishStatus]
    );
    let shown = status(&trial);
    assert!(shown.running);
    assert_eq!(shown.action_status, ActionStatus::Preempted);
    assert_eq!(shown.target, Some(target(1)));
    assert_eq!((shown.error, shown.desired_positions), (None, None));
    // The end of the other's goal is not the trial's.
    trial.feedback("theirs", 0.1, &[1.0, 1.0]);
    assert_eq!(trial.concluded(reached("theirs"), unwanted), []);
    assert_eq!(trial.tick(20.0), []);
    assert_eq!(status(&trial).action_status, ActionStatus::Preempted);
    assert_eq!(status(&trial).error, None);
    assert_eq!(status(&trial).elapsed, 10.0);
}

#[test]
fn a_skip_goes_on_after_a_preemption_and_cancels_nobody_elses_goal() {
    let mut trial = in_flight();
    let _ = trial.concluded(preempted("g1"), unwanted);
    assert_eq!(trial.skip(some(2)), Ok(vec![send(2, 2)]));
    assert_eq!(
        trial.accepted(2, "g2", unwanted),
        [TrialCommand::PublishStatus]
    );
    assert_eq!(trial.concluded(reached("g2"), some(3)).len(), 2);
    assert_eq!(status(&trial).targets_reached, 1);
}

#[test]
fn after_a_preemption_stop_start_and_the_end_work_as_ever() {
    let waiting = || {
        let mut trial = in_flight();
        let _ = trial.concluded(preempted("g1"), unwanted);
        trial
    };
    let mut stopped = waiting();
    assert_eq!(stopped.stop(), Ok(vec![TrialCommand::PublishStatus]));
    assert_cleared(&status(&stopped));
    let mut restarted = waiting();
    let commands = restarted.start(20.0, Changes::default(), some(2)).unwrap();
    assert_eq!(commands, [send(2, 2)]);
    let mut over = waiting();
    assert_eq!(over.tick(70.0), [TrialCommand::PublishStatus]);
    assert_cleared(&status(&over));
}

#[test]
fn a_refused_target_is_replaced_by_another_one() {
    let mut trial = Trial::default();
    trial.start(0.0, Changes::default(), some(1)).unwrap();
    assert_eq!(trial.refused(1, some(2)), [send(2, 2)]);
    assert_cleared(&status(&trial));
    assert_eq!(
        trial.refused(1, unwanted),
        [],
        "an answer to a request that no longer matters"
    );
    assert_eq!(
        trial.accepted(2, "g1", unwanted),
        [TrialCommand::PublishStatus]
    );
    assert_eq!(trial.refused(2, unwanted), []);
    assert_eq!(status(&trial).action_status, ActionStatus::Active);
}

#[test]
fn refusals_without_end_leave_the_trial_waiting() {
    let mut trial = Trial::default();
    trial.start(0.0, Changes::default(), some(1)).unwrap();
    for attempt in 1..ATTEMPTS {
        assert_eq!(trial.refused(u64::from(attempt), some(5)).len(), 1);
    }
    assert_eq!(
        trial.refused(u64::from(ATTEMPTS), unwanted),
        [TrialCommand::PublishStatus]
    );
    assert!(trial.running());
    assert_cleared(&status(&trial));
    let ticket = u64::from(ATTEMPTS) + 1;
    assert_eq!(trial.skip(some(6)), Ok(vec![send(ticket, 6)]));
    // As does a refusal for which there is no other target.
    assert_eq!(
        trial.refused(ticket, || None),
        [TrialCommand::PublishStatus]
    );
    assert_cleared(&status(&trial));
}
