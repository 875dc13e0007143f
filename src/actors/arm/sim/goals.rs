//! The active goal as the arm sees it: judged at every physics step, in simulation time, where the steps are made.
//!
//! `ik_action` owns the goal and hears what becomes of it; the rules are `math::goal`'s. A goal is announced with
//! [`TrackGoal`], which puts an end to the one before, and judged from its [`CommandGoal`] on; a reset in between takes
//! the goal away, and the command has no effect.
//!
//! **Invariant:** without a goal the arm steps as if this file did not exist; every goal ends once, and whoever asks
//! about the latest end hears the same.

use std::ops::ControlFlow;

use actix::prelude::*;
use glam::DVec2;

use super::ArmSim;
use crate::math::goal::{Cadence, Criteria, Goal, Outcome};
use crate::math::kinematics::{forward, nearest_turn};
use crate::math::pid::Setpoint;
use crate::math::simulation::Simulation;

// ---- state ----------------------------------------------------------------------------------------------------------

/// The arm's memory of goals.
pub(super) struct Goals<const N: usize> {
    tracked: Option<Tracked<N>>,
    /// How the latest goal ended, for a question that crossed the news on its way.
    latest: Option<GoalJudged<N>>,
    /// Simulation time up to the last reset \[s\].
    before_reset: f64,
}

/// A goal that has not ended.
struct Tracked<const N: usize> {
    number: u64,
    goal: Goal,
    feedback: Cadence,
    owner: Recipient<GoalJudged<N>>,
    /// Its setpoint is held, and it is judged.
    commanded: bool,
}

impl<const N: usize> Default for Goals<N> {
    fn default() -> Self {
        Self {
            tracked: None,
            latest: None,
            before_reset: 0.0,
        }
    }
}

// ---- messages -------------------------------------------------------------------------------------------------------

/// Where the arm is now. From `ik` and `ik_trial`, at every request that depends on it.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "Pose<N>")]
pub struct ArmPose<const N: usize>;

/// The arm at one instant.
#[derive(MessageResponse, Debug, Clone, Copy, PartialEq)]
pub struct Pose<const N: usize> {
    /// Lengths of the links \[m\].
    pub lengths: [f64; N],
    /// Joint positions \[rad\].
    pub positions: [f64; N],
    /// Simulation time that has passed since the arm was started, through all resets \[s\]; never runs backwards.
    pub simulated: f64,
}

/// A goal begins, and the one before it ends, both in this instant. From `ik_action`, which then publishes the
/// trajectory and sends the [`CommandGoal`].
#[derive(Message)]
#[rtype(result = "Tracking<N>")]
pub struct TrackGoal<const N: usize> {
    /// Names the goal between `ik_action` and the arm; each is used once.
    pub number: u64,
    /// Where the end effector should be \[m\].
    pub target: DVec2,
    /// When it counts as there.
    pub criteria: Criteria,
    /// Joint positions that put the end effector there \[rad\].
    pub solution: [f64; N],
    /// Hears of progress and of the end, unless that is the answer to its own message.
    pub owner: Recipient<GoalJudged<N>>,
}

/// The goal has begun.
#[derive(MessageResponse, Debug, Clone, Copy, PartialEq)]
pub struct Tracking<const N: usize> {
    /// The solution, shifted by whole turns to within π of the present positions \[rad\]: the setpoint to be sent.
    pub positions: [f64; N],
    /// How the goal before it ended, now or earlier, if there was one.
    pub before: Option<GoalJudged<N>>,
}

/// The goal's setpoint is held from the next step on, and the goal judged, unless it has ended. From `ik_action`.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "()")]
pub struct CommandGoal<const N: usize> {
    /// The goal.
    pub number: u64,
    /// The setpoint \[rad\], at rest.
    pub positions: [f64; N],
}

/// The goal is preempted, unless it has ended already. From `ik_action`. The answer is how the latest goal ended.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "Option<GoalJudged<N>>")]
pub struct EndGoal<const N: usize> {
    /// The goal.
    pub number: u64,
}

/// How a goal stands after a step, or how it ended. To its owner.
#[derive(Message, Debug, Clone, Copy, PartialEq)]
#[rtype(result = "()")]
pub struct GoalJudged<const N: usize> {
    /// The goal.
    pub number: u64,
    /// Distance between end effector and target \[m\].
    pub distance: f64,
    /// Simulation time since the goal's start \[s\].
    pub elapsed: f64,
    /// The arm at that instant.
    pub pose: Pose<N>,
    /// How it ended; none while it is active.
    pub outcome: Option<Outcome>,
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<ArmPose<N>> for ArmSim<N> {
    type Result = Pose<N>;

    fn handle(&mut self, _: ArmPose<N>, ctx: &mut Context<Self>) -> Pose<N> {
        self.attend(ctx);
        pose(&self.simulation, self.goals.before_reset)
    }
}

impl<const N: usize> Handler<TrackGoal<N>> for ArmSim<N> {
    type Result = Tracking<N>;

