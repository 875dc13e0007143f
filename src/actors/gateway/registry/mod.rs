//! The registry has every client, topic and service. It fans messages out to subscribers, and routes calls.
//!
//! This file has its state and handlers. `publish.rs`, `subscriptions.rs` and `requests.rs` have the rosbridge ops. The
//! other files have its tables, which send nothing.
//!
//! **Invariant:** a message is encoded once for any number of subscribers, and not at all without subscribers. A
//! refused op changes nothing. It gets an error status, or the call's one response.

mod directory;
mod forms;
mod forwarded;
mod kept;
mod places;
mod publish;
mod refusal;
mod requests;
mod subscriptions;
mod topics;

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet, VecDeque};
use std::net::IpAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use actix::prelude::*;
use bytes::Bytes;
use tokio::sync::oneshot;
use tokio::time::{Instant, sleep_until};

use self::directory::Directory;
use self::forwarded::Requests;
use self::kept::{Kept, KeptEntry};
use self::places::Places;
use self::refusal::Refusal;
use self::topics::Topics;
use super::messages::{
    Connect, CountRefusal, Disconnect, FinishAll, Handled, Outlets, RefuseCalls, Refused, Request,
    Retire, SetTap, TakeCensus, Tap, Tapped, ToClient,
};
use crate::actors::ConnectionId;
use crate::actors::node::{Barrier, FrameKind, Interest, Respond};
use crate::actors::resources::gauges::Gauges;
use crate::actors::resources::memory::{Permit, cover};
pub use crate::actors::wire::Nodes;
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::messages::{self, ErrorForm, Level};
use crate::protocol::names;
use crate::protocol::op::{Op, ProviderOp, Served, Verbosity};
use crate::protocol::wire::json::Payload;

/// Calls and goals ended per cleanup, which takes a third of a millisecond.
const ENDED_IN_A_ROW: usize = 128;

// ---- state ----------------------------------------------------------------------------------------------------------

/// The runtime's nodes. From the runtime, once, before any client is accepted.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Attach(pub Nodes);

/// The registry actor.
#[derive(Default)]
pub struct Registry {
    clients: HashMap<ConnectionId, Client>,
    topics: Topics,
    directory: Directory,
    /// Calls and goals that wait for the clients that serve them.
    requests: Requests,
    /// Providers that have disconnected while calls or goals waited for them.
    gone: VecDeque<ConnectionId>,
    /// Time of the next cleanup, and the task that waits for it.
    next_cleanup: Option<(Instant, SpawnHandle)>,
    nodes: Nodes,
    /// The last message of each latched topic that has subscribers.
    latched: HashMap<Topic, Bytes>,
    /// Number of messages sent in fragments. It is part of the fragments' ids.
    fragmented: Arc<AtomicU64>,
    gauges: Arc<Gauges>,
    places: Places,
    connections_made: u64,
    /// Passes messages and calls to the recorder, while it records.
    tap: Option<Tap>,
    /// The reason why calls are rejected, once the runtime is ending.
    closed: Option<&'static str>,
    /// The memory permit of the frame whose op is being performed, if that frame is long.
    permit: Option<Permit>,
}

/// The registry's entry of one client.
struct Client {
    outlets: Outlets,
    /// Its address.
    from: IpAddr,
    /// The sum of its registrations, and of its calls and goals that wait for other clients.
    kept: Kept,
    registered: Registrations,
    /// Topics of the runtime's subscriptions that this client has explicitly unadvertised. Its messages there are
    /// dropped until it advertises again.
    withdrawn: HashSet<Topic>,
    /// The lowest level of statuses that it gets.
    verbosity: Verbosity,
    /// Dropped when the client disconnects.
    present: Arc<()>,
    /// Replaced when the client unsubscribes from the feedback of its goals, and dropped with the client.
    listening: Arc<()>,
    /// Dropped once no call of this client waits. Set after the client has stopped sending.
    answered: Option<oneshot::Sender<()>>,
}

/// The registrations of one client, sorted by name. They are withdrawn in that order.
#[derive(Default)]
struct Registrations {
    advertised: BTreeMap<Box<str>, KeptEntry>,
    /// Topics of its subscriptions, in its own spelling.
    subscribed: BTreeSet<Arc<str>>,
    served: BTreeMap<(Served, Box<str>), KeptEntry>,
}

/// The sender of the frame that is being performed, and the frame's `id`.
struct FrameOrigin {
    from: ConnectionId,
    id: Option<Payload>,
}

