//! Timed trials, as in the node `ik_trial`. The rules are in `math::trial`.
//!
//! **Invariant:** each command of the trial is completed before the next, and news of its goals are handled after the
//! commands.

use std::time::Duration;

use pendularm::live::World as _;
use pendularm::math::trial::{Conclusion, Rejection, TrialCommand, sample};
use pendularm::protocol::catalog::Topic;
use pendularm::services::Address;
use pendularm::services::goals::GoalRequest;
use pendularm::services::trial::{
    STATUS_PERIOD, Terms, TrialRefused, TrialRequest, status_message,
};

use super::Kernel;

impl<const N: usize> Kernel<N> {
    /// Advances the trial to the present time, executes its commands, and passes it the news of its goals.
    pub(super) fn advance_trial(&mut self) {
        loop {
            let commands = self.trial.tick(self.arm.pose().simulated);
            self.carry_out(commands);
            let Some((active, progress)) = self.news.pop_front() else {
                return;
            };
            let goal_id = active.goal.id;
            match progress.outcome {
                None => {
                    self.trial
                        .feedback(&goal_id, progress.distance, &active.goal.positions);
                }
                Some(outcome) => {
                    let conclusion = Conclusion {
                        goal_id,
                        outcome,
                        final_distance: progress.distance,
                    };
                    let lengths = self.arm.pose().lengths;
                    let target = || sample(&lengths, || self.rng.f64());
                    let commands = self.trial.concluded(conclusion, target);
                    self.carry_out(commands);
                }
            }
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
                    let begun = self.begin_goal(GoalRequest { target, criteria }, true);
                    let lengths = self.arm.pose().lengths;
                    let sampled = || sample(&lengths, || self.rng.f64());
                    let more = match (begun, &self.goal) {
                        (Ok(_), Some(active)) => {
                            self.trial.accepted(ticket, &active.goal.id, sampled)
                        }
                        _ => self.trial.refused(ticket, sampled),
                    };
                    if begun.is_ok() {
                        self.set_in_motion();
                    }
                    waiting.extend(more);
                }
            }
        }
    }

    /// Performs a request about the trial.
    pub(super) fn change_trial(&mut self, ask: TrialRequest, to: &Address) -> Terms {
        let pose = self.arm.pose();
        let target = || sample(&pose.lengths, || self.rng.f64());
        let outcome = match ask {
            TrialRequest::Start { rejected, .. } if !rejected.is_empty() => {
                Err(TrialRefused::Rejected(rejected))
            }
            TrialRequest::Start { changes, .. } => {
                let decided = self.trial.start(pose.simulated, changes, target);
                self.decide(decided, Some(to))
            }
            TrialRequest::Skip => {
                let decided = self.trial.skip(target);
                self.decide(decided, Some(to))
            }
            TrialRequest::Stop => {
                let decided = self.trial.stop();
                self.decide(decided, None)
            }
        };
        let settings = self.trial.settings();
        Terms { settings, outcome }
    }

    /// Executes the commands. The caller gets a warning if the arm cannot move.
    fn decide(
        &mut self,
        decided: Result<Vec<TrialCommand>, Rejection>,
        warned: Option<&Address>,
    ) -> Result<(), TrialRefused> {
        let commands = decided?;
        if let (Some(to), Some(obstacle)) = (warned, self.arm.pose().obstacle) {
            self.warn(to, obstacle);
        }
        self.carry_out(commands);
        Ok(())
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
        let topic = Topic::TrialStatus;
        let status = self.trial.status();
        if let Some(status) = status.filter(|_| self.arm.world().wants(topic)) {
            let message = status_message(&status);
            self.arm.publish(topic, move || message);
        }
    }
}
