//! Every transition of a trial: its inputs, its requests, and its status; and the sampling of targets.

mod properties;
mod sampling;

use glam::dvec2;
use pendularm::math::goal::{Criteria, Outcome};
use pendularm::math::kinematics::Target;
use pendularm::math::trial::{
    ATTEMPTS, ActionStatus, Changes, Conclusion, Rejection, Settings, Status, Trial, TrialCommand,
};

/// The `n`th target of a test: each a different one.
fn target(n: u32) -> Target {
    Target {
        position: dvec2(f64::from(n), 0.5),
        orientation: None,
    }
}

fn some(n: u32) -> impl FnOnce() -> Option<Target> {
    move || Some(target(n))
}

fn unwanted() -> Option<Target> {
    panic!("no target is wanted here")
}

fn send(ticket: u64, n: u32) -> TrialCommand {
    TrialCommand::SendGoal {
        ticket,
        target: target(n),
        criteria: Criteria::default(),
    }
}

fn cancel(goal_id: &str) -> TrialCommand {
    TrialCommand::CancelGoal {
        goal_id: goal_id.to_owned(),
    }
}

fn ended(goal_id: &str, outcome: Outcome) -> Conclusion {
    Conclusion {
        goal_id: goal_id.to_owned(),
        outcome,
        final_distance: 0.015,
    }
}

fn reached(goal_id: &str) -> Conclusion {
    ended(goal_id, Outcome::Reached)
}

fn preempted(goal_id: &str) -> Conclusion {
    ended(goal_id, Outcome::Preempted)
}

fn status(trial: &Trial) -> Status {
    trial.status().unwrap()
}

/// A trial started at 10 s, whose first goal is in flight as `g1` and has reported once.
fn in_flight() -> Trial {
    let mut trial = Trial::default();
    let commands = trial.start(10.0, Changes::default(), some(1)).unwrap();
    assert_eq!(commands, [send(1, 1)]);
    assert_eq!(
        trial.accepted(1, "g1", unwanted),
        [TrialCommand::PublishStatus]
    );
    trial.feedback("g1", 0.8, &[0.1, 0.2]);
    trial
}

/// Nothing in flight, nothing shown of a goal.
fn assert_cleared(status: &Status) {
    assert_eq!(status.target, None);
    assert_eq!(status.error, None);
    assert_eq!(status.desired_positions, None);
    assert_eq!(status.action_status, ActionStatus::Idle);
}

// The progress of a goal

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

// Skips and stops

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

// Starts

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

// The trial's clock

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
