//! Goals. The rules are in `live::ik_action`, as for the node `ik_action`.
//!
//! **Invariant:** each goal is in motion before the next frame is taken.

use pendularm::live::{GoalProgress, GoalReport, Obstacle, World as _, cancelled};
use pendularm::math::kinematics::Unreachable;
use pendularm::protocol::catalog::Topic;
use pendularm::protocol::messages::Level;
use pendularm::services::goals::{AcceptedGoal, CancelRejected, GoalRequest};
use pendularm::services::{Address, Ask as _};

use super::{GoalOwner, Kernel};

impl<const N: usize> Kernel<N> {
    /// Takes a goal of the client.
    pub(super) fn take_goal(&mut self, goal: GoalRequest<N>, to: &Address) {
        match self.begin_goal(goal, GoalOwner::Client) {
            Err(why) => self.send(GoalRequest::<N>::write(Err(why), to)),
            Ok((goal, obstacle)) => {
                if let Some(obstacle) = obstacle {
                    self.warn(to, obstacle);
                }
                self.send(GoalRequest::<N>::write(Ok(goal.id.clone()), to));
                self.set_in_motion(goal);
            }
        }
    }

    /// Sends a status, before the answer, with the reason why the arm does not move.
    pub(super) fn warn(&self, to: &Address, obstacle: Obstacle) {
        self.tell(Level::Warning, &obstacle.to_string(), to.id());
    }

    /// Solves a goal and replaces the previous one. Call [`Kernel::set_in_motion`] next.
    pub(super) fn begin_goal(
        &mut self,
        goal: GoalRequest<N>,
        owner: GoalOwner,
    ) -> Result<(AcceptedGoal<N>, Option<Obstacle>), Unreachable> {
        let order = self.goals.order(goal);
        let tracking = self.arm.track_goal(&order)?;
        let (before, goal) = self.goals.accept(&order, owner, &tracking);
        self.pass_on(before);
        Ok((goal, tracking.obstacle))
    }

    /// Sends the goal's setpoint to the subscribers, and then to the arm.
    pub(super) fn set_in_motion(&mut self, goal: AcceptedGoal<N>) {
        let (number, positions) = (goal.number, goal.positions);
        self.arm
            .publish(Topic::JointTrajectory, move || goal.trajectory());
        self.arm.command_goal(number, positions);
    }

    /// Ends the active goal, if it has the given id.
    pub(super) fn cancel(&mut self, goal_id: Option<&str>) -> Result<(), CancelRejected> {
        let number = self.goals.to_cancel(goal_id)?;
        let latest = self.arm.end_goal(number);
        if let Some(latest) = latest {
            self.judge(latest);
        }
        cancelled(latest)
    }

    /// Sends feedback or the end of the active goal.
    pub(super) fn judge(&mut self, progress: GoalProgress<N>) {
        let report = self.goals.report(progress);
        self.pass_on(report);
    }

    fn pass_on(&mut self, report: Option<(GoalReport<N>, GoalOwner)>) {
        if let Some((report, owner)) = report {
            let (topic, frame) = report.message();
            self.arm.world().publish(topic, frame);
            if owner == GoalOwner::Trial {
                self.news.push_back(report);
            }
        }
    }
}
