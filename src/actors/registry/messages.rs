//! What the registry is told, and by whom.
//!
//! **Invariant:** one mailbox takes them all, so what one sender tells it happens in the order told.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize};

use actix::prelude::*;
use bytes::Bytes;
use serde_json::value::RawValue;
use tokio::sync::oneshot;

use super::Nodes;
use crate::actors::ConnectionId;
use crate::actors::connection::{Answer, Configure, Deliver, Finish};
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::messages::Level;
use crate::protocol::op::Op;
use crate::protocol::rosapi::Census;
use crate::protocol::series::Series;

/// The runtime's nodes. From the runtime, once, before any client is accepted.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Attach(pub Nodes);

/// A new client. From its connection; the answer is its id.
#[derive(Message)]
#[rtype(result = "Result<ConnectionId, Refused>")]
pub struct Connect(pub Outlets);

/// The ways to a connection; one mailbox behind all of them, so order is kept between them.
#[derive(Clone)]
pub struct Outlets {
    /// Topic messages.
    pub deliver: Recipient<Deliver>,
    /// Responses and statuses.
    pub answer: Recipient<Answer>,
    /// Throttling of topics.
    pub configure: Recipient<Configure>,
    /// The end.
    pub finish: Recipient<Finish>,
    /// Set when the client is gone: heavy computations for it stop.
    pub gone: Arc<AtomicBool>,
    /// Bytes of responses that wait to be written; kept by the connection.
    pub backlog: Arc<AtomicUsize>,
}

/// Why a client was not taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// The limit is reached, which this is.
    #[error("too many connections: this runtime serves {0} clients at once")]
    Full(usize),
    /// The runtime is ending.
    #[error("shutting down")]
    Closed,
}

/// The client has stopped sending: all that it registered is withdrawn. From its connection; the receiver, if there is
/// one, ends when the calls that it made have been answered.
#[derive(Message)]
#[rtype(result = "Handled")]
pub struct Retire(pub ConnectionId);

/// The client is gone: all that it registered is withdrawn. From its connection; repeating is harmless.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Disconnect(pub ConnectionId);

/// One op of a client. From its connection, which waits for [`Handled`] before it reads on.
#[derive(Message)]
#[rtype(result = "Handled")]
pub struct Request {
    /// The client.
    pub from: ConnectionId,
    /// The frame's `id`, if it had one.
    pub id: Option<Box<RawValue>>,
    /// What it asks.
    pub op: Op,
}

/// Messages of a client on a topic of clients, one behind the other. From its connection, which waits until they are on their way.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Relay {
    /// The client.
    pub from: ConnectionId,
    /// Topic and frames.
    pub series: Series,
}

/// The op has been routed; if it went to a node, the receiver ends when it has taken effect there.
#[derive(MessageResponse)]
pub struct Handled(pub Option<oneshot::Receiver<()>>);

/// A message on a topic. From the node that owns it.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Publish {
    /// The topic.
    pub topic: Topic,
    /// The whole `publish` frame, encoded once.
    pub frame: Bytes,
    /// The message alone, for the runtime's own listener, on topics that it also subscribes to.
    pub msg: Option<Box<RawValue>>,
}

/// A frame for one client: an answer or a status. From a node.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Respond {
    /// The client.
    pub connection: ConnectionId,
    /// The whole frame.
    pub frame: Bytes,
    /// The service that it answers, if it is the runtime's own.
    pub service: Option<Service>,
    /// The level, if it is a status: sent only if the client wants such.
    pub status: Option<Level>,
    /// Dropped once the frame is on its way, where that is also the end of the call.
    pub done: Option<oneshot::Sender<()>>,
}

/// Progress of a goal, for the client that sent it; may be dropped when that is slow. From the node that pursues the goal.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Progress {
    /// The client.
    pub connection: ConnectionId,
    /// The action, as the client spells it.
    pub action: Arc<str>,
    /// The whole frame.
    pub frame: Bytes,
}

/// Which topics and services clients have. From `rosapi`.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "Census")]
pub struct TakeCensus;

/// No call is taken any more and waiting calls are refused, for the reason given. From the runtime, when it ends.
#[derive(Message)]
#[rtype(result = "()")]
pub struct RefuseCalls(pub &'static str);

/// Every connection sends what it has and ends. From the runtime, when it ends.
#[derive(Message)]
#[rtype(result = "()")]
pub struct FinishAll;

/// A forwarded call has waited as long as its caller allowed. From the registry's own timers.
#[derive(Message)]
#[rtype(result = "()")]
pub(super) struct TimedOut(pub(super) u64);
