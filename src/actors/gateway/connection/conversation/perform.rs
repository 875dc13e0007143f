//! From a frame to its effect: a piece cut off the stream becomes an op, which the registry performs.
//!
//! **Invariant:** every frame becomes one op or one complaint, and an op has taken effect when its frame is done with.

use bytes::Bytes;
use tokio::time::Instant;

use super::reader::Reader;
use crate::actors::gateway::connection::transport::Inbound;
use crate::actors::gateway::messages::{Request, Respond, form_of};
use crate::actors::resources::aside::{WorkKind, aside};
use crate::actors::resources::awake::stay_awake;
use crate::actors::resources::memory::{SHORT, cover};
use crate::protocol::catalog::Service;
use crate::protocol::limits::MEDIUM;
use crate::protocol::messages::{self, Level};
use crate::protocol::op::{
    self, CallService, Compression, GoalStatus, Incoming, Op, OpError, Problem, Subscribe,
};
use crate::protocol::wire::frame::{
    Foreign, FrameError, FramePart, FrameReader, RawFrame, is_host_line,
};
use crate::protocol::wire::payload::Payload;

/// The error for a client that asks for binary frames over raw TCP.
const NO_BINARY: &str = "subscribe: compression cbor and cbor-raw need WebSocket; \
                         over raw TCP every frame is a line of JSON";
const NESTED_FRAGMENT: &str = "fragment: the pieces make a fragment again";
const UNREADABLE: &str = "a frame could not be read";

impl Reader {
    /// Performs what has been cut off the stream, to its end.
    pub(super) async fn take<I: Inbound>(&mut self, cut: FramePart, input: &mut I) {
        let frame = match cut {
            FramePart::Frame(frame) => frame,
            FramePart::Lines(lines) => {
                self.speaks_json = true;
                self.shared.outgoing.set_singly(false);
                return self.perform(None, Op::PublishLines(lines), 0).await;
            }
            FramePart::Error(FrameError::NotAnObject(start), _)
                if !self.speaks_json && !self.takes_binary() && is_host_line(&start) =>
            {
                return self.refuse(Foreign::Http.explanation());
            }
            FramePart::Error(error, start) => {
                return self.act_on(op::read_start(&start, &error), 0).await;
            }
        };
        self.speaks_json = true;
        self.shared.outgoing.set_singly(!frame.newline());
        let length = frame.len();
        if length > MEDIUM {
            self.performed = Some(self.permit(input).await);
        }
        let Some(incoming) = self.read_frame(length, move || read(frame)).await else {
            return;
        };
        let is_published = matches!(incoming.op, Ok(Op::Publish { .. } | Op::Fragment(_)));
        if length > SHORT && !is_published && self.performed.is_none() {
            self.performed = Some(self.permit(input).await);
        }
        if let Some((incoming, length)) = self.assemble(incoming, length, input).await {
            self.act_on(incoming, length).await;
        }
    }

    /// Acts on a frame that was read.
    async fn act_on(&self, incoming: Incoming, length: usize) {
        let Incoming { id, op } = incoming;
        match op {
            Ok(Op::Subscribe(Subscribe { encoding, .. }))
                if encoding.compression != Compression::None && !self.takes_binary() =>
            {
                self.complain(NO_BINARY, id.as_ref()).await;
            }
            Ok(op) => self.perform(id, op, length).await,
            Err(OpError::Call { service, problem }) => {
                let why = problem.to_string();
                let form = form_of(&self.shared.wants_text);
                self.say(messages::failure(&service, id.as_ref(), &why, form), None)
                    .await;
            }
            Err(OpError::Goal { action, problem }) => {
                let (id, why, status) = (id.as_ref(), problem.to_string(), GoalStatus::Unknown);
                // Over WebSocket only a client that has asked for statuses is sent any.
                self.complain(&why, id).await;
                let result = messages::action_result(&action, id, &why, status as u8, false);
                self.say(result, None).await;
            }
            Err(OpError::Status(problem)) => {
                self.complain(&problem.to_string(), id.as_ref()).await;
            }
        }
    }

