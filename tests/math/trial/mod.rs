//! Every transition of a trial: its inputs, its requests, and its status; and the sampling of targets.

mod goals;
mod properties;
mod sampling;
mod skip_stop;
mod starting;
mod time;

use glam::dvec2;
use pendularm::math::goal::{Criteria, Outcome};
use pendularm::math::kinematics::Target;
use pendularm::math::trial::{ActionStatus, Changes, Conclusion, Status, Trial, TrialCommand};

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
