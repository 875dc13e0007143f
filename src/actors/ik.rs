//! Inverse kinematics: `/ik/solve`, and the same question from `ik_action`.
//!
//! **Invariant:** nothing about the arm is kept: lengths and pose are asked of it for every solution.

use actix::prelude::*;

use super::arm_sim::ArmPose;
use super::node::ServiceCall;
use super::registry::Nodes;
use crate::math::kinematics::{Target, Unreachable, solve};
use crate::protocol::catalog::Service;
use crate::protocol::fields::{Bound, Fields};
use crate::protocol::goal_messages::SolutionValues;

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

    /// Enters this node's service into the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        let node = address.clone().recipient();
        nodes.services.insert(Service::Solve, node);
    }
}

// ---- messages -------------------------------------------------------------------------------------------------------

/// Joint positions \[rad\], each in (-π, π], that put the hand on the target. From `ik_action`.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "Result<[f64; N], SolveError>")]
pub struct Solve<const N: usize>(pub Target);

/// Why there is no solution.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// Out of the arm's reach.
    #[error(transparent)]
    Unreachable(#[from] Unreachable),
    /// The arm has ended.
    #[error("arm_sim does not answer")]
    NoArm,
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<const N: usize> Actor for Ik<N> {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<ServiceCall> for Ik<N> {
    type Result = ();

    fn handle(&mut self, call: ServiceCall, ctx: &mut Context<Self>) {
        let mut reply = call.reply;
        let target = Fields::read(&call.arguments, call.service)
            .map_err(|why| why.to_string())
            .and_then(|mut fields| read_target::<N>(&mut fields).ok_or_else(|| fields.status()));
        let target = match target {
            Ok(target) => target,
            Err(why) => return reply.refuse(&why),
        };
        let solution = solution(self.arm.clone(), target).into_actor(self);
        ctx.spawn(solution.map(move |solution, _, _| match solution {
            Ok(positions) => reply.succeed(&SolutionValues {
                positions: &positions,
            }),
            Err(why) => reply.refuse(&why.to_string()),
        }));
    }
}

impl<const N: usize> Handler<Solve<N>> for Ik<N> {
    type Result = ResponseFuture<Result<[f64; N], SolveError>>;

    fn handle(&mut self, Solve(target): Solve<N>, _: &mut Context<Self>) -> Self::Result {
        Box::pin(solution(self.arm.clone(), target))
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

/// Reads `x`, `y` and `phi`; none if one of them, or a field read before, is rejected.
///
/// Two links leave no orientation to choose: what stands there under `phi` is not looked at.
pub(super) fn read_target<const N: usize>(fields: &mut Fields<'_>) -> Option<Target> {
    let x = fields.number("x", Bound::Finite);
    let y = fields.number("y", Bound::Finite);
    let orientation = if N > 2 {
        fields.number("phi", Bound::Finite)
    } else {
        None
    };
    let position = glam::DVec2::new(x?, y?);
    fields.accepted().then_some(Target {
        position,
        orientation,
    })
}