    fn handle(&mut self, message: TrackGoal<N>, ctx: &mut Context<Self>) -> Tracking<N> {
        self.attend(ctx);
        self.goals.preempt(&self.simulation);
        let before = self.goals.latest;
        self.goals.tracked = Some(Tracked {
            number: message.number,
            goal: Goal::new(message.target, message.criteria, self.simulation.time()),
            feedback: Cadence::default(),
            owner: message.owner,
            commanded: false,
        });
        Tracking {
            positions: nearest_turn(&message.solution, &self.simulation.state().position),
            before,
        }
    }
}

impl<const N: usize> Handler<CommandGoal<N>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, command: CommandGoal<N>, ctx: &mut Context<Self>) {
        self.attend(ctx);
        let time = self.simulation.time();
        let tracked = self.goals.tracked.as_mut();
        if let Some(tracked) = tracked.filter(|goal| goal.number == command.number) {
            let (target, criteria) = (tracked.goal.target(), tracked.goal.criteria());
            tracked.goal = Goal::new(target, criteria, time);
            tracked.commanded = true;
            self.simulation.set_setpoint(Setpoint {
                position: command.positions,
                velocity: [0.0; N],
            });
        }
    }
}

impl<const N: usize> Handler<EndGoal<N>> for ArmSim<N> {
    type Result = Option<GoalJudged<N>>;

    fn handle(&mut self, EndGoal { number }: EndGoal<N>, ctx: &mut Context<Self>) -> Self::Result {
        self.attend(ctx);
        if self.goals.is_tracked(number) {
            self.goals.preempt(&self.simulation);
        }
        self.goals.latest
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl<const N: usize> ArmSim<N> {
    /// Takes up to `steps` steps; fewer where a goal is reached on the way, or the simulation diverges.
    pub(super) fn advance(&mut self, steps: u64) -> u64 {
        let before_reset = self.goals.before_reset;
        let tracked = self.goals.tracked.as_mut();
        let Some(tracked) = tracked.filter(|goal| goal.commanded) else {
            return self.simulation.advance(steps);
        };
        let mut reached = None;
        let taken = self.simulation.advance_with(steps, |simulation| {
            reached = tracked.judge(simulation, before_reset);
            match reached {
                Some(_) => ControlFlow::Break(()),
                None => ControlFlow::Continue(()),
            }
        });
        if let Some(reached) = reached {
            tracked.owner.do_send(reached);
            self.goals.tracked = None;
            self.goals.latest = Some(reached);
        }
        taken
    }

    /// To be called before the simulation is reset: the goal is preempted. Gives the news and who is to hear it.
    pub(super) fn end_goal_for_reset(
        &mut self,
    ) -> Option<(Recipient<GoalJudged<N>>, GoalJudged<N>)> {
        let ended = self.goals.preempt(&self.simulation);
        self.goals.before_reset += self.simulation.time();
        let (tracked, judged) = ended?;
        Some((tracked.owner, judged))
    }
}

impl<const N: usize> Goals<N> {
    /// Simulation time up to the last reset \[s\].
    pub(super) const fn before_reset(&self) -> f64 {
        self.before_reset
    }

    fn is_tracked(&self, number: u64) -> bool {
        self.tracked
            .as_ref()
            .is_some_and(|goal| goal.number == number)
    }

    /// Ends the goal, if there is one, where the arm is now.
    fn preempt(&mut self, simulation: &Simulation<N>) -> Option<(Tracked<N>, GoalJudged<N>)> {
        let tracked = self.tracked.take()?;
        let mut judged = tracked.stands(simulation, self.before_reset);
        judged.outcome = Some(Outcome::Preempted);
        self.latest = Some(judged);
        Some((tracked, judged))
    }
}

impl<const N: usize> Tracked<N> {
    /// Judges the step that was just made; tells the owner of progress when that is due. The news, once reached.
    fn judge(&mut self, simulation: &Simulation<N>, before_reset: f64) -> Option<GoalJudged<N>> {
        let time = simulation.time();
        let reached = self.goal.judge(time, end_effector(simulation));
        let due = self.feedback.due(time);
        if !reached && !due {
            return None;
        }
        let judged = self.stands(simulation, before_reset);
        if due {
            self.owner.do_send(judged);
        }
        reached.then_some(GoalJudged {
            outcome: Some(Outcome::Reached),
            ..judged
        })
    }

    fn stands(&self, simulation: &Simulation<N>, before_reset: f64) -> GoalJudged<N> {
        GoalJudged {
            number: self.number,
            distance: self.goal.distance(end_effector(simulation)),
            elapsed: self.goal.elapsed(simulation.time()),
            pose: pose(simulation, before_reset),
            outcome: None,
        }
    }
}

/// Where the end effector is \[m\], with the lengths as they are now.
fn end_effector<const N: usize>(simulation: &Simulation<N>) -> DVec2 {
    forward(simulation.arm().lengths(), &simulation.state().position).position
}

fn pose<const N: usize>(simulation: &Simulation<N>, before_reset: f64) -> Pose<N> {
    Pose {
        lengths: *simulation.arm().lengths(),
        positions: simulation.state().position,
        simulated: before_reset + simulation.time(),
    }
}
