//! Steps of a paused arm that clients ask for: requests for more than a row take turns.
//!
//! It is as if each had asked for single steps, one after the other, so what others ask takes effect in between.
//!
//! **Invariant:** a request is refused at first and changes nothing, or is done as a whole, unless a divergence, a
//! resume or the end of the runtime comes in between.

use actix::prelude::*;

use super::node::ArmSim;
use super::waiting::Steps;
use crate::actors::node::{Call, ShutDown, Unserved};
use crate::services::arm::Step;

impl<const N: usize> Handler<ShutDown> for ArmSim<N> {
    type Result = ();

    /// The goal that the arm pursues is its owner's to end.
    fn handle(&mut self, ShutDown(why): ShutDown, ctx: &mut Context<Self>) {
        self.count_message(ctx);
        for mut steps in self.steps.drain(..) {
            steps.reply.refuse(Unserved::Refused(why));
        }
    }
}

impl<const N: usize> Handler<Call<Step<N>>> for ArmSim<N> {
    type Result = ();

    /// Wall time plays no part in the steps, and the arm goes on from there when it is resumed.
    fn handle(&mut self, Call { ask, reply }: Call<Step<N>>, ctx: &mut Context<Self>) {
        self.attend(ctx);
        let asked = match self.arm.begin_steps(ask) {
            Ok(asked) => asked,
            Err(rejected) => return reply.conclude(Err(rejected)),
        };
        let steps = Steps { asked, reply };
        if self.is_stepping && self.arm.judges_steps() {
            return self.steps.push_back(steps);
        }
        self.take_row(steps);
        if !self.is_stepping {
            self.go_on_stepping(ctx);
        }
    }
}

impl<const N: usize> ArmSim<N> {
    /// Lets everybody else have a turn, and the owner of the goal hear how it goes; then those whose steps are not all
    /// taken, one after the other.
    fn go_on_stepping(&mut self, ctx: &mut Context<Self>) {
        let underway = self.underway.take();
        self.is_stepping = underway.is_some() || !self.steps.is_empty();
        if !self.is_stepping {
            return;
        }
        let others = async move {
            match underway {
                Some(progress) => drop(progress.await),
                None => tokio::task::yield_now().await,
            }
        };
        ctx.spawn(others.into_actor(self).map(|(), arm, ctx| {
            if let Some(next) = arm.steps.pop_front() {
                arm.take_row(next);
            }
            arm.go_on_stepping(ctx);
        }));
    }

    /// Takes the next steps in a row; answers if they are the last, or puts the request behind those of the others.
    fn take_row(&mut self, mut steps: Steps<N>) {
        if steps.reply.caller_is_gone() {
            return steps.reply.refuse(Unserved::CallerGone);
        }
        let (stepped, progress) = self.arm.take_row(&mut steps.asked);
        if let (Some(progress), Some(owner)) = (progress, &self.arm.world.owner) {
            self.underway = Some(Box::pin(owner.send(progress)));
        }
        match stepped {
            Some(stepped) => steps.reply.conclude(Ok(stepped)),
            None => self.steps.push_back(steps),
        }
    }
}