    /// Returns `incoming` unless it is a fragment. For a fragment, returns the whole frame once the last piece is
    /// there. With it comes the length of the frame.
    async fn assemble<I: Inbound>(
        &mut self,
        incoming: Incoming,
        length: usize,
        input: &mut I,
    ) -> Option<(Incoming, usize)> {
        let Ok(Op::Fragment(piece)) = incoming.op else {
            return Some((incoming, length));
        };
        let id = incoming.id;
        if self.pieces.is_none() && self.fragments.allocated() + length > SHORT {
            let permit = self.performed.take();
            self.pieces = Some(match permit {
                Some(permit) => permit,
                None => self.permit(input).await,
            });
        }
        let whole = match self.fragments.take(piece, Instant::now().into_std()) {
            Ok(whole) => whole?,
            Err(why) => {
                let refused = op::read_start(&self.fragments.take_refused(), &why);
                return Some((under_id(refused, id), 0));
            }
        };
        let length = whole.bytes();
        if self.fragments.allocated() == 0 {
            self.performed = self.pieces.take();
        } else {
            self.performed.clone_from(&self.pieces);
        }
        let whole = self
            .read_frame(length, move || read_whole(&whole.text()))
            .await??;
        let whole = match whole.op {
            Ok(Op::Fragment(_)) => Incoming {
                id,
                op: Err(OpError::Status(Problem::NotAFrame(
                    NESTED_FRAGMENT.to_owned(),
                ))),
            },
            Err(OpError::Status(Problem::NotAFrame(_))) => under_id(whole, id),
            _ => whole,
        };
        Some((whole, length))
    }

    /// Reads a frame of `length` bytes: a long one on another thread, while the other clients are served. `None` if
    /// that failed; then the client has been refused.
    async fn read_frame<T: Send + 'static>(
        &self,
        length: usize,
        read: impl FnOnce() -> T + Send + 'static,
    ) -> Option<T> {
        if length <= SHORT {
            return Some(read());
        }
        let read = aside(WorkKind::reading(length), read).await;
        if read.is_none() {
            self.refuse(UNREADABLE);
        }
        read
    }

    /// Refuses the client: it has not done what it has to, or speaks another protocol.
    pub(super) fn refuse(&self, why: &str) {
        self.shared
            .refuse(messages::status(Level::Error, why, None));
    }

    /// Sends the client an error status.
    pub(super) async fn complain(&self, why: &str, id: Option<&Payload>) {
        tracing::debug!(connection = self.id.0, why, "refused");
        self.say(messages::status(Level::Error, why, id), Some(Level::Error))
            .await;
    }

    /// Sends a frame to the client by way of the registry: a response to an earlier frame may still be in its mailbox,
    /// and must not be overtaken.
    async fn say(&self, frame: Bytes, status: Option<Level>) {
        let respond = Respond {
            connection: self.id,
            frame: cover(self.performed.as_ref(), frame).into(),
            service: None,
            status,
            done: None,
        };
        let _ = self.shared.registry.send(respond).await;
    }

    /// Has the registry perform an op, which came in a frame of that length.
    async fn perform(&self, id: Option<Payload>, op: Op, length: usize) {
        let is_computation = matches!(&op, Op::CallService(CallService { service, .. })
            if Service::from_name(service).is_some_and(Service::is_computation));
        let from = self.id;
        let permit = self.performed.clone();
        let request = Request {
            from,
            id,
            op,
            permit,
        };
        if is_computation {
            return self.shared.enqueue_computation(request, length);
        }
        if let Ok(handled) = self.shared.registry.send(request).await {
            if handled.is_with_a_node() {
                stay_awake();
            }
            handled.effect().await;
        }
    }
}

/// An error that is told under the id of the pieces, unless it ends a call.
fn under_id(incoming: Incoming, id: Option<Payload>) -> Incoming {
    match incoming.op {
        Err(_) => Incoming { id, ..incoming },
        Ok(_) => incoming,
    }
}

fn read(frame: RawFrame) -> Incoming {
    match frame.decode() {
        Ok(frame) => op::read(&frame.text),
        Err((error, start)) => op::read_start(&start, &error),
    }
}

/// Reads a frame that came in pieces, under the same bounds and with the same leniency as any other. `None` if there is
/// nothing but white space. Nothing is done of a text with more than one frame.
fn read_whole(text: &str) -> Option<Incoming> {
    let mut frames = FrameReader::new();
    frames.push(text.as_bytes());
    frames.push(b"\n");
    Some(match (frames.next_raw()?, frames.next_raw()) {
        (Ok(_), Some(_)) => op::read_start(text.as_bytes(), &FrameError::MoreBehind),
        (Ok(frame), None) => read(frame),
        (Err(error), _) => op::read_start(text.as_bytes(), &error),
    })
}
