//! `/ik/solve` without an arm. `exchanges/arm.txt` has its answers.

use crate::system::in_virtual_time;
use actix::prelude::*;
use pendularm::actors::arm::ik::{Ik, Solve, SolveError};
use pendularm::actors::arm::sim::ArmPose;
use pendularm::actors::node::ask;
use pendularm::math::kinematics::Target;

/// An arm that has ended.
struct Gone;

impl Actor for Gone {
    type Context = Context<Self>;

    fn started(&mut self, ctx: &mut Context<Self>) {
        ctx.stop();
    }
}

impl Handler<ArmPose<2>> for Gone {
    type Result = MessageResult<ArmPose<2>>;

    fn handle(&mut self, _: ArmPose<2>, _: &mut Context<Self>) -> Self::Result {
        unreachable!("it has ended")
    }
}

#[test]
fn without_an_arm_the_caller_gets_the_reason() {
    in_virtual_time(async {
        let gone = Gone.start();
        while gone.connected() {
            tokio::task::yield_now().await;
        }
        let ik = Ik::<2>::new(gone.recipient()).start();
        let target = Target {
            position: glam::DVec2::X,
            orientation: None,
        };
        let answer = ask(&ik.recipient(), Solve(target)).await;
        assert_eq!(answer, Ok(Err(SolveError::NoArm)));
    });
}
