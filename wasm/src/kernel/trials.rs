//! Timed trials. The rules are in `live::ik_trial`, as for the node `ik_trial`.
//!
//! **Invariant:** each command of the trial is completed before the next, and news of its goals are handled after the
//! commands.

use std::time::Duration;

use pendularm::live::{GoalAnswer, World as _};
use pendularm::math::trial::TrialCommand;
use pendularm::protocol::catalog::Topic;
use pendularm::services::Address;
use pendularm::services::goals::GoalRequest;
use pendularm::services::trial::{STATUS_PERIOD, Terms, TrialRequest};

use super::{GoalOwner, Kernel};

impl<const N: usize> Kernel<N> {
    /// Advances the trial to the present time, executes its commands, and passes it the news of its goals.
    pub(super) fn advance_trial(&mut self) {
        loop {
            let commands = self.trial.tick(&self.arm.pose());
            self.carry_out(commands);
            let Some(report) = self.news.pop_front() else {
                return;
            };
            let commands = self.trial.report(report);
            self.carry_out(commands);
        }
    }

    /// Executes the trial's commands.
    fn carry_out(&mut self, commands: Vec<TrialCommand>) {
        let mut waiting = std::collections::VecDeque::from(commands);
        while let Some(command) = waiting.pop_front() {
            match command {
                TrialCommand::PublishStatus => self.publish_status(),
                TrialCommand::CancelGoal { goal_id } => {
                    // A refusal means that the goal has already ended, as wanted.
                    let _ = self.cancel(Some(&goal_id));
                }
                TrialCommand::SendGoal {
                    ticket,
                    target,
                    criteria,
                } => {
                    let goal = GoalRequest { target, criteria };
                    let begun = self.begin_goal(goal, GoalOwner::Trial).ok();
                    let goal = begun.map(|(goal, _)| goal);
                    waiting.extend(self.trial.answered(GoalAnswer {
                        ticket,
                        goal_id: goal.as_ref().map(|goal| goal.id.clone()),
                        lengths: Some(self.arm.pose().lengths),
                    }));
                    if let Some(goal) = goal {
                        self.set_in_motion(goal);
                    }
                }
            }
        }
    }

    /// Performs a request about the trial. The caller gets a warning if the arm cannot move.
    pub(super) fn change_trial(&mut self, ask: TrialRequest, to: &Address) -> Terms {
        let outcome = self.trial.decide(ask, &self.arm.pose());
        let outcome = outcome.map(|(commands, obstacle)| {
            if let Some(obstacle) = obstacle {
                self.warn(to, obstacle);
            }
            self.carry_out(commands);
        });
        self.trial.terms(outcome)
    }

    /// At a tick: publishes the trial's status if it is due.
    pub(super) fn show_trial(&mut self) {
        let now: Duration = self.arm.world().now();
        if now.saturating_sub(self.trial_shown) >= STATUS_PERIOD {
            self.publish_status();
        }
    }

    fn publish_status(&mut self) {
        self.trial_shown = self.arm.world().now();
        if let Some(status) = self.trial.status() {
            self.arm.publish(Topic::TrialStatus, move || status);
        }
    }
}
