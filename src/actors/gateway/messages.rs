//! The messages between connections, the registry and the nodes.
//!
//! **Invariant:** the registry has one mailbox, and so has each connection. Messages of one sender take effect in the
//! order sent.

use std::net::IpAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use actix::prelude::*;
use bytes::Bytes;
use tokio::sync::oneshot;

use crate::actors::ConnectionId;
use crate::actors::node::Done;
pub use crate::actors::node::{Feedback, Publish, Respond};
use crate::actors::resources::memory::Permit;
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::messages::ErrorForm;
use crate::protocol::op::Op;
use crate::protocol::outbox::Throttle;
use crate::protocol::ros::rosapi::Census;
use crate::protocol::wire::json::Payload;

/// A new client. From its connection; the answer is its id.
#[derive(Message)]
#[rtype(result = "Result<ConnectionId, Refused>")]
pub struct Connect {
    /// The ways to its connection.
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

/// The way to a connection, and what it shares with the registry.
#[derive(Clone)]
pub struct Outlets {
    /// Its mailbox.
    pub mailbox: Recipient<ToClient>,
    /// Set while a failed call has its reason in `values` too.
    pub wants_text: Arc<AtomicBool>,
    /// Set when the client is gone: heavy computations for it stop.
    pub gone: Arc<AtomicBool>,
    /// Bytes of responses that wait to be written; kept by the connection.
    pub backlog: Arc<AtomicUsize>,
}

impl Outlets {
    /// The form in which the client gets the reason of a failed call.
    #[must_use]
    pub fn error_form(&self) -> ErrorForm {
        form_of(&self.wants_text)
    }
}

/// The form of errors that a connection's flag stands for.
pub(super) fn form_of(wants_text: &AtomicBool) -> ErrorForm {
    if wants_text.load(Ordering::Relaxed) {
        ErrorForm::Text
    } else {
        ErrorForm::Object
    }
}

/// Why a client was not taken.
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
    pub id: Option<Payload>,
    /// Its request.
    pub op: Op,
    /// The room that the frame takes, if it is long: its later forms take the same.
    pub permit: Option<Permit>,
}

/// The op has been routed. Its effect may be still to come, in a node or at the subscribers' sockets: the receiver ends
/// when it has.
#[derive(MessageResponse, Default)]
pub struct Handled {
    effect: Option<oneshot::Receiver<()>>,
}

impl Handled {
    /// Nothing is still to come.
    #[must_use]
    pub fn at_once() -> Self {
        Self::default()
    }

    /// The op has gone to a node or a client that serves it, or a message to its subscribers.
    #[must_use]
    pub fn with(effect: oneshot::Receiver<()>) -> Self {
        Self {
            effect: Some(effect),
        }
    }

    /// Waits until the op has taken effect.
    pub async fn effect(self) {
        if let Some(effect) = self.effect {
            // The sender is dropped, never used: its end is the news.
            let _ = effect.await;
        }
    }
}

/// Asks for the topics and services that clients have. From `rosapi`.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "Census")]
pub struct TakeCensus;

/// Something that passes the registry, as the tap gets it.
pub enum Tapped<'a> {
    /// A message of the runtime, as the whole `publish` frame.
    Published(Topic, &'a Bytes),
    /// A client's message on a topic that the runtime listens to.
    NodeMessage(Topic, &'a Payload),
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
    /// The answer to such a call, as the whole frame.
    Answered {
        /// The client.
        to: ConnectionId,
        /// The service.
        service: Service,
        /// The frame.
        frame: &'a Bytes,
    },
}

/// Gets a copy of all that passes the registry, on the registry's thread, and may not wait.
pub type Tap = Box<dyn FnMut(Tapped<'_>) + Send>;

/// Sets the tap, or takes it away. While there is one, every topic of the runtime counts as subscribed to. From the
/// recorder.
#[derive(Message)]
#[rtype(result = "()")]
pub struct SetTap(pub Option<Tap>);

/// The registry takes no call any more, and refuses those calls and goals that wait for clients, for the reason given.
/// From the runtime, when it ends.
#[derive(Message)]
#[rtype(result = "()")]
pub struct RefuseCalls(pub &'static str);

/// Every connection sends its queue and ends. From the runtime, when it ends.
#[derive(Message)]
#[rtype(result = "()")]
pub struct FinishAll;

// ---- from the registry to a connection ------------------------------------------------------------------------------

/// All that the registry sends a connection, in one order.
#[derive(Message, Clone)]
#[rtype(result = "()")]
pub enum ToClient {
    /// A topic message, or a [series](crate::protocol::wire::series) of them. It may be dropped, oldest first, when the
    /// client is slow.
    Deliver {
        /// The topic, for throttling; none for feedback of a goal.
        topic: Option<Arc<str>>,
        /// The message, shared by all subscribers of this form.
        frame: Bytes,
        /// Dropped once the message has been offered to the client's socket, if its publisher waits for that.
        done: Option<Done>,
    },
    /// A response, a status, or a call forwarded to this client as a provider. It is never dropped.
    Respond {
        /// The whole frame.
        frame: Bytes,
        /// The service that it answers, if it is the runtime's own.
        service: Option<Service>,
    },
    /// How a topic is throttled for this client.
    Configure {
        /// The topic.
        topic: Arc<str>,
        /// The smallest of the subscriptions' values; `None` once it is not subscribed.
        throttle: Option<Throttle>,
    },
    /// Send the queue, then end. The runtime is ending.
    Finish,
}
