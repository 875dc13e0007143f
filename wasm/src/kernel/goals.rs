//! Goals: at most one is active, as in the node `ik_action`.
//!
//! **Invariant:** each goal has exactly one result. A preempting goal comes in this order: the old goal's result, the
//! response, the trajectory, feedback, result.

use pendularm::live::{GoalOrder, GoalProgress, Obstacle};
use pendularm::math::goal::Outcome;
use pendularm::math::kinematics::Unreachable;
use pendularm::protocol::catalog::Topic;
use pendularm::protocol::messages::Level;
use pendularm::services::goals::{AcceptedGoal, CancelRejected, GoalRequest};
use pendularm::services::{Address, Answered as _};

use super::Kernel;

/// The active goal.
#[derive(Clone)]
pub(super) struct ActiveGoal<const N: usize> {
    pub(super) goal: AcceptedGoal<N>,
    /// Whether it is a goal of the trial.
    pub(super) of_trial: bool,
}

impl<const N: usize> Kernel<N> {
    /// Takes a goal of the client.
    pub(super) fn take_goal(&mut self, goal: GoalRequest<N>, to: &Address) {
        let begun = self.begin_goal(goal, false);
        if let Ok(Some(obstacle)) = begun {
            self.warn(to, obstacle);
        }
        let answer = begun.map(|_| self.goal_id());
        self.send(GoalRequest::<N>::write(answer, to));
        if begun.is_ok() {
            self.set_in_motion();
        }
    }

    /// Sends a status, before the answer, with the reason why the arm does not move.
    pub(super) fn warn(&self, to: &Address, obstacle: Obstacle) {
        self.tell(Level::Warning, &obstacle.to_string(), to.id());
    }

    fn goal_id(&self) -> String {
        let active = self.goal.as_ref();
        active.map_or_else(String::new, |active| active.goal.id.clone())
    }

    /// Solves a goal and replaces the previous one. Call [`Kernel::set_in_motion`] next.
    pub(super) fn begin_goal(
        &mut self,
        goal: GoalRequest<N>,
        of_trial: bool,
    ) -> Result<Option<Obstacle>, Unreachable> {
        let GoalRequest { target, criteria } = goal;
        let number = self.accepted + 1;
        let tracking = self.arm.track_goal(&GoalOrder {
            number,
            target,
            criteria,
        })?;
        if let Some(before) = tracking.before {
            self.judge(before);
        }
        self.accepted = number;
        self.goal = Some(ActiveGoal {
            goal: AcceptedGoal::new(number, target, tracking.positions),
            of_trial,
        });
        Ok(tracking.obstacle)
    }

    /// Sends the active goal's setpoint to the subscribers, and then to the arm.
    pub(super) fn set_in_motion(&mut self) {
        if let Some(ActiveGoal { goal, .. }) = &self.goal {
            let (number, positions, goal) = (goal.number, goal.positions, goal.clone());
            self.arm
                .publish(Topic::JointTrajectory, move || goal.trajectory());
            self.arm.command_goal(number, positions);
        }
    }

    /// Ends the active goal, if it has the given id.
    pub(super) fn cancel(&mut self, meant: Option<&str>) -> Result<(), CancelRejected> {
        let goal = &self.goal.as_ref().ok_or(CancelRejected::NotActive)?.goal;
        if meant.is_some_and(|id| id != goal.id) {
            let active = goal.id.clone();
            return Err(CancelRejected::OtherGoal { active });
        }
        let ended = self.arm.end_goal(goal.number);
        let ended = ended.ok_or(CancelRejected::NotActive)?;
        self.judge(ended);
        match ended.outcome {
            Some(Outcome::Preempted) => Ok(()),
            _ => Err(CancelRejected::NotActive),
        }
    }

    /// Sends feedback or the end of the active goal.
    pub(super) fn judge(&mut self, progress: GoalProgress<N>) {
        let is_active = |active: &ActiveGoal<N>| active.goal.number == progress.number;
        match progress.outcome {
            None => {
                if let Some(active) = self.goal.as_ref().filter(|goal| is_active(goal)) {
                    let feedback = active.goal.feedback(progress.distance, progress.elapsed);
                    self.arm.publish(Topic::IkFeedback, move || feedback);
                    if active.of_trial {
                        self.news.push_back((active.clone(), progress));
                    }
                }
            }
            Some(_) => {
                if let Some(ended) = self.goal.take_if(|goal| is_active(goal)) {
                    let result = ended.goal.result(progress.distance, progress.outcome);
                    self.arm.publish(Topic::IkResult, move || result);
                    if ended.of_trial {
                        self.news.push_back((ended, progress));
                    }
                }
            }
        }
    }
}
