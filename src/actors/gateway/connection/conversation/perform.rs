//! From a frame to its effect: what is cut off the stream becomes an op, which the registry performs.
//!
//! **Invariant:** every frame becomes one op or one complaint, and an op has taken effect when its frame is done with.

use bytes::Bytes;
use tokio::time::Instant;

use super::reader::Reader;
use crate::actors::gateway::limits::{FREE_DELIVERIES, READ_HERE};
use crate::actors::gateway::messages::{Request, Respond, form_of};
use crate::actors::gateway::turns;
use crate::actors::resources::aside::{Errand, aside};
use crate::actors::resources::awake::stay_awake;
use crate::actors::resources::budget::Share;
use crate::protocol::catalog::Service;
use crate::protocol::messages::{self, Level};
use crate::protocol::op::{
    self, CallService, Compression, GoalStatus, Incoming, Op, OpError, Subscribe,
};
use crate::protocol::wire::frame::{Cut, Foreign, FrameError, FrameReader, RawFrame, is_host_line};
use crate::protocol::wire::payload::Payload;

/// The error for a client that asks for binary frames over raw TCP.
const NO_BINARY: &str = "subscribe: compression cbor and cbor-raw need WebSocket; \
                         over raw TCP every frame is a line of JSON";
const NESTED_FRAGMENT: &str = "fragment: the pieces make a fragment again";
const UNREADABLE: &str = "a frame could not be read";

impl Reader {
    /// Performs what has been cut off the stream, to its end.
    pub(super) async fn take(&mut self, cut: Cut) {
        let length = match &cut {
            Cut::Frame(frame) => frame.len(),
            Cut::Lines(lines) => lines.frames.len(),
            Cut::Error(_) => 0,
        };
        let mut share = self.share_for(length);
        let frame = match cut {
            Cut::Frame(frame) => frame,
            Cut::Lines(lines) => {
                self.speaks_json = true;
                self.shared.outgoing.set_singly(false);
                return self.perform(None, Op::PublishLines(lines), share).await;
            }
            Cut::Error(FrameError::NotAnObject(start))
                if !self.speaks_json && !self.takes_binary() && is_host_line(&start) =>
            {
                return self.refuse(Foreign::Http.explanation());
            }
            Cut::Error(error) => return self.complain(&error.to_string(), None).await,
        };
        self.speaks_json = true;
        self.shared.outgoing.set_singly(!frame.newline());
        let incoming = match self.read_frame(length, move || read(frame)).await {
            Some(Ok(incoming)) => incoming,
            Some(Err(error)) => return self.complain(&error.to_string(), None).await,
            None => return,
        };
        let Some(incoming) = self.assemble(incoming, &mut share).await else {
            return;
        };
        share.resize(incoming.allocated());
        let Incoming { id, op } = incoming;
        match op {
            Ok(Op::Subscribe(Subscribe { encoding, .. }))
                if encoding.compression != Compression::None && !self.takes_binary() =>
            {
                self.complain(NO_BINARY, id.as_ref()).await;
            }
            Ok(op) => self.perform(id, op, share).await,
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

    /// Takes room for a frame of so many bytes that is being read: its text, and what has been read of it already.
    fn share_for(&self, length: usize) -> Share {
        self.shared.account.take(2 * length)
    }

    /// Returns `incoming` unless it is a fragment. For a fragment, returns the whole frame once the last piece is
    /// there; `share` is then that frame's.
    async fn assemble(&mut self, incoming: Incoming, share: &mut Share) -> Option<Incoming> {
        let Ok(Op::Fragment(piece)) = incoming.op else {
            return Some(incoming);
        };
        let id = incoming.id;
        let whole = match self.fragments.take(piece, Instant::now().into_std()) {
            Ok(whole) => whole?,
            Err(why) => {
                self.complain(&why.to_string(), id.as_ref()).await;
                return None;
            }
        };
        let length = whole.bytes();
        *share = self.share_for(length);
        let why = match self
            .read_frame(length, move || read_whole(&whole.text()))
            .await??
        {
            Ok(Incoming {
                op: Ok(Op::Fragment(_)),
                ..
            }) => NESTED_FRAGMENT.to_owned(),
            Ok(whole) => return Some(whole),
            Err(why) => why.to_string(),
        };
        self.complain(&why, id.as_ref()).await;
        None
    }

    /// Reads a frame of `length` bytes: a long one on another thread, while the other clients are served. `None` if
    /// that failed; then the client has been refused.
    async fn read_frame<T: Send + 'static>(
        &self,
        length: usize,
        read: impl FnOnce() -> T + Send + 'static,
    ) -> Option<T> {
        if length <= READ_HERE {
            return Some(read());
        }
        let read = aside(Errand::reading(length), read).await;
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
            frame: frame.into(),
            service: None,
            status,
            done: None,
        };
        let _ = self.shared.registry.send(respond).await;
    }

    /// Has the registry perform an op; its share is kept until it has taken effect.
    async fn perform(&self, id: Option<Payload>, op: Op, share: Share) {
        let is_computation = matches!(&op, Op::CallService(CallService { service, .. })
            if Service::from_name(service).is_some_and(Service::is_computation));
        let from = self.id;
        let request = Request { from, id, op };
        if is_computation {
            return self.shared.enqueue_computation(request, share);
        }
        if let Ok(handled) = self.shared.registry.send(request).await {
            if handled.is_with_a_node() {
                stay_awake();
            }
            let deliveries = handled.deliveries();
            handled.effect().await;
            if deliveries > FREE_DELIVERIES {
                turns::read_after(deliveries).await;
            }
        }
        drop(share);
    }
}

fn read(frame: RawFrame) -> Result<Incoming, FrameError> {
    frame.decode().map(|frame| op::read(&frame.text))
}

/// Reads a frame that came in pieces, under the same bounds and with the same leniency as any other. `None` if there is
/// nothing but white space. Nothing is done of a text with more than one frame.
fn read_whole(text: &str) -> Option<Result<Incoming, FrameError>> {
    let mut frames = FrameReader::new();
    frames.push(text.as_bytes());
    frames.push(b"\n");
    let frame = frames.next_raw()?;
    Some(match (frame, frames.next_raw()) {
        (Ok(_), Some(_)) => Err(FrameError::MoreBehind),
        (frame, _) => frame.and_then(read),
    })
}
