//! The messages to the registry, and those from it to a connection.
//!
//! **Invariant:** a message is a plain value, independent of the actor that handles it.

use std::net::IpAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize};

use actix::prelude::*;
use bytes::Bytes;
use tokio::sync::oneshot;

use crate::actors::ConnectionId;
use crate::actors::node::Nodes;
use crate::actors::resources::memory::Permit;
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::op::Incoming;
use crate::protocol::outbox::Throttle;
use crate::protocol::ros::rosapi::Census;
use crate::protocol::wire::json::Payload;

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
    /// Set when the client has disconnected. Heavy computations for it stop.
    pub gone: Arc<AtomicBool>,
    /// Bytes of responses that wait to be written. The connection updates the number.
    pub backlog: Arc<AtomicUsize>,
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

/// The client has disconnected. The registry withdraws its registrations. From its connection. Idempotent.
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
pub struct Handled {
    effect: Option<oneshot::Receiver<()>>,
    /// Messages sent to subscribers.
    deliveries: usize,
}

impl Handled {
    /// The op has already taken effect.
    #[must_use]
    pub fn at_once() -> Self {
        Self::default()
    }

    /// The op was sent to its provider, or the message to its subscribers.
    #[must_use]
    pub fn with(effect: oneshot::Receiver<()>) -> Self {
        Self {
            effect: Some(effect),
            deliveries: 0,
        }
    }

    /// The message was also sent to this many subscribers.
    #[must_use]
    pub fn delivered(self, deliveries: usize) -> Self {
        Self { deliveries, ..self }
    }

    /// Waits until the op has taken effect. Returns how many messages were sent to subscribers.
    pub async fn effect(self) -> usize {
        if let Some(effect) = self.effect {
            // The sender never sends: dropping it is the signal.
            let _ = effect.await;
        }
        self.deliveries
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
    /// Send the queue, then end. The runtime is ending.
    Finish,
}
