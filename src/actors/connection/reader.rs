//! The reading task of a connection: frames as they come, one op at a time.
//!
//! **Invariant:** the next frame is looked at only when the last op has taken effect (pure computations excepted), so
//! all that a client asks of the runtime happens in the order in which it asked.

use std::rc::Rc;
use std::time::Duration;

use actix::prelude::*;
use bytes::{Bytes, BytesMut};
use serde_json::value::RawValue;
use tokio::time::{Instant, timeout, timeout_at};

use super::gate::{HEAD_TIME, MAX_LOCKED};
use super::transport::{CHUNK, Inbound};
use super::{ANSWERS_OWED, Finish, Shared};
use crate::actors::ConnectionId;
use crate::actors::awake::stay_awake;
use crate::actors::registry::{Disconnect, Handled, Registry, Request, Respond, Retire};
use crate::protocol::catalog::Service;
use crate::protocol::fragments::Fragments;
use crate::protocol::frame::{Frame, FrameError, FrameReader};
use crate::protocol::messages::{self, Level};
use crate::protocol::op::{self, CallService, Compression, Incoming, Op, OpError, Subscribe};
use crate::protocol::token::Token;

/// How long, and how many bytes, of a refused client's input are swallowed so that it can still read why: closing
/// a socket with unread input resets it.
const DISCARD_TIME: Duration = Duration::from_secs(1);
const DISCARD_BYTES: usize = 16 * 1024 * 1024;

/// What a client hears that asks for binary frames over raw TCP.
const NO_BINARY: &str = "subscribe: compression cbor and cbor-raw need WebSocket; over raw TCP every frame is a line of JSON";
const NESTED_FRAGMENT: &str = "fragment: the pieces make a fragment again";

/// The reading half of a connection.
pub(super) struct Reader {
    id: ConnectionId,
    shared: Rc<Shared>,
    registry: Addr<Registry>,
    finish: Recipient<Finish>,
    frames: FrameReader,
    /// Frames that come in pieces.
    fragments: Fragments,
    /// What the client has yet to show before anything is done for it.
    locked: Option<Token>,
}

/// Why a client that has to show a token is not let in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
enum LockedOut {
    #[error("this runtime asks for its token first: {{\"op\":\"auth\",\"token\":...}}")]
    NotShown,
    #[error("token: not this runtime's")]
    Wrong,
    #[error("this runtime asks for its token first, and waited for {} s", HEAD_TIME.as_secs())]
    TooLate,
    #[error("this runtime asks for its token first, in at most {MAX_LOCKED} bytes")]
    TooMuch,
}

impl Reader {
    pub(super) fn new(
        id: ConnectionId,
        shared: Rc<Shared>,
        registry: Addr<Registry>,
        finish: Recipient<Finish>,
        locked: Option<Token>,
    ) -> Self {
        Self {
            id,
            shared,
            registry,
            finish,
            frames: FrameReader::new(),
            fragments: Fragments::default(),
            locked,
        }
    }

    /// Reads until the client ends or is refused, then lets the connection finish; `first` has been read already.
    pub(super) async fn run<I: Inbound>(mut self, mut input: I, first: BytesMut) {
        match self.converse(&mut input, first).await {
            Ok(()) => self.settle().await,
            // A broken stream takes no answers.
            Err(_) => self.shared.abandon_computations(),
        }
        // Answers that are on their way arrive before the registry answers this, and so before the end.
        let _ = self.registry.send(Disconnect(self.id)).await;
        let _ = self.finish.send(Finish).await;
        if self.shared.refusing.get() {
            discard(input).await;
        }
    }

    /// Handles frames until the stream ends or the client is refused; an error if it broke.
    async fn converse<I: Inbound>(
        &mut self,
        input: &mut I,
        mut chunk: BytesMut,
    ) -> std::io::Result<()> {
        let patience = Instant::now() + HEAD_TIME;
        let mut received = 0;
        loop {
            let full = chunk.len() >= CHUNK / 2;
            received += chunk.len();
            self.frames.push(&chunk);
            chunk.clear();
            while let Some(frame) = self.next_frame().await {
                self.take(frame).await;
                if self.shared.refusing.get() {
                    return Ok(());
                }
            }
            if full {
                // A long frame comes in many chunks, all of them at hand: the other clients have a turn in between.
                tokio::task::yield_now().await;
            }
            if self.shared.finishing.get() {
                break;
            }
            let read = if self.locked.is_none() {
                input.read(&mut chunk).await?
            } else if received > MAX_LOCKED {
                self.refuse(LockedOut::TooMuch);
                return Ok(());
            } else if let Ok(read) = timeout_at(patience, input.read(&mut chunk)).await {
                read?
            } else {
                self.refuse(LockedOut::TooLate);
                return Ok(());
            };
            if read == 0 {
                break;
            }
        }
        if let Some(error) = self.frames.finish() {
            self.complain(&error.to_string(), None).await;
        }
        Ok(())
    }

