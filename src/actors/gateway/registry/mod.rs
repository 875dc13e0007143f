//! The registry has every client, topic and service. It fans messages out to subscribers, and routes calls.
//!
//! This file has its state, its messages and the path of an op. `clients.rs` has the clients that join and leave and the
//! frames to them, `topics.rs`, `calls.rs` and `goals.rs` the rosbridge ops, and `actors/graph/` the tables.
//!
//! **Invariant:** a message is encoded once for each spelling and form, and not at all without subscribers. A
//! refused op changes nothing. It gets an error status, or the call's one response. Messages of one sender take effect
//! in the order sent: the registry has one mailbox, and so has each connection.

mod calls;
mod clients;
mod goals;
mod topics;

use std::collections::{BTreeMap, HashMap, HashSet, VecDeque};
use std::net::IpAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize};

use actix::prelude::*;
use bytes::Bytes;
use tokio::time::Instant;

pub use self::clients::{Connect, CountRefusal, Disconnect, HeldPlace, Retire};
use crate::actors::ConnectionId;
use crate::actors::graph::forwarded::ForwardedRequests;
use crate::actors::graph::providers::Providers;
use crate::actors::graph::registrations::{EntrySum, Registrations};
use crate::actors::graph::subscribers;
use crate::actors::graph::topics::Topics;
pub use crate::actors::node::{Attach, FinishAll, Nodes, RefuseCalls, SetTap, Tapped};
use crate::actors::node::{ClientLink, Completion, Tap, Working};
use crate::actors::resources::gauges::Gauges;
use crate::actors::resources::gone::Gone;
use crate::actors::resources::memory::{Permit, Pool};
use crate::actors::resources::places::Places;
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::messages::ErrorForm;
use crate::protocol::op::{Incoming, Op, Verbosity};
use crate::protocol::outbox::Throttle;
use crate::protocol::wire::json::Payload;

// ---- state ----------------------------------------------------------------------------------------------------------

/// The registry actor.
#[derive(Default)]
pub struct Registry {
    clients: BTreeMap<ConnectionId, Client>,
    topics: Topics<Recipient<ToClient>>,
    providers: Providers,
    /// Calls and goals that wait for the clients that serve them.
    requests: ForwardedRequests,
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

/// A subscriber, with the mailbox of its connection.
type Subscriber = subscribers::Subscriber<Recipient<ToClient>>;

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
    /// The memory of long calls and answers of other clients that wait for it.
    long_backlog: Pool,
    /// Topics of the runtime's subscriptions that this client has explicitly unadvertised. Its messages there are
    /// dropped until it advertises again.
    withdrawn: HashSet<Topic>,
    /// The lowest level of statuses that it gets.
    verbosity: Verbosity,
    /// The form in which it gets the reason of a failed call.
    error_form: ErrorForm,
    /// Replaced when the client unsubscribes from the feedback of its goals, and dropped with the client.
    listening: Arc<()>,
    /// What its calls to other clients hold, and the completion of all of them. Removed when the client
    /// stops sending.
    calls: Option<(Working, Completion)>,
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

    /// Performs one op of a registered client.
    fn perform(&mut self, origin: FrameOrigin, op: Op, ctx: &mut Context<Self>) -> Completion {
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
        Completion::at_once()
    }
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl Actor for Registry {
    type Context = Context<Self>;

    fn started(&mut self, ctx: &mut Context<Self>) {
        Self::start_cleanup(ctx);
    }
}

impl Handler<Request> for Registry {
    type Result = Completion;

    fn handle(&mut self, request: Request, ctx: &mut Context<Self>) -> Completion {
        let Request { from, incoming, .. } = request;
        if !self.clients.contains_key(&from) {
            return Completion::at_once();
        }
        let Incoming { id, op } = incoming;
        let origin = FrameOrigin { from, id };
        self.permit = request.permit;
        let completion = match op {
            Ok(op) => self.perform(origin, op, ctx),
            Err(why) => {
                self.answer_error(&origin, &why);
                Completion::at_once()
            }
        };
        let permit = self.permit.take();
        if let Some(permit) = permit.filter(|_| completion.is_at_once()) {
            permit.trim();
        }
        completion
    }
}

// ---- messages -------------------------------------------------------------------------------------------------------

/// The handles to a connection, and the state that it shares with the registry.
#[derive(Clone)]
pub struct Outlets {
    /// Its mailbox.
    pub mailbox: Recipient<ToClient>,
    /// Bytes of short responses that were sent and are not written. The registry adds, and the connection subtracts.
    pub backlog: Arc<AtomicUsize>,
    /// Whether the client has left.
    pub gone: Gone,
}

/// One frame of a client. From its connection, which waits for [`Completion`] before it continues to read.
#[derive(Message)]
#[rtype(result = "Completion")]
pub struct Request {
    /// The client.
    pub from: ConnectionId,
    /// The op with the frame's `id`, or the frame's error.
    pub incoming: Incoming,
    /// The memory permit of a long frame. All forms made of the frame share it.
    pub permit: Option<Permit>,
}

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
        /// When it was delivered.
        at: Instant,
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
