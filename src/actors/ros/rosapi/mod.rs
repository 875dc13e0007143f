//! `/rosapi/*`: lists topics, services, nodes and parameters. Topics and services of clients come from the
//! registry; parameters and time come from the arm.
//!
//! Parameters are read and set by the arm's own requests, with the same checks and the same messages.
//!
//! **Invariant:** nothing is stored between two calls. Topics and services are requested from the registry, and
//! values from the arm.

mod services;

use std::time::Duration;

use actix::prelude::*;
use tokio::time::sleep;

pub(super) use self::services::read_change;
pub use self::services::{
    DeleteParam, GetParam, GetParamNames, GetTime, HasParam, Listing, Look, NotDeleted, NotSet,
    ParamChange, ParameterValue, SetParam, Unknown,
};
use crate::actors::arm::sim::{
    ArmSim, SetGains, SetIntegrator, SetParams, SetPeriod, SimulationTime, joint_names,
};
use crate::actors::gateway::messages::TakeCensus;
use crate::actors::node::{Call, Reply, Unserved, ask};
use crate::actors::resources::aside::{WorkKind, WorkPermit};
use crate::actors::wire::Nodes;
use crate::protocol::catalog::{self, Node, Service};
use crate::protocol::op::fields::Rejections;
use crate::protocol::ros::parameters::Parameter;
use crate::protocol::ros::rosapi::Census;
use crate::protocol::ros::urdf;

/// Pause between two tries to reserve memory for a long list.
const ROOM_RETRY: Duration = Duration::from_millis(10);
/// The number of clients' topics, services and actions above which an answer may be too long to be written in one turn.
const MANY: usize = 64;

// ---- state ----------------------------------------------------------------------------------------------------------

/// The node `rosapi` beside an arm of `N` links.
pub struct RosapiNode<const N: usize> {
    registry: Recipient<TakeCensus>,
    arm: ArmParameters<N>,
}

/// The messages to the arm for parameters and time.
#[derive(Clone)]
pub struct ArmParameters<const N: usize> {
    /// Gravity, masses and lengths.
    pub params: Recipient<Call<SetParams<N>>>,
    /// Gains.
    pub gains: Recipient<Call<SetGains<N>>>,
    /// Method and timestep.
    pub integrator: Recipient<Call<SetIntegrator>>,
    /// The control period.
    pub period: Recipient<Call<SetPeriod>>,
    /// Time.
    pub time: Recipient<SimulationTime>,
}

impl<const N: usize> ArmParameters<N> {
    /// The recipients of this arm.
    #[must_use]
    pub fn of(arm: &Addr<ArmSim<N>>) -> Self {
        Self {
            params: arm.clone().recipient(),
            gains: arm.clone().recipient(),
            integrator: arm.clone().recipient(),
            period: arm.clone().recipient(),
            time: arm.clone().recipient(),
        }
    }
}

impl<const N: usize> RosapiNode<N> {
    /// A node that requests registrations from the registry and values from the arm.
    #[must_use]
    pub fn new(registry: Recipient<TakeCensus>, arm: ArmParameters<N>) -> Self {
        Self { registry, arm }
    }

