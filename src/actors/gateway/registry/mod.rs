//! The registry has every client, topic and service. It fans messages out to subscribers, and routes calls.
//!
//! This file has its state and its handlers, then the table of topics and its messages. `topics.rs` and `requests.rs`
//! have the rosbridge ops, and the other files the other tables.
//!
//! **Invariant:** a message is encoded once for any number of subscribers, and not at all without subscribers. A
//! refused op changes nothing. It gets an error status, or the call's one response. Messages of one sender take effect
//! in the order sent: the registry has one mailbox, and so has each connection.

mod directory;
mod forms;
mod forwarded;
mod places;
mod refusal;
mod registrations;
mod requests;
mod topics;

use std::collections::{BTreeMap, HashMap, HashSet, VecDeque};
use std::fmt::Display;
use std::net::IpAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;

use actix::prelude::*;
use bytes::Bytes;
use tokio::sync::oneshot;
use tokio::time::Instant;

use self::directory::Directory;
use self::forwarded::Requests;
use self::places::Places;
use self::registrations::{Entry, EntrySum, Registrations};
use crate::actors::ConnectionId;
use crate::actors::gateway::limits::MAX_BACKLOG;
pub use crate::actors::node::Nodes;
use crate::actors::node::{Barrier, ClientLink, Done, FrameKind, Respond, guard};
use crate::actors::resources::gauges::Gauges;
use crate::actors::resources::memory::{Permit, SHORT, cover};
use crate::protocol::catalog::types::{self, Type};
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::messages::{self, ErrorForm, Level};
use crate::protocol::op::{Encoding, GoalStatus, Incoming, Op, OpError, Verbosity};
use crate::protocol::outbox::Throttle;
use crate::protocol::ros::rosapi::{Census, Listed};
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
    entries: EntrySum,
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
            entries: EntrySum::default(),
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
        if frame.len() <= SHORT {
            self.outlets
                .backlog
                .fetch_add(frame.len(), Ordering::Relaxed);
        }
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

    /// Whether its short responses wait beyond the limit. Then other clients' calls and answers to it are refused.
    fn is_congested(&self) -> bool {
        self.backlog() > MAX_BACKLOG
    }
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl Actor for Registry {
    type Context = Context<Self>;

    fn started(&mut self, ctx: &mut Context<Self>) {
        Self::start_cleanup(ctx);
    }
}

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
        let all = self.clients.values().map(|client| client.from);
        self.places.warn_of_refusal(all, Instant::now());
    }
}

impl Handler<Retire> for Registry {
    type Result = Handled;

    fn handle(&mut self, Retire(id): Retire, _: &mut Context<Self>) -> Handled {
        self.withdraw(id);
        let client = self.clients.get_mut(&id);
        let calls = client.and_then(|client| client.calls.take());
        calls.map_or_else(Handled::at_once, |(_, all_ended)| Handled::with(all_ended))
    }
}

impl Handler<Disconnect> for Registry {
    type Result = ();

