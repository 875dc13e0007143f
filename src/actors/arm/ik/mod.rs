//! Inverse kinematics: `/ik/solve`, and the same question from `ik_action`.
//!
//! **Invariant:** nothing about the arm is kept: lengths and pose are asked of it for every solution.

mod wire;

use actix::prelude::*;

use crate::actors::arm::sim::ArmPose;
use crate::actors::node::{Ask, Call};
use crate::math::kinematics::{Target, Unreachable, solve};
use crate::protocol::catalog::Node;

pub(super) use self::wire::{read_target, target_message};

// ---- state ----------------------------------------------------------------------------------------------------------

/// The node `ik` for an arm of `N` links.
pub struct Ik<const N: usize> {
    arm: Recipient<ArmPose<N>>,
}

impl<const N: usize> Ik<N> {
    /// A node that asks `arm`.
    #[must_use]
    pub fn new(arm: Recipient<ArmPose<N>>) -> Self {
        Self { arm }
    }
}

// ---- messages -------------------------------------------------------------------------------------------------------

/// Joint positions \[rad\], each in (-π, π], that put the end effector on the target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solve<const N: usize>(pub Target);

impl<const N: usize> Ask for Solve<N> {
    type Answer = Result<[f64; N], SolveError>;
}

/// Why there is no solution.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// Out of the arm's reach.
    #[error(transparent)]
    Unreachable(#[from] Unreachable),
    /// The arm has ended.
    #[error("{} does not answer", Node::ArmSim.name())]
    NoArm,
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<const N: usize> Actor for Ik<N> {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<Call<Solve<N>>> for Ik<N> {
    type Result = ();

    fn handle(&mut self, call: Call<Solve<N>>, ctx: &mut Context<Self>) {
        let Call {
            ask: Solve(target),
            reply,
        } = call;
        let solution = solution(self.arm.clone(), target).into_actor(self);
        ctx.spawn(solution.map(|solution, _, _| reply.conclude(solution)));
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

async fn solution<const N: usize>(
    arm: Recipient<ArmPose<N>>,
    target: Target,
) -> Result<[f64; N], SolveError> {
    let pose = arm.send(ArmPose).await.map_err(|_| SolveError::NoArm)?;
    Ok(solve(&pose.lengths, &pose.positions, &target)?)
}