impl Registry {
    /// A registry without nodes. [`Attach`] adds them.
    #[must_use]
    pub fn new(gauges: Arc<Gauges>) -> Self {
        Self {
            gauges,
            ..Self::default()
        }
    }

    /// A registry without nodes, for at most `clients` clients at once.
    #[must_use]
    pub fn serving_at_most(self, clients: usize) -> Self {
        let places = Places::of(clients);
        Self { places, ..self }
    }
}

impl Client {
    fn new(outlets: Outlets, from: IpAddr) -> Self {
        Self {
            outlets,
            from,
            kept: Kept::default(),
            registered: Registrations::default(),
            withdrawn: HashSet::new(),
            verbosity: Verbosity::ALL,
            present: Arc::default(),
            listening: Arc::default(),
            answered: None,
        }
    }

    /// Sends a status, a forwarded call or another client's response.
    fn send(&self, frame: Bytes) {
        self.respond(frame, None);
    }

    /// Sends a response. `service` is the responding service, if it is the runtime's own.
    fn respond(&self, frame: Bytes, service: Option<Service>) {
        let response = ToClient::Respond { frame, service };
        self.outlets.mailbox.do_send(response);
    }

    /// Sends feedback of a goal. It may be dropped.
    fn deliver_feedback(&self, frame: Bytes) {
        let topic = None;
        self.outlets
            .mailbox
            .do_send(ToClient::Deliver { topic, frame });
    }

    /// Sets the form in which the client gets the reason of a failed call, if `form` is given.
    fn set_error_form(&self, form: Option<ErrorForm>) {
        if let Some(form) = form {
            let wants_text = form == ErrorForm::Text;
            self.outlets.wants_text.store(wants_text, Ordering::Relaxed);
        }
    }

    /// Bytes of responses that wait to be written to it.
    fn backlog(&self) -> usize {
        self.outlets.backlog.load(Ordering::Relaxed)
    }
}

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

impl Handler<Barrier> for Registry {
    type Result = ();

    fn handle(&mut self, _: Barrier, _: &mut Context<Self>) {}
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
        let mut held: BTreeMap<IpAddr, usize> = BTreeMap::new();
        for client in self.clients.values() {
            *held.entry(client.from).or_default() += 1;
        }
        if let Some((most_from, held)) = held.into_iter().max_by_key(|(_, held)| *held) {
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
        if !self.requests.has_waiting(id) {
            return Handled::at_once();
        }
        let (answered, all_answered) = oneshot::channel();
        if let Some(client) = self.clients.get_mut(&id) {
            client.answered = Some(answered);
        }
        Handled::with(all_answered)
    }
}

impl Handler<Disconnect> for Registry {
    type Result = ();