    fn handle(&mut self, Disconnect(id): Disconnect, _: &mut Context<Self>) {
        self.withdraw(id);
        self.requests.forget_caller(id);
        if let Some(client) = self.clients.remove(&id) {
            client.link.gone.store(true, Ordering::Relaxed);
            self.gauges.set_connections(self.clients.len() as u64);
        }
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
            Op::CallService(call) => return self.call(origin, call),
            Op::SendActionGoal(goal) => return self.send_action_goal(origin, goal),
            Op::CancelActionGoal { action } => return self.cancel_action_goal(&origin, &action),
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

// ---- the table of topics --------------------------------------------------------------------------------------------

/// One `subscribe` of a connection to a topic. `id` distinguishes several of them.
#[derive(Debug)]
struct Subscription {
    id: Option<Box<str>>,
    throttle: Duration,
    queue_length: usize,
    encoding: Encoding,
    /// Its part of the client's limit [`MAX_REGISTERED`](crate::actors::gateway::limits::MAX_REGISTERED).
    entry: Entry,
}

/// The topics, by their absolute names.
#[derive(Default)]
struct Topics {
    by_name: BTreeMap<Arc<str>, TopicUsers>,
}

/// Clients that use a topic.
#[derive(Default)]
struct TopicUsers {
    publishers: usize,
    subscribers: Vec<Subscriber>,
    /// The first type that a client named.
    type_name: Option<Arc<str>>,
    /// The first known type that a client named. Messages are encoded by it.
    known: Option<Type>,
}

/// A connection that subscribes to a topic under one spelling.
pub(super) struct Subscriber {
    connection: ConnectionId,
    /// Its spelling of the topic. Its messages have this name.
    spelling: Arc<str>,
    mailbox: Recipient<ToClient>,
    /// The merged encoding of its subscriptions.
    encoding: Encoding,
    subscriptions: Vec<Subscription>,
}

impl Subscriber {
    /// The subscription with this `id`.
    fn subscription(&self, id: Option<&str>) -> Option<&Subscription> {
        let mut all = self.subscriptions.iter();
        all.find(|one| one.id.as_deref() == id)
    }

    /// Ends the subscriptions that `stays` rejects, and adds `new`, if there is one.
    fn change(&mut self, stays: impl FnMut(&Subscription) -> bool, new: Option<Subscription>) {
        self.subscriptions.retain(stays);
        self.subscriptions.extend(new);
        let all = self.subscriptions.iter().map(|one| one.encoding);
        self.encoding = all.reduce(Encoding::merged).unwrap_or_default();
    }

    /// The smallest of each value over its subscriptions. `None` if there are none.
    fn throttle(&self) -> Option<Throttle> {
        let all = &self.subscriptions;
        let queue_lengths = || all.iter().map(|one| one.queue_length);
        Some(Throttle {
            interval: all.iter().map(|one| one.throttle).min()?,
            held_back: queue_lengths().min()?.max(1),
            queue_length: queue_lengths().filter(|length| *length > 0).min(),
        })
    }

    /// Discards what a throttle holds back of the topic.
    fn discard_held(&self) {
        let topic = Arc::clone(&self.spelling);
        self.mailbox.do_send(ToClient::Discard { topic });
    }

    /// Sends the topic's throttle to the connection.
    fn configure(&self, throttle: Option<Throttle>) {
        self.mailbox.do_send(ToClient::Configure {
            topic: Arc::clone(&self.spelling),
            throttle,
        });
    }
}

impl Topics {
    /// A client has begun to advertise a topic.
    fn add_publisher(&mut self, topic: &str) {
        self.by_name.entry(topic.into()).or_default().publishers += 1;
    }

    /// A client has begun to subscribe to a topic under a spelling.
    fn add_subscriber(
        &mut self,
        topic: &str,
        spelling: Arc<str>,
        connection: ConnectionId,
        mailbox: Recipient<ToClient>,
    ) {
        let users = self.by_name.entry(topic.into()).or_default();
        users.subscribers.push(Subscriber {
            connection,
            spelling,
            mailbox,
            encoding: Encoding::default(),
            subscriptions: Vec::new(),
        });
    }

    /// A client that uses a topic has named its type.
    fn note_type(&mut self, topic: &str, type_name: &str) {
        if let Some(users) = self.by_name.get_mut(topic) {
            users.known = users.known.or_else(|| types::find(type_name));
            users.type_name.get_or_insert_with(|| type_name.into());
        }
    }

    /// A client has stopped advertising a topic.
    fn remove_publisher(&mut self, topic: &str) {
        self.remove(topic, |users| {
            users.publishers = users.publishers.saturating_sub(1);
        });
    }

    /// A client has stopped subscribing to a topic under this spelling.
    fn remove_subscriber(&mut self, topic: &str, spelling: &str, client: ConnectionId) {
        self.remove(topic, |users| {
            users
                .subscribers
                .retain(|one| one.connection != client || *one.spelling != *spelling);
        });
    }

    fn remove(&mut self, topic: &str, change: impl FnOnce(&mut TopicUsers)) {
        let Some(users) = self.by_name.get_mut(topic) else {
            debug_assert!(false, "{topic} was not counted");
            return;
        };
        change(users);
        if users.publishers == 0 && users.subscribers.is_empty() {
            self.by_name.remove(topic);
        }
    }

    /// The subscribers to a topic, under all its spellings.
    fn subscribers(&self, topic: &str) -> &[Subscriber] {
        let users = self.by_name.get(topic);
        users.map_or(&[], |users| &users.subscribers)
    }

    /// The client that subscribes to a topic under this spelling.
    fn subscriber(
        &mut self,
        topic: &str,
        spelling: &str,
        client: ConnectionId,
    ) -> Option<&mut Subscriber> {
        let mut all = self.by_name.get_mut(topic)?.subscribers.iter_mut();
        all.find(|one| one.connection == client && *one.spelling == *spelling)
    }

    /// The type of a topic, if a client has named a known type.
    fn known_type(&self, topic: &str) -> Option<Type> {
        self.by_name.get(topic)?.known
    }

    /// The topics in the form of rosapi.
    fn listed(&self) -> impl Iterator<Item = Listed> {
        self.by_name.iter().map(|(name, users)| Listed {
            name: Arc::clone(name),
            type_name: users.type_name.clone(),
            published: users.publishers > 0,
            subscribed: !users.subscribers.is_empty(),
        })
    }
}

// ---- messages -------------------------------------------------------------------------------------------------------

/// The runtime's nodes. From the runtime, once, before any client is accepted.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Attach(pub Nodes);

/// A new client. From its connection. Returns its id.
#[derive(Message)]
#[rtype(result = "Result<ConnectionId, Refused>")]
pub struct Connect {
    /// The handles to its connection.
    pub outlets: Outlets,
    /// Its address.
    pub from: IpAddr,
    /// Whether it may use a kept place.
    pub may_use_kept: bool,
}

/// A client was refused because no place was free. From its connection.
#[derive(Message)]
#[rtype(result = "()")]
pub struct CountRefusal;

/// The handles to a connection, and the state that it shares with the registry.
#[derive(Clone)]
pub struct Outlets {
    /// Its mailbox.
    pub mailbox: Recipient<ToClient>,
    /// Bytes of short responses that were sent and are not written. The registry adds, and the connection subtracts.
    pub backlog: Arc<AtomicUsize>,
    /// Whether the client has left.
    pub gone: Arc<AtomicBool>,
}

/// Why a client was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// No place is free.
    #[error(
        "too many connections: this runtime serves {clients} clients at once and keeps {kept} of these places for HTTP \
         and WebSocket; --clients sets the number"
    )]
    Full {
        /// How many clients are served.
        clients: usize,
        /// How many of their places are kept.
        kept: usize,
    },
    /// It has not sent the required token, and too many such clients wait.
    #[error("this runtime requires its token first, and too many connections wait without a token")]
    NoToken,
    /// The runtime is ending.
    #[error("shutting down")]
    Closed,
}