    /// Adds this node's services to the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        for question in catalog::Rosapi::ALL {
            let service = Service::Rosapi(question);
            let node = address.clone();
            match question {
                catalog::Rosapi::GetTime => nodes.serve::<GetTime>(service, node),
                catalog::Rosapi::GetParam => nodes.serve::<GetParam<N>>(service, node),
                catalog::Rosapi::SetParam => nodes.serve::<SetParam<N>>(service, node),
                catalog::Rosapi::HasParam => nodes.serve::<HasParam>(service, node),
                catalog::Rosapi::DeleteParam => nodes.serve::<DeleteParam>(service, node),
                catalog::Rosapi::GetParamNames => nodes.serve::<GetParamNames>(service, node),
                _ => nodes.serve_long::<Look>(service, node),
            }
        }
    }
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<const N: usize> Actor for RosapiNode<N> {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<Call<Look>> for RosapiNode<N> {
    type Result = ();

    fn handle(&mut self, call: Call<Look>, ctx: &mut Context<Self>) {
        let Call {
            ask: look,
            mut reply,
        } = call;
        let registry = self.registry.clone();
        let answered = async move {
            let short = TakeCensus { at_most: MANY };
            if let Ok(Some(census)) = registry.send(short).await {
                return list(&mut reply, look, census);
            }
            // Only running calls keep a census in memory, not waiting ones.
            let Some(place) = WorkPermit::take(WorkKind::Listing).await else {
                return;
            };
            let whole = TakeCensus {
                at_most: usize::MAX,
            };
            let census = registry.send(whole).await.ok().flatten();
            let census = census.unwrap_or_default();
            while reply.reserve(census.most_bytes()).is_err() {
                sleep(ROOM_RETRY).await;
            }
            place.perform(move || list(&mut reply, look, census)).await;
        };
        ctx.spawn(answered.into_actor(self));
    }
}

/// Answers a call from a census.
fn list(reply: &mut Reply<Listing>, look: Look, census: Census) {
    let mut pieces = reply.answer_in_pieces(Listing { look, census });
    while !pieces.advance() {}
}

impl<const N: usize> Handler<Call<GetTime>> for RosapiNode<N> {
    type Result = ();

    fn handle(&mut self, call: Call<GetTime>, ctx: &mut Context<Self>) {
        let mut reply = call.reply;
        let time = self.arm.time.send(SimulationTime).into_actor(self);
        ctx.spawn(time.map(move |time, _, _| match time {
            Ok(time) => reply.answer(time),
            Err(_) => reply.refuse(no_arm()),
        }));
    }
}

impl<const N: usize> Handler<Call<GetParam<N>>> for RosapiNode<N> {
    type Result = ();

    fn handle(&mut self, call: Call<GetParam<N>>, ctx: &mut Context<Self>) {
        let Call { ask, mut reply } = call;
        let Some(parameter) = ask.parameter else {
            let default = ask.default;
            return reply.answer(Err(Unknown { default }));
        };
        let value = value(parameter, self.arm.clone()).into_actor(self);
        ctx.spawn(value.map(|value, _, _| give(reply, value.map(Ok))));
    }
}

impl<const N: usize> Handler<Call<SetParam<N>>> for RosapiNode<N> {
    type Result = ();

    fn handle(&mut self, call: Call<SetParam<N>>, ctx: &mut Context<Self>) {
        let Call { ask, mut reply } = call;
        let change = match ask.change {
            Ok(change) => change,
            Err(why) => return reply.answer(Err(why)),
        };
        let rejected = change_parameter(change, self.arm.clone()).into_actor(self);
        ctx.spawn(rejected.map(|rejected, _, _| {
            give(reply, rejected.map(NotSet::unless_empty));
        }));
    }
}

impl<const N: usize> Handler<Call<HasParam>> for RosapiNode<N> {
    type Result = ();

    fn handle(&mut self, mut call: Call<HasParam>, _: &mut Context<Self>) {
        call.reply.answer(call.ask.parameter.is_some());
    }
}

impl<const N: usize> Handler<Call<DeleteParam>> for RosapiNode<N> {
    type Result = ();

    fn handle(&mut self, mut call: Call<DeleteParam>, _: &mut Context<Self>) {
        call.reply.answer(match call.ask.parameter {
            Some(_) => NotDeleted::Fixed,
            None => NotDeleted::Unknown,
        });
    }
}

impl<const N: usize> Handler<Call<GetParamNames>> for RosapiNode<N> {
    type Result = ();

    fn handle(&mut self, mut call: Call<GetParamNames>, _: &mut Context<Self>) {
        call.reply
            .answer(Parameter::ALL.map(Parameter::full_name).to_vec());
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

fn no_arm() -> Unserved {
    Unserved::NoAnswer(Node::ArmSim.name())
}

/// Forwards the arm's answer.
pub(super) fn give<T>(mut reply: Reply<T>, answer: Result<T, Unserved>) {
    match answer {
        Ok(answer) => reply.answer(answer),
        Err(_) => reply.refuse(no_arm()),
    }
}

/// The present value of a parameter.
pub(super) async fn value<const N: usize>(
    parameter: Parameter,
    arm: ArmParameters<N>,
) -> Result<ParameterValue<N>, Unserved> {
    use ParameterValue::{Number, Numbers, Text};
    Ok(match parameter {
        Parameter::Gravity
        | Parameter::Masses
        | Parameter::Lengths
        | Parameter::RobotDescription => {
            let arm = ask(&arm.params, SetParams::default()).await?.values;
            match parameter {
                Parameter::Gravity => Number(arm.gravity()),
                Parameter::Masses => Numbers(*arm.masses()),
                Parameter::Lengths => Numbers(*arm.lengths()),
                _ => Text(urdf::describe(
                    &joint_names::<N>(),
                    arm.lengths(),
                    arm.masses(),
                )),
            }
        }
        Parameter::Kp | Parameter::Ki | Parameter::Kd => {
            let gains = ask(&arm.gains, SetGains::default()).await?.values;
            match parameter {
                Parameter::Kp => Numbers(gains.kp),
                Parameter::Ki => Numbers(gains.ki),
                _ => Numbers(gains.kd),
            }
        }
        Parameter::Integrator | Parameter::Timestep => {
            let integrator = ask(&arm.integrator, SetIntegrator::default()).await?.values;
            match parameter {
                Parameter::Integrator => Text(integrator.method.name().to_owned()),
                _ => Number(integrator.timestep),
            }
        }
        Parameter::ControlPeriod => {
            let sampling = ask(&arm.period, SetPeriod::default()).await?.values;
            Number(sampling.period.period)
        }
    })
}

/// Lets the arm change a parameter. Returns the rejections.
pub(super) async fn change_parameter<const N: usize>(
    change: ParamChange<N>,
    arm: ArmParameters<N>,
) -> Result<Rejections, Unserved> {
    Ok(match change {
        ParamChange::Params(params) => ask(&arm.params, params).await?.rejected,
        ParamChange::Gains(gains) => ask(&arm.gains, gains).await?.rejected,
        ParamChange::Integrator(integrator) => ask(&arm.integrator, integrator).await?.rejected,
        ParamChange::Period(period) => ask(&arm.period, period).await?.rejected,
    })
}
