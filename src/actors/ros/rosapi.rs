//! `/rosapi/*`: the topics, services and nodes that there are, and the time. Topics and services of clients are asked
//! of the registry, the time of the arm. The arm answers questions about its parameters.
//!
//! **Invariant:** nothing is kept between two questions.

use std::time::Duration;

use actix::prelude::*;
use bytes::Bytes;
use serde_json::json;
use tokio::time::sleep;

use crate::actors::arm::sim::SimulationTime;
use crate::actors::gateway::messages::TakeCensus;
use crate::actors::node::{Ask, Call, Unserved};
use crate::actors::resources::long_work::{WorkKind, WorkPermit};
use crate::actors::wire::{Address, Answered, Callable, Nodes};
use crate::protocol::catalog::{Node, Rosapi, Service};
use crate::protocol::messages::Stamp;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Fields, Rejections};
use crate::protocol::ros::rosapi::{self, Census};

/// Pause between two tries to find room for a long list.
const ROOM_RETRY: Duration = Duration::from_millis(10);

// ---- state ----------------------------------------------------------------------------------------------------------

/// The node `rosapi`.
pub struct RosapiNode {
    registry: Recipient<TakeCensus>,
    time: Recipient<SimulationTime>,
}

impl RosapiNode {
    /// A node that asks the registry for its clients, and the arm for the time.
    #[must_use]
    pub fn new(registry: Recipient<TakeCensus>, time: Recipient<SimulationTime>) -> Self {
        Self { registry, time }
    }

    /// Enters this node's services into the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        for question in Rosapi::ALL {
            let service = Service::Rosapi(question);
            let node = address.clone();
            match question {
                Rosapi::GetTime => nodes.serve::<GetTime>(service, node),
                question if question.is_about_parameters() => {}
                _ => nodes.serve::<Look>(service, node),
            }
        }
    }
}

// ---- messages -------------------------------------------------------------------------------------------------------

/// A question about what there is: topics, services, nodes and types.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Look {
    /// The question.
    pub question: Rosapi,
    /// The name that it is about, if it is about one.
    pub name: String,
}

/// A question and the registrations of clients: its answer is made of these and of the catalog.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Listing {
    /// The question.
    pub look: Look,
    /// Topics and services of clients.
    pub census: Census,
}

impl Ask for Look {
    type Answer = Listing;
}

/// Asks for simulation time \[s\].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GetTime;

impl Ask for GetTime {
    type Answer = f64;
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl Actor for RosapiNode {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl Handler<Call<Look>> for RosapiNode {
    type Result = ();

    fn handle(&mut self, call: Call<Look>, ctx: &mut Context<Self>) {
        let Call {
            ask: look,
            mut reply,
        } = call;
        let registry = self.registry.clone();
        let answered = async move {
            // Only calls with a permit hold a census, however many calls wait.
            let Some(place) = WorkPermit::take(WorkKind::Listing).await else {
                return;
            };
            let census = registry.send(TakeCensus).await.unwrap_or_default();
            while reply.reserve(census.most_bytes()).is_err() {
                sleep(ROOM_RETRY).await;
            }
            let list = move || reply.answer(Listing { look, census });
            place.perform(list).await;
        };
        ctx.spawn(answered.into_actor(self));
    }
}

impl Handler<Call<GetTime>> for RosapiNode {
    type Result = ();

    fn handle(&mut self, call: Call<GetTime>, ctx: &mut Context<Self>) {
        let mut reply = call.reply;
        let time = self.time.send(SimulationTime).into_actor(self);
        ctx.spawn(time.map(move |time, _, _| match time {
            Ok(time) => reply.answer(time),
            Err(_) => reply.refuse(Unserved::NoAnswer(Node::ArmSim.name())),
        }));
    }
}

// ---- reading and writing --------------------------------------------------------------------------------------------

impl Callable for Look {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let name = service.fields().first();
        let name = name.and_then(|field| fields.text(field.name));
        let name = name.unwrap_or_default().into_owned();
        let question = match service {
            Service::Rosapi(question) => question,
            other => {
                debug_assert!(false, "{} is not this node's", other.name());
                Rosapi::Topics
            }
        };
        fields.accept(Self { question, name })
    }
}

impl Answered for Look {
    fn write(Listing { look, census }: Listing, to: &Address) -> Bytes {
        to.outcome(rosapi::answer(look.question, &look.name, &census))
    }
}

impl Callable for GetTime {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        Fields::read(arguments, service)?;
        Ok(Self)
    }
}

impl Answered for GetTime {
    fn write(time: f64, to: &Address) -> Bytes {
        let Stamp { sec, nanosec } = Stamp::from_seconds(time);
        // ROS 1 has other names for the same; some clients know only those.
        let time = json!({"sec": sec, "nanosec": nanosec, "secs": sec, "nsecs": nanosec});
        to.response(&json!({"time": time}), "")
    }
}
