//! Calls and messages of clients to the arm. The requests are in `services::arm`, and their effects in `live`.
//!
//! **Invariant:** the arm advances to now before it answers.

use actix::prelude::*;

use super::inputs;
use super::node::ArmSim;
use crate::actors::node::Call;
use crate::actors::wire::Nodes;
use crate::live::ArmRequest;
use crate::protocol::catalog::{Direction, Node, Service, Topic};
use crate::services::arm::{
    Disturb, Enable, Pause, Reset, SetGains, SetIntegrator, SetParams, SetPeriod, SetState, Step,
};

impl<const N: usize> ArmSim<N> {
    /// Adds this node's services and topics to the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        inputs::attach(address, nodes);
        nodes.serve::<Disturb<N>>(Service::Disturb, address.clone());
        nodes.serve::<SetGains<N>>(Service::SetGains, address.clone());
        nodes.serve::<SetIntegrator>(Service::SetIntegrator, address.clone());
        nodes.serve::<SetParams<N>>(Service::SetParams, address.clone());
        nodes.serve::<SetPeriod>(Service::SetPeriod, address.clone());
        nodes.serve::<Reset<N>>(Service::Reset, address.clone());
        nodes.serve::<SetState<N>>(Service::SetState, address.clone());
        nodes.serve::<Step<N>>(Service::Step, address.clone());
        nodes.serve::<Pause>(Service::Pause, address.clone());
        nodes.serve::<Enable>(Service::Enable, address.clone());
        for topic in Topic::ALL {
            let published = topic.direction() == Direction::Published;
            if published && topic.owner() == Node::ArmSim {
                let arm = address.clone().recipient();
                nodes.publishers.insert(topic, arm);
            }
        }
    }
}

impl<const N: usize, A: ArmRequest<N>> Handler<Call<A>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, Call { ask, reply }: Call<A>, ctx: &mut Context<Self>) {
        self.attend(ctx);
        let answer = ask.perform(&mut self.arm);
        let conclude = move || reply.conclude(answer);
        if A::waits_for_news(&self.arm) {
            self.after_barriers(ctx, conclude);
        } else {
            conclude();
        }
    }
}
