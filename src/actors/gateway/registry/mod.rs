//! The registry: every client, topic and service; fans published topics out to subscribed connections, and routes
//! calls.
//!
//! **Invariant:** a message is encoded once, whatever the number of its subscribers, and not at all without any.

mod actions;
mod calls;
mod census;
mod ear;
mod endings;
mod fan_out;
mod left;
mod nodes;
mod numbers;
mod ops;
mod pursuers;
mod pursuit;
mod refusal;
mod services;
mod state;
mod subscriptions;
mod topics;

use actix::prelude::*;
use tokio::sync::oneshot;

use self::fan_out::Pace;
pub use self::nodes::{Attach, Nodes};
use self::refusal::Refusal;
use self::state::Client;
pub use self::state::Registry;
use super::messages::{
    Connect, Disconnect, Ended, Finish, FinishAll, Handled, Overhear, Overheard, PublishInTurn,
    RefuseCalls, Refused, Request, Retire, TakeCensus,
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
            self.look_at_endings(ctx);
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
        self.look_at_endings(ctx);
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
        self.look_at_endings(ctx);
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
                self.ear.hear(Overheard::Answered {
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

impl Handler<Overhear> for Registry {
    type Result = ();

    fn handle(&mut self, Overhear(eavesdropper): Overhear, _: &mut Context<Self>) {
        let unwanted: Vec<&str> = Topic::ALL
            .map(Topic::name)
            .into_iter()
            .filter(|topic| !self.topics.has_subscribers(topic))
            .collect();
        let was_open = self.ear.is_open();
        self.ear.lend(eavesdropper);
        for topic in unwanted {
            match (was_open, self.ear.is_open()) {
                (_, true) => self.tell_owner(topic, true),
                (true, false) => self.let_rest(topic),
                (false, false) => {}
            }
        }
        for (topic, frame) in &self.latched {
            if self.topics.has_subscribers(topic.name()) {
                self.ear.hear(Overheard::Published(*topic, frame));
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
        for goal in self.pursuers.take_all() {
            self.abort(&goal, &Refusal::Closed(why));
        }
    }
}

impl Handler<FinishAll> for Registry {
    type Result = ();

    fn handle(&mut self, _: FinishAll, _: &mut Context<Self>) {
        // Oldest first: the order is the same in every run.
        let mut clients: Vec<_> = self.clients.iter().collect();
        clients.sort_unstable_by_key(|(id, _)| **id);
        for (_, client) in clients {
            client.outlets.finish.do_send(Finish);
        }
    }
}
