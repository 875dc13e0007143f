//! A topic that the arm subscribes to: CDR in, JSON out.
//!
//! **Invariant:** bytes that are not a message of the type are dropped, and the reason is logged.

use actix::prelude::*;
use pendularm::protocol::catalog::Topic;
use pendularm::protocol::catalog::types::Type;
use pendularm::protocol::ros::cdr_reader;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::sample::Sample;
use zenoh::{Session, Wait};

use super::gateway::Gateway;
use super::{MAILBOX, PublishToArm};
use crate::convention::Endpoint;
use crate::report::{self, Repeated};

/// A topic that the arm subscribes to.
pub struct Subscription {
    topic: Topic,
    one: Type,
    gateway: Addr<Gateway>,
    warning: Repeated,
    _subscriber: Subscriber<()>,
    _token: LivelinessToken,
}

/// A message from the graph.
#[derive(Message)]
#[rtype(result = "()")]
struct Taken(Sample);

impl Subscription {
    /// Starts it. Messages have the key `key`, and `token` is its entry in the graph.
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
        let address: Addr<Self> = context.address();
        let take = move |sample| {
            if address.try_send(Taken(sample)).is_err() {
                report::say(&format!(
                    "{}: a message was dropped: too many wait",
                    topic.name()
                ));
            }
        };
        let subscriber = session
            .declare_subscriber(endpoint.key)
            .callback(take)
            .wait()?;
        Ok(context.run(Self {
            topic,
            one,
            gateway,
            warning: Repeated::default(),
            _subscriber: subscriber,
            _token: session.liveliness().declare_token(endpoint.token).wait()?,
        }))
    }
}

impl Actor for Subscription {
    type Context = Context<Self>;
}

impl Handler<Taken> for Subscription {
    type Result = ();

    fn handle(&mut self, Taken(sample): Taken, _: &mut Self::Context) {
        let topic = self.topic.name();
        match cdr_reader::decode(self.one, &sample.payload().to_bytes()) {
            Ok(msg) => self.gateway.do_send(PublishToArm { topic, msg }),
            Err(why) => self
                .warning
                .say(format!("{topic}: a message was dropped: {why}")),
        }
    }
}

stops_with_the_arm!(Subscription);
