//! A topic of the arm in the graph: JSON in, CDR out.
//!
//! **Invariant:** the bridge subscribes to a topic of the arm only while the graph has a subscriber for it, or if it
//! is latched.

use actix::prelude::*;
use pendularm::protocol::catalog::Topic;
use pendularm::protocol::catalog::types::Type;
use pendularm::protocol::ros::cdr;
use zenoh::Session;

use super::gateway::Gateway;
use super::outlet::Outlet;
use super::{ArmMessage, Listen, MAILBOX};
use crate::convention::Endpoint;

/// A topic in the graph.
pub struct Publisher {
    topic: Topic,
    one: Type,
    outlet: Outlet,
    gateway: Addr<Gateway>,
}

/// Whether the topic has a subscriber in the graph.
#[derive(Message)]
#[rtype(result = "()")]
struct IsSubscribed(bool);

impl Publisher {
    /// Starts it.
    ///
    /// # Errors
    /// If Zenoh refuses.
    pub fn join(
        session: &Session,
        topic: Topic,
        one: Type,
        endpoint: Endpoint,
        gateway: Addr<Gateway>,
    ) -> zenoh::Result<Addr<Self>> {
        let mut context = Context::new();
        context.set_mailbox_capacity(MAILBOX);
        let mut outlet = Outlet::new(session, endpoint, topic.is_latched())?;
        if !topic.is_latched() {
            let address: Addr<Self> = context.address();
            outlet.watch(move |is_wanted| address.do_send(IsSubscribed(is_wanted)))?;
        }
        Ok(context.run(Self {
            topic,
            one,
            outlet,
            gateway,
        }))
    }

    fn listen(&self, is_wanted: bool, ctx: &Context<Self>) {
        self.gateway.do_send(Listen {
            topic: self.topic.name(),
            to: is_wanted.then(|| ctx.address().recipient()),
        });
    }
}

impl Actor for Publisher {
    type Context = Context<Self>;

    fn started(&mut self, ctx: &mut Self::Context) {
        if self.topic.is_latched() {
            self.listen(true, ctx);
        }
    }
}

impl Handler<IsSubscribed> for Publisher {
    type Result = ();

    fn handle(&mut self, IsSubscribed(is_wanted): IsSubscribed, ctx: &mut Self::Context) {
        self.listen(is_wanted, ctx);
    }
}

impl Handler<ArmMessage> for Publisher {
    type Result = ();

    fn handle(&mut self, ArmMessage(msg): ArmMessage, _: &mut Self::Context) {
        self.outlet.put(cdr::encode(self.one, &msg));
    }
}

stops_with_the_arm!(Publisher);
