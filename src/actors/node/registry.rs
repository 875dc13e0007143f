//! Messages between the registry and the nodes: topics, their interest, frames for one client, and the tap of the recorder.

use actix::prelude::*;
use bytes::Bytes;
use serde::Serialize;

use super::completion::Working;
use crate::actors::ConnectionId;
use crate::actors::resources::gone::Gone;
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::messages::{self, Level};
use crate::protocol::ros::rosapi::Census;
use crate::protocol::wire::json::Payload;

/// Whether a topic of the node has subscribers. From the registry, at every change.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "()")]
pub struct Interest {
    /// The topic.
    pub topic: Topic,
    /// True while there is a subscriber.
    pub wanted: bool,
}

/// A message on a topic. From the node that owns it.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Publish {
    /// The topic.
    pub topic: Topic,
    /// Writes the whole `publish` frame. The registry calls it, so the arm's thread does not have to write.
    pub frame: Box<dyn FnOnce() -> Bytes + Send>,
}

impl Publish {
    /// The message of `make`, which the registry calls and encodes.
    #[must_use]
    pub fn made<M: Serialize>(topic: Topic, make: impl FnOnce() -> M + Send + 'static) -> Self {
        let frame = Box::new(move || messages::publish(topic.name(), &make()));
        Self { topic, frame }
    }
}

/// A frame for one client. From a node, or from the route to it if the arguments are rejected.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Respond {
    /// The client.
    pub connection: ConnectionId,
    /// The whole frame.
    pub frame: Bytes,
    /// Its kind.
    pub kind: FrameKind,
    /// Dropped once the frame is sent, if that is also the end of the call.
    pub working: Option<Working>,
}

/// The kinds of frames for one client.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameKind {
    /// The answer of one of the runtime's services.
    Answer(Service),
    /// The end of a goal, or the refusal of a call or goal that could not be read.
    End,
    /// A status. It is sent only to clients that selected this level.
    Status(Level),
    /// Feedback of a goal. It may be dropped for a slow client.
    Feedback,
}

/// A client, and the way back to it.
#[derive(Clone)]
pub struct ClientLink {
    /// The way back.
    pub registry: Recipient<Respond>,
    /// The connection.
    pub connection: ConnectionId,
    /// Set when the client has disconnected.
    pub gone: Gone,
}

impl ClientLink {
    /// Whether the client has disconnected.
    #[must_use]
    pub fn is_gone(&self) -> bool {
        self.gone.is_set()
    }

    /// Sends a status with the reason why the frame with this `id` has no effect, or none yet.
    pub fn status(&self, level: Level, why: &str, id: Option<&Payload>) {
        let frame = messages::status(level, why, id);
        self.send(FrameKind::Status(level), frame, None);
    }

    /// Sends a frame. `working` is dropped once it is sent.
    pub fn send(&self, kind: FrameKind, frame: Bytes, working: Option<Working>) {
        self.registry.do_send(Respond {
            connection: self.connection,
            frame,
            kind,
            working,
        });
    }
}

/// A barrier in the mailbox of an actor that informs clients of goals, which answers it after all earlier messages.
/// From the arm, before it reports that it is at rest and between steps on request, and from `ik_trial`.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "()")]
pub struct Barrier;

/// Requests the topics and services of the clients. From `rosapi`.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "Census")]
pub struct TakeCensus;

/// The registry rejects new calls, and the calls and goals that wait for clients, with this reason. From the runtime,
/// when it ends.
#[derive(Message)]
#[rtype(result = "()")]
pub struct RefuseCalls(pub &'static str);

/// Every connection sends its queue and ends. From the runtime, when it ends.
#[derive(Message)]
#[rtype(result = "()")]
pub struct FinishAll;

// ---- the tap --------------------------------------------------------------------------------------------------------

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
