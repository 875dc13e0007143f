//! From a frame to its effect: a piece cut off the stream becomes an op, which the registry performs.
//!
//! **Invariant:** every frame becomes one op or one complaint, and an op has taken effect when its frame is done with.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use actix::prelude::*;
use bytes::Bytes;
use tokio::time::Instant;

use crate::actors::ConnectionId;
use crate::actors::gateway::messages::{Request, Respond, form_of};
use crate::actors::gateway::registry::Registry;
use crate::actors::resources::aside::{WorkKind, aside};
use crate::actors::resources::awake::stay_awake;
use crate::actors::resources::memory::{Memory, Permit, SHORT, cover};
use crate::protocol::catalog::Service;
use crate::protocol::limits::MEDIUM;
use crate::protocol::messages::{self, Level};
use crate::protocol::op::{
    self, CallService, Compression, GoalStatus, Incoming, Op, OpError, Problem, Subscribe,
};
use crate::protocol::wire::fragments::Fragments;
use crate::protocol::wire::frame::{Foreign, FrameError, FramePart, RawFrame, is_host_line};
use crate::protocol::wire::payload::Payload;

/// The error for a client that asks for binary frames over raw TCP.
const NO_BINARY: &str = "subscribe: compression cbor and cbor-raw need WebSocket; \
                         over raw TCP every frame is a line of JSON";
const NESTED_FRAGMENT: &str = "fragment: the pieces make a fragment again";

/// What is left to do once a part of the stream has been performed.
pub(super) enum OpOutcome {
    /// Nothing.
    Done,
    /// The computation runs when its turn comes. It came in a frame of that length.
    Computation(Request, usize),
    /// The client is refused, and gets this status: it broke a rule, or speaks another protocol.
    Refused(Bytes),
}

/// Performs the ops of one client, one at a time. The future of an op owns it, and returns it at its end.
pub(super) struct Performer {
    id: ConnectionId,
    registry: Addr<Registry>,
    /// Where long frames find their room.
    memory: Memory,
    /// Set while a failed call has its reason in `values` too.
    wants_text: Arc<AtomicBool>,
    /// Whether frames may be binary: over raw TCP they are lines of text.
    takes_binary: bool,
    /// Frames that come in pieces.
    pub(super) fragments: Fragments,
    /// The room of the client's long frame: while it comes, while it is performed and its answers are written, and
    /// while pieces of one are kept.
    pub(super) permit: Option<Permit>,
    /// Whether a JSON object has come: then this is no HTTP request, whose head would have come first.
    speaks_json: bool,
}

impl Performer {
    pub(super) fn new(
        id: ConnectionId,
        registry: Addr<Registry>,
        memory: Memory,
        wants_text: Arc<AtomicBool>,
        takes_binary: bool,
    ) -> Self {
        Self {
            id,
            registry,
            memory,
            wants_text,
            takes_binary,
            fragments: Fragments::default(),
            permit: None,
            speaks_json: false,
        }
    }

