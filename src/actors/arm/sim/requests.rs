//! Calls and messages of clients to the arm. The requests are in `services::arm`, and their effects in `live`.
//!
//! Requests for more than one row of steps take turns. The effect is that of separate requests for single steps, so
//! other requests take effect in between.
//!
//! **Invariant:** the arm advances to now before it answers. A refused request for steps changes nothing. An accepted
//! one is completed, unless the arm diverges, is resumed, its client leaves, or the runtime ends.

use actix::prelude::*;

use super::node::{ArmSim, Steps, pass_barriers};
use super::orders;
use crate::actors::node::{Call, Nodes, ShutDown, Unserved};
use crate::live::ArmRequest;
use crate::protocol::catalog::{Node, Rosapi, Service, Topic};
use crate::services::arm::{
    AskParameters, Disturb, Enable, GetTime, Pause, Reset, SetFriction, SetGains, SetIntegrator,
    SetLimits, SetParams, SetPeriod, SetSensors, SetState, Step, parameter_services,
};
use crate::services::goals::Solve;

impl<const N: usize> ArmSim<N> {
    /// Adds this node's services and topics to the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        orders::subscribe(address, nodes);
        nodes.serve::<Disturb<N>>(Service::Disturb, address.clone());
        nodes.serve::<SetFriction<N>>(Service::SetFriction, address.clone());
        nodes.serve::<SetGains<N>>(Service::SetGains, address.clone());
        nodes.serve::<SetIntegrator>(Service::SetIntegrator, address.clone());
        nodes.serve::<SetParams<N>>(Service::SetParams, address.clone());
        nodes.serve::<SetLimits<N>>(Service::SetLimits, address.clone());
        nodes.serve::<SetSensors<N>>(Service::SetSensors, address.clone());
        nodes.serve::<SetPeriod>(Service::SetPeriod, address.clone());
        nodes.serve::<Reset<N>>(Service::Reset, address.clone());
        nodes.serve::<SetState<N>>(Service::SetState, address.clone());
        nodes.serve::<Step<N>>(Service::Step, address.clone());
        nodes.serve::<Pause>(Service::Pause, address.clone());
        nodes.serve::<Enable>(Service::Enable, address.clone());
        nodes.serve::<Solve<N>>(Service::Solve, address.clone());
        nodes.serve::<GetTime>(Service::Rosapi(Rosapi::GetTime), address.clone());
        for service in parameter_services() {
            nodes.serve::<AskParameters<N>>(service, address.clone());
        }
        for topic in Topic::ALL {
            if !topic.is_subscribed() && topic.owner() == Node::ArmSim {
                let arm = address.clone().recipient();
                nodes.publishers.insert(topic, arm);
            }
        }
    }

    /// Yields to all other messages, and waits until the goal's feedback has been published. Otherwise the registry
    /// would get it faster than it delivers it. Then the remaining requests continue, one after the other.
    fn go_on_stepping(&mut self, ctx: &mut Context<Self>) {
        let feedback_sent = self.feedback_sent.take();
        self.is_stepping = feedback_sent.is_some() || !self.steps.is_empty();
        if !self.is_stepping {
            return;
        }
        let reporters = self.goal_reporters.clone();
        let others = async move {
            let Some(progress) = feedback_sent else {
                return tokio::task::yield_now().await;
            };
            let _ = progress.await;
            pass_barriers(&reporters).await;
        };
        ctx.spawn(others.into_actor(self).map(|(), arm, ctx| {
            if let Some(next) = arm.steps.pop_front() {
                arm.take_row(next);
            }
            arm.go_on_stepping(ctx);
        }));
    }

    /// Takes the next row of steps. Answers after the last one, otherwise puts the request at the end of the queue.
    /// Nothing is stepped for a client that has left, because another one may have reset the arm since.
    fn take_row(&mut self, mut steps: Steps<N>) {
        if steps.reply.caller_has_left() {
            return steps.reply.refuse(Unserved::CALLER_GONE);
        }
        let (stepped, progress) = self.arm.take_row(&mut steps.asked);
        if let (Some(progress), Some(owner)) = (progress, &self.arm.world.owner) {
            self.feedback_sent = Some(Box::pin(owner.send(progress)));
        }
        match stepped {
            Some(stepped) => steps.reply.conclude(Ok(stepped)),
            None => self.steps.push_back(steps),
        }
    }
}

impl<const N: usize, A: ArmRequest<N>> Handler<Call<A>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, Call { ask, reply }: Call<A>, ctx: &mut Context<Self>) {
        self.take_due_steps(ctx);
        let answer = ask.perform(&mut self.arm);
        let conclude = move || reply.conclude(answer);
        if A::waits_for_news(&self.arm) {
            self.after_barriers(ctx, conclude);
        } else {
            conclude();
        }
    }
}

// ---- single steps ---------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<ShutDown> for ArmSim<N> {
    type Result = ();

    /// Only the owner of the goal ends it.
    fn handle(&mut self, ShutDown(why): ShutDown, ctx: &mut Context<Self>) {
        self.count_message(ctx);
        for mut steps in self.steps.drain(..) {
            steps.reply.refuse(Unserved(why));
        }
    }
}

impl<const N: usize> Handler<Call<Step<N>>> for ArmSim<N> {
    type Result = ();

    /// The steps do not depend on wall time, and the arm continues from their end when it is resumed.
    fn handle(&mut self, Call { ask, reply }: Call<Step<N>>, ctx: &mut Context<Self>) {
        self.take_due_steps(ctx);
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
