//! `/rosapi/*`: the topics, services and nodes that there are. Topics and services of clients are asked of the
//! registry. The arm answers questions about its parameters and the time.
//!
//! **Invariant:** nothing is kept between two questions.

use actix::prelude::*;
use bytes::Bytes;
use serde_json::Value;

use crate::actors::node::TakeCensus;
use crate::actors::node::{Address, Ask, Call, Nodes};
use crate::actors::resources::long_work::{WorkKind, WorkPermit};
use crate::actors::resources::memory::SHORT;
use crate::protocol::catalog::{Rosapi, Service};
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Fields, Rejections};
use crate::protocol::ros::rosapi::{UnknownType, answer};

/// Memory that is reserved for a list before its length is known \[bytes\]. It suffices for a few clients.
const SHORT_LIST: usize = SHORT / 4;

// ---- state ----------------------------------------------------------------------------------------------------------

/// The node `rosapi`.
pub struct RosapiNode {
    registry: Recipient<TakeCensus>,
}

impl RosapiNode {
    /// A node that asks the registry for its clients.
    #[must_use]
    pub fn new(registry: Recipient<TakeCensus>) -> Self {
        Self { registry }
    }

    /// Enters this node's services into the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        for question in Rosapi::ALL {
            if question != Rosapi::GetTime && !question.is_about_parameters() {
                nodes.serve::<AskRosapi>(Service::Rosapi(question), address.clone());
            }
        }
    }
}

// ---- messages -------------------------------------------------------------------------------------------------------

/// A question about what there is: topics, services, nodes and types.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AskRosapi {
    /// The question.
    pub question: Rosapi,
    /// The name that it is about, if it is about one.
    pub name: String,
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl Actor for RosapiNode {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl Handler<Call<AskRosapi>> for RosapiNode {
    type Result = ();

    fn handle(&mut self, call: Call<AskRosapi>, ctx: &mut Context<Self>) {
        let Call { ask, mut reply } = call;
        let registry = self.registry.clone();
        let answered = async move {
            let mut reserved = SHORT_LIST;
            if !reply.reserve(reserved).await {
                return;
            }
            // A call that waits for memory holds neither a thread nor a census, so at most as many as there are threads
            // exist. Names may be added during the wait.
            while let Some(permit) = WorkPermit::take(WorkKind::Listing).await {
                let census = registry.send(TakeCensus).await.unwrap_or_default();
                let needed = census.most_bytes();
                if needed <= reserved {
                    let list = move || reply.answer(answer(ask.question, &ask.name, &census));
                    permit.run(list).await;
                    return;
                }
                drop((permit, census));
                reserved = needed + needed / 8;
                if !reply.reserve(reserved).await {
                    return;
                }
            }
        };
        ctx.spawn(answered.into_actor(self));
    }
}

// ---- reading and writing --------------------------------------------------------------------------------------------

impl Ask for AskRosapi {
    type Answer = Result<Value, UnknownType>;

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

    fn write(answer: Result<Value, UnknownType>, to: &Address) -> Bytes {
        to.outcome(answer)
    }
}
