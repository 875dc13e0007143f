//! The tap of the recorder: every message and call in the registry.

use actix::prelude::*;
use bytes::Bytes;

use crate::actors::ConnectionId;
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::wire::json::Payload;

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