    fn handle(&mut self, Disconnect(id): Disconnect, ctx: &mut Context<Self>) {
        self.withdraw(id);
        self.requests.forget_caller(id);
        if let Some(client) = self.clients.remove(&id) {
            client.outlets.gone.store(true, Ordering::Relaxed);
            self.gauges.set_connections(self.clients.len() as u64);
        }
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

impl Handler<Respond> for Registry {
    type Result = ();

    fn handle(&mut self, respond: Respond, _: &mut Context<Self>) {
        let Some(client) = self.clients.get(&respond.connection) else {
            return;
        };
        match respond.kind {
            FrameKind::Status(level) if !client.verbosity.wants(level) => {}
            FrameKind::Status(_) | FrameKind::End => client.send(respond.frame),
            FrameKind::Feedback => client.deliver_feedback(respond.frame),
            FrameKind::Answer(service) => {
                if let Some(tap) = &mut self.tap {
                    tap(Tapped::Answered {
                        to: respond.connection,
                        service,
                        frame: &respond.frame,
                    });
                }
                client.respond(respond.frame, Some(service));
            }
        }
    }
}

impl Handler<TakeCensus> for Registry {
    type Result = MessageResult<TakeCensus>;

    fn handle(&mut self, _: TakeCensus, _: &mut Context<Self>) -> Self::Result {
        MessageResult(self.directory.census(self.topics.listed()))
    }
}

impl Handler<SetTap> for Registry {
    type Result = ();

    fn handle(&mut self, SetTap(tap): SetTap, _: &mut Context<Self>) {
        let unwanted: Vec<&str> = Topic::ALL
            .map(Topic::name)
            .into_iter()
            .filter(|topic| self.topics.subscribers(topic).is_empty())
            .collect();
        let was_set = self.tap.is_some();
        self.tap = tap;
        for topic in unwanted {
            match (was_set, self.tap.is_some()) {
                (_, true) => self.tell_owner(topic, true),
                (true, false) => self.note_unwanted(topic),
                (false, false) => {}
            }
        }
        for (topic, frame) in &self.latched {
            if let Some(tap) = &mut self.tap
                && !self.topics.subscribers(topic.name()).is_empty()
            {
                tap(Tapped::Published(*topic, frame));
            }
        }
    }
}

impl Handler<RefuseCalls> for Registry {
    type Result = ();

    fn handle(&mut self, RefuseCalls(why): RefuseCalls, _: &mut Context<Self>) {
        self.closed = Some(why);
        for request in self.requests.take_all() {
            self.fail(&request, &Refusal::Closed(why));
        }
    }
}

impl Handler<FinishAll> for Registry {
    type Result = ();

    fn handle(&mut self, _: FinishAll, _: &mut Context<Self>) {
        // Sorted, so that the order is the same in every run.
        let mut clients: Vec<_> = self.clients.iter().collect();
        clients.sort_unstable_by_key(|(id, _)| **id);
        for (_, client) in clients {
            client.outlets.mailbox.do_send(ToClient::Finish);
        }
    }
}

// ---- ops ------------------------------------------------------------------------------------------------------------

impl Registry {
    /// Performs one op of a registered client.
    fn perform(&mut self, request: Request, ctx: &mut Context<Self>) -> Handled {
        let Request { from, id, op, .. } = request;
        let origin = FrameOrigin { from, id };
        let refusal = match op {
            Op::Publish { topic, msg } => return self.publish(origin, &topic, msg, ctx),
            Op::PublishLines(lines) => return self.publish_lines(from, &lines, ctx),
            Op::CallService(call) => return self.call(origin, call, ctx),
            Op::SendActionGoal(goal) => return self.send_action_goal(origin, goal, ctx),
            Op::CancelActionGoal { action } => {
                return self.cancel_action_goal(origin, &action, ctx);
            }
            Op::Advertise { topic, type_name } => {
                self.advertise(&origin, &topic, type_name.as_deref())
            }
            Op::Unadvertise { topic } => {
                self.unadvertise(&origin, &topic);
                Ok(())
            }
            Op::Subscribe(subscribe) => self.subscribe(&origin, &subscribe),
            Op::Unsubscribe { topic } => {
                self.unsubscribe(&origin, &topic);
                Ok(())
            }
            Op::SetLevel { verbosity, errors } => {
                if let Some(client) = self.clients.get_mut(&from) {
                    client.verbosity = verbosity;
                    client.set_error_form(errors);
                }
                Ok(())
            }
            Op::Serve { kind, name, op } => self.perform_as_provider(&origin, kind, &name, op),
            Op::BadAnswer {
                kind,
                name,
                problem,
            } => self.fail_answered(&origin, kind, name.as_deref(), problem),
            // The connection has already joined the pieces and checked the token. If no token is required, any token is
            // accepted.
            Op::Fragment(_) | Op::Auth { .. } => Ok(()),
        };
        if let Err(why) = refusal {
            self.refuse(&origin, &why);
        }
        Handled::at_once()
    }

    /// Performs an op of a client that serves `name`.
    fn perform_as_provider(
        &mut self,
        origin: &FrameOrigin,
        kind: Served,
        name: &str,
        op: ProviderOp,
    ) -> Result<(), Refusal> {
        match op {
            ProviderOp::Advertise { type_name } => {
                self.serve(origin, kind, name, type_name.as_deref())
            }
            ProviderOp::Unadvertise => self.stop_serving(origin, kind, name),
            ProviderOp::Feedback { values } => self.pass_feedback(origin, name, &values),
            ProviderOp::End {
                values,
                status,
                result,
            } => self.complete(origin, kind, name, |name, id| {
                messages::action_result(name, id, &values, status, result)
            }),
            ProviderOp::Respond {
                values,
                result,
                status,
            } => {
                let status = status.unwrap_or_default();
                self.complete(origin, kind, name, |name, id| {
                    messages::response(name, id, &values, result, &status)
                })
            }
        }
    }

    /// Sends an error status with the reason to the sender of a refused frame.
    fn refuse(&self, origin: &FrameOrigin, why: &Refusal) {
        self.send_status(
            origin.from,
            Level::Error,
            &why.to_string(),
            origin.id.as_ref(),
        );
    }

    fn send_status(&self, to: ConnectionId, level: Level, msg: &str, id: Option<&Payload>) {
        if level == Level::Error {
            tracing::debug!(connection = to.0, why = msg, "refused");
        }
        if let Some(client) = self.clients.get(&to)
            && client.verbosity.wants(level)
        {
            client.send(messages::status(level, msg, id));
        }
    }

    /// The frame with the memory permit of the long frame from which it was made.
    fn covered(&self, frame: Bytes) -> Bytes {
        cover(self.permit.as_ref(), frame)
    }

    /// Whether the topic has a subscriber or a tap. `topic` is an absolute name.
    fn is_wanted(&self, topic: &str) -> bool {
        self.tap.is_some() || !self.topics.subscribers(topic).is_empty()
    }

    /// Notes that the topic's last subscriber has gone.
    fn note_unwanted(&mut self, topic: &str) {
        if let Some(topic) = Topic::from_name(topic) {
            self.latched.remove(&topic);
        }
        self.tell_owner(topic, false);
    }

    fn tell_owner(&self, topic: &str, wanted: bool) {
        if let Some(topic) = Topic::from_name(topic)
            && let Some(owner) = self.nodes.publishers.get(&topic)
        {
            owner.do_send(Interest { topic, wanted });
        }
    }
}

// ---- cleanup: calls and goals end in batches, and other messages are handled in between -----------------------------

impl Registry {
    /// Withdraws a client's registrations. The cleanup ends the calls and goals that wait for its answer, because there
    /// may be many.
    fn withdraw(&mut self, id: ConnectionId) {
        let Some(client) = self.clients.get_mut(&id) else {
            return;
        };
        let registered = std::mem::take(&mut client.registered);
        for topic in registered.advertised.keys() {
            self.topics.remove_publisher(topic);
        }
        for topic in &registered.subscribed {
            self.drop_subscriber(topic, id);
        }
        for (kind, name) in registered.served.keys() {
            self.directory.withdraw(*kind, name, id);
        }
        if self.requests.waiting_for(id).is_some() {
            self.gone.push_back(id);
        }
    }

    /// Schedules the next cleanup: at once if a provider has disconnected, else at the earliest deadline.
    fn schedule_cleanup(&mut self, ctx: &mut Context<Self>) {
        let left = (!self.gone.is_empty()).then(Instant::now);
        let Some(due) = left.or_else(|| self.requests.next_deadline()) else {
            return;
        };
        if let Some((at, waiting)) = self.next_cleanup {
            if at <= due {
                return;
            }
            ctx.cancel_future(waiting);
        }
        let wait = async move {
            tokio::task::yield_now().await;
            sleep_until(due).await;
        };
        let waiting = ctx.spawn(wait.into_actor(self).map(|(), registry, ctx| {
            registry.next_cleanup = None;
            registry.clean_up_batch();
            registry.schedule_cleanup(ctx);
        }));
        self.next_cleanup = Some((due, waiting));
    }

    /// Ends one batch: first calls past their deadlines, then requests of disconnected providers.
    fn clean_up_batch(&mut self) {
        let now = Instant::now();
        for _ in 0..ENDED_IN_A_ROW {
            if let Some(call) = self.requests.take_due(now) {
                self.fail(&call, &Refusal::TimedOut(call.name.to_string()));
                continue;
            }
            let Some(provider) = self.gone.front() else {
                return;
            };
            let waiting = self.requests.waiting_for(*provider);
            if let Some(request) = waiting.and_then(|number| self.requests.take(number)) {
                self.fail(&request, &Refusal::ProviderGone(request.name.to_string()));
            } else {
                self.gone.pop_front();
            }
        }
    }

    /// Removes a subscriber from a topic, and notifies the topic's owner if it was the last one.
    fn drop_subscriber(&mut self, topic: &str, connection: ConnectionId) {
        let name = names::absolute(topic);
        self.topics.remove_subscriber(&name, topic, connection);
        if let Some(client) = self.clients.get_mut(&connection)
            && Topic::from_name(&name) == Some(Topic::TfWebFeedback)
            && !names::spellings(&name).any(|one| client.registered.subscribed.contains(one))
        {
            client.listening = Arc::default();
        }
        if !self.is_wanted(&name) {
            self.note_unwanted(&name);
        }
    }
}
