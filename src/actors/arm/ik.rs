//! Inverse kinematics: `/ik/solve`, and the same request from `ik_action`.
//!
//! **Invariant:** no state of the arm is stored. Lengths and pose are requested for every solution.

use actix::prelude::*;

use crate::actors::arm::sim::ArmPose;
use crate::actors::node::Call;
use crate::actors::wire::Nodes;
use crate::math::kinematics::{Target, solve};
use crate::protocol::catalog::Service;
pub use crate::services::goals::{Solve, SolveError};

// ---- state ----------------------------------------------------------------------------------------------------------

/// The node `ik` for an arm of `N` links.
pub struct Ik<const N: usize> {
    arm: Recipient<ArmPose<N>>,
}

impl<const N: usize> Ik<N> {
    /// A node that requests lengths and pose from `arm`.
    #[must_use]
    pub fn new(arm: Recipient<ArmPose<N>>) -> Self {
        Self { arm }
    }

    /// Adds this node's service to the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        nodes.serve::<Solve<N>>(Service::Solve, address.clone());
    }
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
