//! Inverse kinematics: `/ik/solve`, and the same question from `ik_action`.
//!
//! **Invariant:** nothing about the arm is kept: lengths and pose are asked of it for every solution.

use actix::prelude::*;
use bytes::Bytes;

use crate::actors::arm::sim::ArmPose;
use crate::actors::node::{Ask, Call};
use crate::actors::wire::{Address, Answered, Callable, Nodes};
use crate::math::kinematics::{Target, Unreachable, solve};
use crate::protocol::catalog::{Node, Service};
use crate::protocol::messages::goal::{SolutionValues, TargetMessage};
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, Rejections};

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
        nodes.serve::<Solve<N>>(Service::Solve, address.clone());
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

// ---- reading and writing --------------------------------------------------------------------------------------------

impl<const N: usize> Callable for Solve<N> {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let target = read_target::<N>(&mut fields);
        let rejected = fields.finish();
        target.map(Self).ok_or(rejected)
    }
}

impl<const N: usize> Answered for Solve<N> {
    fn write(answer: Result<[f64; N], SolveError>, to: &Address) -> Bytes {
        let values = answer
            .as_ref()
            .map(|positions| SolutionValues { positions });
        to.outcome(values)
    }
}

/// Reads `x`, `y` and `phi`; none if one of them, or a field read before, is rejected.
///
/// Two links leave no orientation to choose: what stands there under `phi` is not looked at.
pub(in crate::actors::arm) fn read_target<const N: usize>(
    fields: &mut Fields<'_>,
) -> Option<Target> {
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

/// A target as messages show it.
pub(in crate::actors::arm) fn target_message(target: &Target) -> TargetMessage {
    TargetMessage {
        x: target.position.x,
        y: target.position.y,
        phi: target.orientation,
    }
}
