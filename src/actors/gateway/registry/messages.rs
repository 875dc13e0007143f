//! Messages between the registry and the connections.
//!
//! **Invariant:** a client has a place from [`Connect`] to [`Disconnect`].

use std::net::IpAddr;
use std::sync::Arc;
use std::sync::atomic::AtomicUsize;

use actix::prelude::*;
use bytes::Bytes;
use tokio::time::Instant;

use crate::actors::ConnectionId;
use crate::actors::node::Completion;
use crate::actors::resources::gone::Gone;
use crate::actors::resources::memory::Permit;
use crate::actors::resources::places::Refused;
use crate::protocol::catalog::Service;
use crate::protocol::op::Incoming;
use crate::protocol::outbox::Throttle;

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

// ---- to the registry ------------------------------------------------------------------------------------------------

/// A new client. From its connection. Returns its place.
#[derive(Message)]
#[rtype(result = "Result<HeldPlace, Refused>")]
pub struct Connect {
    /// The handles to its connection.
    pub outlets: Outlets,
    /// Its address.
    pub from: IpAddr,
    /// Whether it may use a kept place.
    pub may_use_kept: bool,
}

/// The place of a registered client. Dropping it frees the place, even if the answer to [`Connect`] is lost.
pub struct HeldPlace {
    /// The client's id.
    pub id: ConnectionId,
    pub(super) registry: Recipient<Disconnect>,
}

impl Drop for HeldPlace {
    fn drop(&mut self) {
        self.registry.do_send(Disconnect(self.id));
    }
}

/// A client was refused because no place was free. From its connection.
#[derive(Message)]
#[rtype(result = "()")]
pub struct CountRefusal;

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

/// The client has stopped sending. The registry withdraws its registrations. From its connection. The
/// answer completes when the client's calls have been answered.
#[derive(Message)]
#[rtype(result = "Completion")]
pub struct Retire(pub ConnectionId);

/// The client has disconnected, and its output is gone. The registry frees its place. From its connection. Idempotent.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Disconnect(pub ConnectionId);

// ---- to a connection ------------------------------------------------------------------------------------------------

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