    /// The client has stopped sending, and may still be reading: withdraws what it registered, since it can no longer
    /// answer or withdraw, and waits for the answers that it is owed.
    async fn settle(&self) {
        let answered = async {
            if let Ok(Handled(Some(calls))) = self.registry.send(Retire(self.id)).await {
                let _ = calls.await;
            }
            while self.shared.is_computing() {
                self.shared.room.notified().await;
            }
        };
        if timeout(ANSWERS_OWED, answered).await.is_err() {
            self.shared.abandon_computations();
        }
    }

    /// The next complete frame, once the client may be read.
    async fn next_frame(&mut self) -> Option<Result<Frame, FrameError>> {
        while !self.shared.may_read() && !self.shared.finishing.get() {
            self.shared.room.notified().await;
        }
        self.frames.next()
    }

    /// Performs one frame, to its end.
    async fn take(&mut self, frame: Result<Frame, FrameError>) {
        if let Some(token) = &self.locked {
            match admit(token, frame.as_ref()) {
                Ok(()) => self.locked = None,
                Err(why) => self.refuse(why),
            }
            return;
        }
        let frame = match frame {
            Ok(frame) => frame,
            Err(error) => return self.complain(&error.to_string(), None).await,
        };
        self.shared.unbatched.set(!frame.newline);
        let Some(Incoming { id, op }) = self.assemble(op::read(&frame.text)).await else {
            return;
        };
        match op {
            Ok(Op::Subscribe(Subscribe { encoding, .. }))
                if encoding.compression != Compression::None && !self.shared.binary.get() =>
            {
                self.complain(NO_BINARY, id.as_deref()).await;
            }
            Ok(op) => {
                self.perform(Request {
                    from: self.id,
                    id,
                    op,
                })
                .await;
            }
            Err(OpError::Call { service, problem }) => {
                let why = problem.to_string();
                self.say(messages::failure(&service, id.as_deref(), &why), None)
                    .await;
            }
            Err(OpError::Status(problem)) => {
                self.complain(&problem.to_string(), id.as_deref()).await;
            }
        }
    }

    /// Whatever is no fragment, as it is; of fragments, the frame that they make once all are there.
    async fn assemble(&mut self, incoming: Incoming) -> Option<Incoming> {
        let Ok(Op::Fragment(piece)) = incoming.op else {
            return Some(incoming);
        };
        let id = incoming.id;
        let whole = match self.fragments.take(piece, Instant::now().into_std()) {
            Ok(whole) => whole?,
            Err(why) => {
                self.complain(&why.to_string(), id.as_deref()).await;
                return None;
            }
        };
        // A frame like any other: the same bounds hold, and the same leniency.
        let mut frames = FrameReader::new();
        frames.push(whole.as_bytes());
        frames.push(b"\n");
        let why = match frames.next() {
            Some(Ok(frame)) => match op::read(&frame.text) {
                Incoming {
                    op: Ok(Op::Fragment(_)),
                    ..
                } => NESTED_FRAGMENT.to_owned(),
                whole => return Some(whole),
            },
            Some(Err(why)) => why.to_string(),
            None => return None,
        };
        self.complain(&why, id.as_deref()).await;
        None
    }

    /// The client has not shown what it has to: it is told so, and nothing that it sends is looked at any more.
    fn refuse(&self, why: LockedOut) {
        self.shared.refusing.set(true);
        let why = why.to_string();
        self.shared.send(messages::status(Level::Error, &why, None));
    }

    async fn complain(&self, why: &str, id: Option<&RawValue>) {
        self.say(messages::status(Level::Error, why, id), Some(Level::Error))
            .await;
    }

    /// Sends a frame to the client by way of the registry: an answer to an earlier frame may still be in its mailbox,
    /// and must not be overtaken.
    async fn say(&self, frame: Bytes, status: Option<Level>) {
        let respond = Respond {
            connection: self.id,
            frame,
            service: None,
            status,
            done: None,
        };
        let _ = self.registry.send(respond).await;
    }

    async fn perform(&self, request: Request) {
        if let Op::CallService(CallService { service, .. }) = &request.op
            && Service::from_name(service).is_some_and(Service::is_computation)
        {
            self.shared.enqueue_computation(request, &self.registry);
            return;
        }
        if let Ok(handled) = self.registry.send(request).await
            && let Some(effect) = handled.0
        {
            stay_awake();
            // The sender is dropped, never used: its end is the news.
            let _ = effect.await;
        }
    }
}

/// Whether a client's first frame lets it in.
fn admit(token: &Token, frame: Result<&Frame, &FrameError>) -> Result<(), LockedOut> {
    let Ok(frame) = frame else {
        return Err(LockedOut::NotShown);
    };
    match op::read(&frame.text).op {
        Ok(Op::Auth { token: shown }) if token.matches(&shown) => Ok(()),
        Ok(Op::Auth { .. }) => Err(LockedOut::Wrong),
        _ => Err(LockedOut::NotShown),
    }
}

/// Swallows a refused client's input for a bounded time.
pub(super) async fn discard<I: Inbound>(mut input: I) {
    let mut chunk = BytesMut::new();
    let swallow = async {
        let mut swallowed = 0;
        while swallowed < DISCARD_BYTES {
            chunk.clear();
            match input.swallow(&mut chunk).await {
                Ok(0) | Err(_) => break,
                Ok(read) => swallowed += read,
            }
        }
    };
    let _ = timeout(DISCARD_TIME, swallow).await;
}