    /// The room for a long frame, once there is some.
    pub(super) fn room(&self) -> impl Future<Output = Permit> + 'static {
        let memory = self.memory.clone();
        async move { memory.long_frame().await }
    }

    /// Waits for room. A client that has some does not: others might wait for that.
    async fn take_room(&mut self) {
        if self.permit.is_none() {
            self.permit = Some(self.room().await);
        }
    }

    /// The client may be read again: its room is given back, unless a long frame `is_coming` or pieces of one are
    /// kept.
    pub(super) fn give_back(&mut self, is_coming: bool) {
        if !is_coming && self.fragments.allocated() <= SHORT {
            self.permit = None;
        }
    }

    /// Performs one part of the stream.
    pub(super) async fn take(mut self, cut: FramePart) -> (Self, OpOutcome) {
        let outcome = self.perform_part(cut).await;
        (self, outcome)
    }

    /// Sends the client the error at the end of its stream.
    pub(super) async fn take_end(self, error: FrameError) -> (Self, OpOutcome) {
        let outcome = self.complain(&error.to_string(), None).await;
        (self, outcome)
    }

    async fn perform_part(&mut self, cut: FramePart) -> OpOutcome {
        match cut {
            FramePart::Frame(frame) => {
                let length = frame.len();
                self.perform_frame(length, move || Some(read(Ok(frame))))
                    .await
            }
            FramePart::Message(message) => {
                let length = message.len();
                self.perform_frame(length, move || read_message(&message))
                    .await
            }
            FramePart::Lines(lines) => {
                self.speaks_json = true;
                self.perform(None, Op::PublishLines(lines), 0).await
            }
            FramePart::Error(FrameError::NotAnObject(start), _)
                if !self.speaks_json && !self.takes_binary && is_host_line(&start) =>
            {
                OpOutcome::Refused(refusal(Foreign::Http.explanation()))
            }
            FramePart::Error(error, start) => self.act_on(op::read_start(&start, &error), 0).await,
        }
    }

    /// Reads a frame of `length` bytes and performs it.
    async fn perform_frame(
        &mut self,
        length: usize,
        read: impl FnOnce() -> Option<Incoming> + Send + 'static,
    ) -> OpOutcome {
        self.speaks_json = true;
        if length > MEDIUM {
            self.take_room().await;
        }
        let incoming = match read_frame(length, read).await {
            Ok(incoming) => incoming,
            Err(outcome) => return outcome,
        };
        let is_published = matches!(incoming.op, Ok(Op::Publish { .. } | Op::Fragment(_)));
        if length > SHORT && !is_published {
            self.take_room().await;
        }
        match self.assemble(incoming, length).await {
            Ok((incoming, length)) => self.act_on(incoming, length).await,
            Err(outcome) => outcome,
        }
    }

    /// Acts on a frame that was read.
    async fn act_on(&self, incoming: Incoming, length: usize) -> OpOutcome {
        let Incoming { id, op } = incoming;
        match op {
            Ok(Op::Subscribe(Subscribe { encoding, .. }))
                if encoding.compression != Compression::None && !self.takes_binary =>
            {
                self.complain(NO_BINARY, id.as_ref()).await
            }
            Ok(op) => self.perform(id, op, length).await,
            Err(OpError::Call { service, problem }) => {
                let why = problem.to_string();
                let form = form_of(&self.wants_text);
                self.say(messages::failure(&service, id.as_ref(), &why, form), None)
                    .await
            }
            Err(OpError::Goal { action, problem }) => {
                let (id, why, status) = (id.as_ref(), problem.to_string(), GoalStatus::Unknown);
                // Over WebSocket only a client that has asked for statuses is sent any.
                self.complain(&why, id).await;
                let result = messages::action_result(&action, id, &why, status as u8, false);
                self.say(result, None).await
            }
            Err(OpError::Status(problem)) => self.complain(&problem.to_string(), id.as_ref()).await,
        }
    }

    /// Returns `incoming` unless it is a fragment. For a fragment, returns the whole frame once the last piece is
    /// there. With it comes the length of the frame.
    async fn assemble(
        &mut self,
        incoming: Incoming,
        length: usize,
    ) -> Result<(Incoming, usize), OpOutcome> {
        let Ok(Op::Fragment(piece)) = incoming.op else {
            return Ok((incoming, length));
        };
        let id = incoming.id;
        if self.fragments.allocated() + length > SHORT {
            self.take_room().await;
        }
        let whole = match self.fragments.take(piece, Instant::now().into_std()) {
            Ok(whole) => whole.ok_or(OpOutcome::Done)?,
            Err((why, start)) => {
                return Ok((under_id(op::read_start(&start, &why), id), 0));
            }
        };
        let length = whole.bytes();
        let whole = read_frame(length, move || read_message(whole.text().as_bytes())).await?;
        let whole = match whole.op {
            Ok(Op::Fragment(_)) => Incoming {
                id,
                op: Err(Problem::NotAFrame(NESTED_FRAGMENT.to_owned()).into()),
            },
            Err(OpError::Status(Problem::NotAFrame(_))) => under_id(whole, id),
            _ => whole,
        };
        Ok((whole, length))
    }

    /// Sends the client an error status.
    async fn complain(&self, why: &str, id: Option<&Payload>) -> OpOutcome {
        tracing::debug!(connection = self.id.0, why, "refused");
        self.say(messages::status(Level::Error, why, id), Some(Level::Error))
            .await
    }

    /// Sends a frame to the client by way of the registry: a response to an earlier frame may still be in its mailbox,
    /// and must not be overtaken.
    async fn say(&self, frame: Bytes, status: Option<Level>) -> OpOutcome {
        let respond = Respond {
            connection: self.id,
            frame: cover(self.permit.as_ref(), frame).into(),
            service: None,
            status,
            done: None,
        };
        let _ = self.registry.send(respond).await;
        OpOutcome::Done
    }

    /// Has the registry perform an op, which came in a frame of that length.
    async fn perform(&self, id: Option<Payload>, op: Op, length: usize) -> OpOutcome {
        let is_computation = matches!(&op, Op::CallService(CallService { service, .. })
            if Service::from_name(service).is_some_and(Service::is_computation));
        let request = Request {
            from: self.id,
            id,
            op,
            permit: self.permit.clone(),
        };
        if is_computation {
            return OpOutcome::Computation(request, length);
        }
        if let Ok(handled) = self.registry.send(request).await {
            if handled.is_with_a_node() {
                stay_awake();
            }
            handled.effect().await;
        }
        OpOutcome::Done
    }
}

/// The status for a client that is refused for that reason.
pub(super) fn refusal(why: &str) -> Bytes {
    messages::status(Level::Error, why, None)
}

/// Reads a frame of `length` bytes: a long one on another thread, while the other clients are served.
async fn read_frame(
    length: usize,
    read: impl FnOnce() -> Option<Incoming> + Send + 'static,
) -> Result<Incoming, OpOutcome> {
    let incoming = if length <= SHORT {
        read()
    } else {
        let incoming = aside(WorkKind::of(length), read).await;
        incoming.ok_or_else(|| OpOutcome::Refused(refusal("a frame could not be read")))?
    };
    incoming.ok_or(OpOutcome::Done)
}

/// An error goes out under the id of the pieces, unless it ends a call.
fn under_id(incoming: Incoming, id: Option<Payload>) -> Incoming {
    match incoming.op {
        Err(_) => Incoming { id, ..incoming },
        Ok(_) => incoming,
    }
}

/// Reads a frame that was cut off, or says what is wrong with it.
fn read(frame: Result<RawFrame, (FrameError, Vec<u8>)>) -> Incoming {
    match frame.and_then(RawFrame::decode) {
        Ok(frame) => op::read(&frame.text),
        Err((error, start)) => op::read_start(&start, &error),
    }
}

/// Reads a message of a WebSocket, or a frame that came in pieces. `None` if there is nothing but white space.
fn read_message(message: &[u8]) -> Option<Incoming> {
    RawFrame::of_message(message).map(read)
}
