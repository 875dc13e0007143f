//! The registry: it knows every client, topic and service, fans messages out to subscribers, and routes calls.
//! `state.rs` has its state, which is made of `tables/`; `ops/` are the methods that change it.
//!
//! **Invariant:** a message is encoded once, whatever the number of its subscribers, and not at all without any.

mod nodes;
mod ops;
mod places;
mod refusal;
mod state;
mod tables;

use actix::prelude::*;
use tokio::sync::oneshot;
use tokio::time::Instant;

pub use self::nodes::{Attach, Nodes};
use self::refusal::Refusal;
use self::state::Client;
pub use self::state::Registry;
use super::messages::{
    Connect, CountRefusal, Disconnect, Finish, FinishAll, Handled, RefuseCalls, Refused, Request,
    Retire, SetTap, TakeCensus, Tapped,
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
        self.nodes = nodes;
    }
}

impl Handler<Connect> for Registry {
    type Result = Result<ConnectionId, Refused>;

    fn handle(&mut self, connect: Connect, _: &mut Context<Self>) -> Self::Result {
        if self.closed.is_some() {
            return Err(Refused::Closed);
        }
        let taken = self.clients.len();
        if !self.places.has_room(taken, connect.may_use_kept) {
            return Err(self.places.refusal());
        }
        self.connections_made += 1;
        let id = ConnectionId(self.connections_made);
        let client = Client::new(connect.outlets, connect.from);
        self.clients.insert(id, client);
        self.gauges.set_connections(self.clients.len() as u64);
        Ok(id)
    }
}

impl Handler<CountRefusal> for Registry {
    type Result = ();

    fn handle(&mut self, _: CountRefusal, _: &mut Context<Self>) {
        let Some(refused) = self.places.count_refusal(Instant::now()) else {
            return;
        };
        if let Some((most_from, held)) = self.most_places() {
            let (places, taken) = (self.places.clients(), self.clients.len());
            tracing::warn!(
                places,
                taken,
                refused,
                %most_from,
                held,
                "no place is free, so clients are refused; --clients sets the number of places"
            );
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

    fn handle(&mut self, mut request: Request, ctx: &mut Context<Self>) -> Handled {
        if !self.clients.contains_key(&request.from) {
            return Handled::at_once();
        }
        self.permit = request.permit.take();
        let handled = self.perform(request, ctx);
        self.permit = None;
        handled
    }
}

impl Handler<Publish> for Registry {
    type Result = ();

    fn handle(&mut self, publish: Publish, ctx: &mut Context<Self>) {
        self.publish_own(publish, ctx);
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
            }
            client.respond(frame, respond.service);
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
                (true, false) => self.note_unwanted(topic),
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