/// The client has stopped sending. The registry withdraws its registrations. From its connection. The effect of
/// [`Handled`] ends when the client's calls have been answered.
#[derive(Message)]
#[rtype(result = "Handled")]
pub struct Retire(pub ConnectionId);

/// The client has disconnected, and its output is gone. The registry frees its place. From its connection. Idempotent.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Disconnect(pub ConnectionId);

/// One frame of a client. From its connection, which waits for [`Handled`] before it continues to read.
#[derive(Message)]
#[rtype(result = "Handled")]
pub struct Request {
    /// The client.
    pub from: ConnectionId,
    /// The op with the frame's `id`, or the frame's error.
    pub incoming: Incoming,
    /// The memory permit of a long frame. All forms made of the frame share it.
    pub permit: Option<Permit>,
}

/// The op has been routed. A node or the subscribers' sockets may still have to process it. The receiver ends after
/// that.
#[derive(MessageResponse, Default)]
pub struct Handled(Option<oneshot::Receiver<()>>);

impl Handled {
    /// The op has already taken effect.
    #[must_use]
    pub fn at_once() -> Self {
        Self::default()
    }

    /// The op was sent to its provider, or the message to its subscribers.
    #[must_use]
    pub fn with(effect: oneshot::Receiver<()>) -> Self {
        Self(Some(effect))
    }

    /// Waits until the op has taken effect.
    pub async fn effect(self) {
        if let Some(effect) = self.0 {
            // The sender never sends: dropping it is the signal.
            let _ = effect.await;
        }
    }
}

/// Requests the topics and services of the clients. From `rosapi`.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "Census")]
pub struct TakeCensus;

/// A message or call in the registry, as the tap gets it.
pub enum Tapped<'a> {
    /// A message on a topic of the runtime, from a node or a client, as the whole `publish` frame.
    Published(Topic, &'a Bytes),
    /// A client's call of one of the runtime's services.
    Called {
        /// The client.
        from: ConnectionId,
        /// The service.
        service: Service,
        /// The caller's `id`, if there is one.
        id: Option<&'a Payload>,
        /// The arguments.
        args: &'a Payload,
    },
    /// The response to such a call, as the whole frame.
    Answered {
        /// The client.
        to: ConnectionId,
        /// The service.
        service: Service,
        /// The frame.
        frame: &'a Bytes,
    },
}

/// Gets every message and call of the runtime, on the registry's thread. It must not block.
pub type Tap = Box<dyn FnMut(Tapped<'_>) + Send>;

/// Sets or removes the tap. While a tap is set, every topic of the runtime counts as subscribed. From the recorder.
#[derive(Message)]
#[rtype(result = "()")]
pub struct SetTap(pub Option<Tap>);

/// The registry rejects new calls, and the calls and goals that wait for clients, with this reason. From the runtime,
/// when it ends.
#[derive(Message)]
#[rtype(result = "()")]
pub struct RefuseCalls(pub &'static str);

/// Every connection sends its queue and ends. From the runtime, when it ends.
#[derive(Message)]
#[rtype(result = "()")]
pub struct FinishAll;

/// The registry's messages to a connection, in one order.
#[derive(Message, Clone)]
#[rtype(result = "()")]
pub enum ToClient {
    /// A topic message, or a [series](crate::protocol::wire::series) of them. It may be dropped, oldest first, when the
    /// client is slow.
    Deliver {
        /// The topic, for throttling. `None` for feedback of a goal.
        topic: Option<Arc<str>>,
        /// The message, shared by all subscribers of this form.
        frame: Bytes,
    },
    /// A response, a status, or a call forwarded to this client as a provider. It is never dropped.
    Respond {
        /// The whole frame.
        frame: Bytes,
        /// The service that responds, if it is the runtime's own.
        service: Option<Service>,
    },
    /// How a topic is throttled for this client.
    Configure {
        /// The topic.
        topic: Arc<str>,
        /// The smallest values of all subscriptions. `None` once it is not subscribed.
        throttle: Option<Throttle>,
    },
    /// Discard what a throttle holds back of a topic.
    Discard {
        /// The topic.
        topic: Arc<str>,
    },
    /// Send the queue, then end. The runtime is ending.
    Finish,
}
