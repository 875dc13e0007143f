//! The registry: it knows every client, topic and service, fans messages out to subscribers, and routes calls.
//! `state.rs` has its state, which is made of `tables/`; `ops/` are the methods that change it.
//!
//! **Invariant:** a message is encoded once, whatever the number of its subscribers, and not at all without any.

mod nodes;
mod ops;
mod refusal;
mod state;
mod tables;

use actix::prelude::*;
use tokio::sync::oneshot;

pub use self::nodes::{Attach, Nodes};
use self::ops::fan_out::Pace;
use self::refusal::Refusal;
use self::state::Client;
pub use self::state::Registry;
use super::messages::{
    Connect, Disconnect, Ended, Finish, FinishAll, Handled, PublishInTurn, RefuseCalls, Refused,
    Request, Retire, SetTap, TakeCensus, Tapped,
};
use crate::actors::ConnectionId;
use crate::actors::node::{Publish, Respond};
use crate::protocol::catalog::Topic;

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl Actor for Registry {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl Handler<Attach> for Registry {
    type Result = ();

    fn handle(&mut self, Attach(nodes): Attach, _: &mut Context<Self>) {
        self.tally.set_replayed(nodes.replayed.clone());
        self.nodes = nodes;
    }
}

impl Handler<Connect> for Registry {
    type Result = Result<ConnectionId, Refused>;

    fn handle(&mut self, Connect(outlets): Connect, ctx: &mut Context<Self>) -> Self::Result {
        if self.closed.is_some() {
            return Err(Refused::Closed);
        }
        if self.clients.len() >= self.max_connections {
            self.displace();
            self.schedule_cleanup(ctx);
        }
        if self.clients.len() >= self.max_connections {
            return Err(Refused::Full(self.max_connections));
        }
        self.connections_made += 1;
        let id = ConnectionId(self.connections_made);
        self.clients.insert(id, Client::new(outlets));
        self.gauges.set_connections(self.clients.len() as u64);
        Ok(id)
    }
}

impl Handler<Ended> for Registry {
    type Result = ();

    fn handle(&mut self, Ended(id): Ended, _: &mut Context<Self>) {
        if self.clients.contains_key(&id) {
            self.ended.insert(id);
        }
    }
}

impl Handler<Retire> for Registry {
    type Result = Handled;

    fn handle(&mut self, Retire(id): Retire, ctx: &mut Context<Self>) -> Handled {
        self.withdraw(id);
        self.schedule_cleanup(ctx);
        if self.services.waiting_for(id) == 0 {
            return Handled::at_once();
        }
        let (answered, all_answered) = oneshot::channel();
        if let Some(client) = self.clients.get_mut(&id) {
            client.answered = Some(answered);
        }
        Handled::by_node(all_answered)
    }
}

impl Handler<Disconnect> for Registry {
    type Result = ();

    fn handle(&mut self, Disconnect(id): Disconnect, ctx: &mut Context<Self>) {
        self.forget(id);
        self.schedule_cleanup(ctx);
    }
}

impl Handler<Request> for Registry {
    type Result = Handled;

    fn handle(&mut self, request: Request, ctx: &mut Context<Self>) -> Handled {
        if !self.clients.contains_key(&request.from) {
            return Handled::at_once();
        }
        self.perform(request, ctx)
    }
}

impl Handler<Publish> for Registry {
    type Result = ();

    fn handle(&mut self, publish: Publish, _: &mut Context<Self>) {
        self.publish_own(publish, None);
    }
}

impl Handler<PublishInTurn> for Registry {
    type Result = Handled;

    fn handle(&mut self, PublishInTurn(messages): PublishInTurn, _: &mut Context<Self>) -> Handled {
        let mut pace = Pace::default();
        for message in messages {
            self.publish_own(message, Some(&mut pace));
        }
        pace.and(Handled::at_once())
    }
}

impl Handler<Respond> for Registry {
    type Result = ();

    fn handle(&mut self, respond: Respond, _: &mut Context<Self>) {
        if let Some(client) = self.clients.get(&respond.connection)
            && respond
                .status
                .is_none_or(|level| client.verbosity.wants(level))
        {
            let frame = respond.frame.write();
            if let Some(service) = respond.service {
                self.tap.pass(Tapped::Answered {
                    to: respond.connection,
                    service,
                    frame: &frame,
                });
                // A `Caller` has counted it.
                client.pass(frame, respond.service);
            } else {
                client.send(frame);
            }
        }
    }
}

impl Handler<TakeCensus> for Registry {
    type Result = MessageResult<TakeCensus>;

    fn handle(&mut self, take: TakeCensus, _: &mut Context<Self>) -> Self::Result {
        MessageResult(self.tally.census(take.at_most))
    }
}

impl Handler<SetTap> for Registry {
    type Result = ();

    fn handle(&mut self, SetTap(tap): SetTap, _: &mut Context<Self>) {
        let unwanted: Vec<&str> = Topic::ALL
            .map(Topic::name)
            .into_iter()
            .filter(|topic| !self.topics.has_subscribers(topic))
            .collect();
        let was_set = self.tap.is_set();
        self.tap.set(tap);
        for topic in unwanted {
            match (was_set, self.tap.is_set()) {
                (_, true) => self.tell_owner(topic, true),
                (true, false) => self.let_rest(topic),
                (false, false) => {}
            }
        }
        for (topic, frame) in &self.latched {
            if self.topics.has_subscribers(topic.name()) {
                self.tap.pass(Tapped::Published(*topic, frame));
            }
        }
    }
}

impl Handler<RefuseCalls> for Registry {
    type Result = ();

    fn handle(&mut self, RefuseCalls(why): RefuseCalls, _: &mut Context<Self>) {
        self.closed = Some(why);
        for call in self.services.take_all() {
            self.answer_forwarded(&call, &Refusal::Closed(why));
        }
        for goal in self.action_servers.take_all() {
            self.abort(&goal, &Refusal::Closed(why));
        }
    }
}

impl Handler<FinishAll> for Registry {
    type Result = ();

    fn handle(&mut self, _: FinishAll, _: &mut Context<Self>) {
        // The oldest go first, so that the order is the same in every run.
        let mut clients: Vec<_> = self.clients.iter().collect();
        clients.sort_unstable_by_key(|(id, _)| **id);
        for (_, client) in clients {
            client.outlets.finish.do_send(Finish);
        }
    }
}
