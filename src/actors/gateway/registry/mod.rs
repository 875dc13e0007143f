//! The registry has every client, topic and service. It fans messages out to subscribers, and routes calls.
//!
//! This file has its state and its handlers. `mailbox.rs` has its messages, `topics.rs` and `requests.rs` have the
//! rosbridge ops, and the other files the tables.
//!
//! **Invariant:** a message is encoded once for any number of subscribers, and not at all without subscribers. A
//! refused op changes nothing. It gets an error status, or the call's one response. Messages of one sender take effect
//! in the order sent: the registry has one mailbox, and so has each connection.

mod directory;
mod forms;
mod forwarded;
mod kept;
mod mailbox;
mod places;
mod refusal;
mod requests;
mod topic_table;
mod topics;

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet, VecDeque};
use std::fmt::Display;
use std::net::IpAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use actix::prelude::*;
use bytes::Bytes;
use tokio::sync::oneshot;
use tokio::time::Instant;

use self::directory::Directory;
use self::forwarded::Requests;
use self::kept::{Kept, KeptEntry};
pub use self::mailbox::{
    Attach, Connect, CountRefusal, Disconnect, FinishAll, Handled, Outlets, RefuseCalls, Refused,
    Request, Retire, SetTap, TakeCensus, Tap, Tapped, ToClient,
};
use self::places::Places;
use self::topic_table::Topics;
use crate::actors::ConnectionId;
pub use crate::actors::node::Nodes;
use crate::actors::node::{Barrier, ClientLink, Done, FrameKind, Respond, guard};
use crate::actors::resources::gauges::Gauges;
use crate::actors::resources::memory::{Permit, cover};
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::messages::{self, ErrorForm, Level};
use crate::protocol::op::{GoalStatus, Incoming, Op, OpError, Served, Verbosity};
use crate::protocol::wire::json::Payload;

// ---- state ----------------------------------------------------------------------------------------------------------

/// The registry actor.
#[derive(Default)]
pub struct Registry {
    clients: BTreeMap<ConnectionId, Client>,
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
    /// The client, as the nodes get it.
    link: ClientLink,
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
    /// The form in which it gets the reason of a failed call.
    error_form: ErrorForm,
    /// Replaced when the client unsubscribes from the feedback of its goals, and dropped with the client.
    listening: Arc<()>,
    /// The guard that its calls to other clients share, and the receiver that ends with them. Removed when the client
    /// stops sending.
    calls: Option<(Done, oneshot::Receiver<()>)>,
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
    fn new(outlets: Outlets, from: IpAddr, link: ClientLink) -> Self {
        Self {
            outlets,
            link,
            from,
            kept: Kept::default(),
            registered: Registrations::default(),
            withdrawn: HashSet::new(),
            verbosity: Verbosity::ALL,
            error_form: ErrorForm::default(),
            listening: Arc::default(),
            calls: Some(guard()),
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

    fn handle(&mut self, connect: Connect, ctx: &mut Context<Self>) -> Self::Result {
        if self.closed.is_some() {
            return Err(Refused::Closed);
        }
        let taken = self.clients.len();
        if !self.places.has_room(taken, connect.may_use_kept) {
            let Places { clients, kept, .. } = self.places;
            return Err(Refused::Full { clients, kept });
        }
        self.connections_made += 1;
        let id = ConnectionId(self.connections_made);
        let link = ClientLink {
            registry: ctx.address().recipient(),
            connection: id,
            gone: Arc::clone(&connect.outlets.gone),
        };
        let client = Client::new(connect.outlets, connect.from, link);
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
            let (places, taken) = (self.places.clients, self.clients.len());
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
        let client = self.clients.get_mut(&id);
        let calls = client.and_then(|client| client.calls.take());
        calls.map_or_else(Handled::at_once, |(_, all_ended)| Handled::with(all_ended))
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

    fn handle(&mut self, request: Request, ctx: &mut Context<Self>) -> Handled {
        let Request { from, incoming, .. } = request;
        if !self.clients.contains_key(&from) {
            return Handled::at_once();
        }
        let Incoming { id, op } = incoming;
        let origin = FrameOrigin { from, id };
        self.permit = request.permit;
        let handled = match op {
            Ok(op) => self.perform(origin, op, ctx),
            Err(why) => {
                self.answer_error(&origin, &why);
                Handled::at_once()
            }
        };
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

impl Handler<FinishAll> for Registry {
    type Result = ();

    fn handle(&mut self, _: FinishAll, _: &mut Context<Self>) {
        for client in self.clients.values() {
            client.outlets.mailbox.do_send(ToClient::Finish);
        }
    }
}

// ---- ops ------------------------------------------------------------------------------------------------------------

impl Registry {
    /// Performs one op of a registered client.
    fn perform(&mut self, origin: FrameOrigin, op: Op, ctx: &mut Context<Self>) -> Handled {
        let refusal = match op {
            Op::Publish { topic, msg } => return self.publish(origin, &topic, msg, ctx),
            Op::PublishLines(lines) => return self.publish_lines(origin.from, &lines, ctx),
            Op::CallService(call) => return self.call(origin, call, ctx),
            Op::SendActionGoal(goal) => return self.send_action_goal(origin, goal),
            Op::CancelActionGoal { action } => return self.cancel_action_goal(origin, &action),
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
                if let Some(client) = self.clients.get_mut(&origin.from) {
                    client.verbosity = verbosity;
                    client.error_form = errors.unwrap_or(client.error_form);
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

    /// Answers a frame that has no op: by the response of its call, by the result of its goal, or by a status.
    fn answer_error(&self, origin: &FrameOrigin, why: &OpError) {
        match why {
            OpError::Call { service, problem } => self.refuse_call(origin, service, problem, None),
            OpError::Goal { action, problem } => {
                self.end_goal(origin, action, problem, GoalStatus::Unknown);
            }
            OpError::Status(problem) => self.refuse(origin, problem),
        }
    }

    /// Sends an error status with the reason to the sender of a refused frame.
    fn refuse(&self, origin: &FrameOrigin, why: &impl Display) {
        let why = why.to_string();
        tracing::debug!(connection = origin.from.0, why, "refused");
        self.send_status(origin, Level::Error, &why);
    }

    fn send_status(&self, origin: &FrameOrigin, level: Level, msg: &str) {
        if let Some(client) = self.clients.get(&origin.from)
            && client.verbosity.wants(level)
        {
            client.send(self.covered(messages::status(level, msg, origin.id.as_ref())));
        }
    }

    /// The frame with the memory permit of the long frame from which it was made.
    fn covered(&self, frame: Bytes) -> Bytes {
        cover(self.permit.as_ref(), frame)
    }
}
