//! The arm's motion for the node that moves it along a path, and the setpoint of that node.
//!
//! **Invariant:** a setpoint is moved only if it is still the mover's last one. Otherwise another writer has
//! replaced it.

use actix::prelude::*;

use super::node::ArmSim;
use crate::live::Obstacle;
use crate::math::arm::State;
use crate::math::pid::Setpoint;
use crate::math::simulation::ArmInput;

/// Requests the arm's present motion. From `joint_trajectory_controller`, while a goal is active.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "JointMotion<N>")]
pub struct ArmMotion<const N: usize>;

/// The motion of the arm at one time.
#[derive(MessageResponse, Debug, Clone, Copy, PartialEq)]
pub struct JointMotion<const N: usize> {
    /// Positions and velocities.
    pub state: State<N>,
    /// The held joint state.
    pub setpoint: Setpoint<N>,
    /// Simulation time since the last reset \[s\].
    pub time: f64,
    /// The number of resets.
    pub resets: u64,
    /// Whether it is paused and no step has been taken since.
    pub stands_still: bool,
    /// Why it does not follow its setpoint; `None` if it does.
    pub obstacle: Option<Obstacle>,
}

/// Moves the setpoint, if it is still the sender's last one. The answer is whether it was. From
/// `joint_trajectory_controller`.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "bool")]
pub struct MoveSetpoint<const N: usize> {
    /// The sender's last setpoint.
    pub from: Setpoint<N>,
    /// The next one.
    pub to: Setpoint<N>,
}

impl<const N: usize> Handler<ArmMotion<N>> for ArmSim<N> {
    type Result = JointMotion<N>;

    fn handle(&mut self, _: ArmMotion<N>, ctx: &mut Context<Self>) -> JointMotion<N> {
        self.attend(ctx);
        JointMotion {
            state: *self.arm.simulation.state(),
            setpoint: *self.arm.simulation.pid().setpoint(),
            time: self.arm.simulation.time(),
            resets: self.arm.goals.past.resets,
            stands_still: self.arm.paused && self.arm.simulation.time() <= self.arm.paused_at,
            obstacle: Obstacle::of(&self.arm.simulation),
        }
    }
}

impl<const N: usize> Handler<MoveSetpoint<N>> for ArmSim<N> {
    type Result = bool;

    fn handle(&mut self, message: MoveSetpoint<N>, ctx: &mut Context<Self>) -> bool {
        self.attend(ctx);
        let is_known = *self.arm.simulation.pid().setpoint() == message.from;
        if is_known {
            self.arm.change(ArmInput::Setpoint(message.to));
        }
        is_known
    }
}
