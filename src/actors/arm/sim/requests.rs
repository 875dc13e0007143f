//! Calls and messages of clients to the arm. The requests are in `services::arm`, and their effects in `live`.
//!
//! Requests for more than one row of steps take turns. The effect is that of separate requests for single steps, so
//! other requests take effect in between.
//!
//! **Invariant:** the arm advances to now before it answers. A refused request for steps changes nothing. An accepted
//! one is completed, unless the arm diverges, is resumed, its client leaves, or the runtime ends.

use actix::prelude::*;

use super::node::{ArmSim, Steps};
use super::orders;
use crate::actors::node::{Call, Nodes, ShutDown, Unserved};
use crate::live::ArmRequest;
use crate::protocol::catalog::{Node, Rosapi, Service, Topic};
use crate::services::arm::{
    AskParameters, Disturb, Enable, GetTime, Pause, Reset, SetFriction, SetGains, SetIntegrator,
    SetLimits, SetParams, SetPeriod, SetSensors, SetState, Step, parameter_services,
};
use crate::services::goals::Solve;

/// Adds the node's services and topics to the registry's table.
pub fn attach<const N: usize>(address: &Addr<ArmSim<N>>, nodes: &mut Nodes) {
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
        self.refuse_steps(Unserved(why));
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
        self.step(Steps { asked, reply }, ctx);
    }
}
