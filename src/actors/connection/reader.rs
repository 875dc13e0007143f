//! The reading task of a connection: frames as they come, one op at a time.
//!
//! **Invariant:** the next frame is looked at only when the last op has taken effect (pure computations excepted), so
//! all that a client asks of the runtime happens in the order in which it asked. A series of messages counts as one op.

use std::rc::Rc;
use std::time::Duration;

use actix::prelude::*;
use bytes::{Bytes, BytesMut};
use serde_json::value::RawValue;
use tokio::time::{Instant, timeout, timeout_at};

use super::gate::{HEAD_TIME, MAX_LOCKED};
use super::transport::{CHUNK, Inbound};
use super::unfinished::Unfinished;
use super::{ANSWERS_OWED, Finish, LOOK_AGAIN, Shared, due};
use crate::actors::ConnectionId;
use crate::actors::awake::stay_awake;
use crate::actors::budget::{Claim, Share};
use crate::actors::registry::{Disconnect, Handled, Registry, Relay, Request, Respond, Retire};
use crate::protocol::catalog::Service;
use crate::protocol::fragments::{Fragments, MAX_AGE};
use crate::protocol::frame::{Foreign, Frame, FrameError, FrameReader, is_host_line};
use crate::protocol::messages::{self, Level};
use crate::protocol::op::{self, CallService, Compression, Incoming, Op, OpError, Subscribe};
use crate::protocol::series::Series;
use crate::protocol::token::Token;

/// How long, and how many bytes, of a refused client's input are swallowed so that it can still read why: closing
/// a socket with unread input resets it.
const DISCARD_TIME: Duration = Duration::from_secs(1);
const DISCARD_BYTES: usize = 16 * 1024 * 1024;

/// What a client hears that asks for binary frames over raw TCP.
const NO_BINARY: &str = "subscribe: compression cbor and cbor-raw need WebSocket; over raw TCP every frame is a line of JSON";
/// What a client hears whose frame takes longer than [`FRAME_TIME`](super::unfinished::FRAME_TIME).
const TOO_SLOW: &str = "a frame that has begun must be complete within a minute";
const NO_ROOM_FOR_FRAME: &str =
    "frame skipped: too many bytes of unfinished frames of all clients are kept; try again later";
const NO_ROOM_FOR_FRAGMENTS: &str = "fragment: too many bytes of unfinished frames of all clients are kept; this connection's pieces are forgotten, try again later";
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
    /// What is kept of frames and messages that are not complete yet.
    unfinished: Unfinished,
    /// What the client has yet to show before anything is done for it.
    locked: Option<Token>,
    /// An object has come: this is no HTTP request, whose body could be one, but not its head.
    speaks_json: bool,
}

/// What a stream goes on with.
enum Next {
    /// Messages on a topic of clients that can go out as they are: one op, as it were.
    Series(Series),
    /// Anything else.
    Frame(Result<Frame, FrameError>),
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
        let unfinished = Unfinished::new(&shared.gauges.totals().input);
        Self {
            id,
            shared,
            registry,
            finish,
            frames: FrameReader::new(),
            fragments: Fragments::default(),
            unfinished,
            locked,
            speaks_json: false,
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
            if chunk.capacity() > 4 * CHUNK {
                // A long message is no reason to keep as much for the next.
                chunk = BytesMut::new();
            }
            while let Some(next) = self.next().await {
                self.unfinished.begin_anew();
                match next {
                    Next::Series(series) => self.relay(series).await,
                    Next::Frame(frame) => self.take(frame).await,
                }
                if self.shared.refusing.get() {
                    return Ok(());
                }
            }
            self.keep_unfinished().await;
            if full {
                // A long frame comes in many chunks, all of them at hand: the other clients have a turn in between.
                tokio::task::yield_now().await;
            }
            if self.shared.finishing.get() {
                break;
            }
            let read = if self.locked.is_none() {
                self.read(input, &mut chunk)
                    .await?
                    .ok_or(TOO_SLOW.to_owned())
            } else if received > MAX_LOCKED {
                Err(LockedOut::TooMuch.to_string())
            } else if let Ok(read) = timeout_at(patience, input.read(&mut chunk)).await {
                Ok(read?)
            } else {
                Err(LockedOut::TooLate.to_string())
            };
            match read {
                Ok(0) => break,
                Ok(_) => {}
                Err(why) => {
                    self.refuse(&why);
                    return Ok(());
                }
            }
        }
        if let Some(error) = self.frames.finish() {
            self.complain(&error.to_string(), None).await;
        }
        Ok(())
    }

    /// Reads on; `None` if a frame that has begun takes too long. Meanwhile pieces of messages grow old, and are forgotten.
    async fn read<I: Inbound>(
        &mut self,
        input: &mut I,
        chunk: &mut BytesMut,
    ) -> std::io::Result<Option<usize>> {
        loop {
            let began = Instant::now();
            let is_unfinished = self.frames.is_unfinished();
            let late = is_unfinished.then(|| began + self.unfinished.time_left());
            let oldest = self.fragments.oldest().map(Instant::from_std);
            let old = oldest.map(|oldest| oldest + MAX_AGE + LOOK_AGAIN);
            let read = match late.into_iter().chain(old).min() {
                None => return input.read(chunk).await.map(Some),
                Some(due) => timeout_at(due, input.read(chunk)).await,
            };
            let received = read.as_ref().map_or(0, |read| *read.as_ref().unwrap_or(&0));
            if is_unfinished {
                self.unfinished.wait(began.elapsed(), received);
            }
            if let Ok(read) = read {
                return read.map(Some);
            }
            if is_unfinished && self.unfinished.time_left().is_zero() {
                return Ok(None);
            }
            self.fragments.forget_old(Instant::now().into_std());
            self.keep_unfinished().await;
        }
    }

    /// Counts what is kept of what is not complete yet. Where there is no room for it, it is given up and the client is told.
    async fn keep_unfinished(&mut self) {
        if !self.frames.is_unfinished() {
            self.unfinished.begin_anew();
        }
        if self.fits() {
            return;
        }
        if self.frames.give_up() {
            self.complain(NO_ROOM_FOR_FRAME, None).await;
        }
        if !self.fits() {
            self.fragments = Fragments::default();
            self.complain(NO_ROOM_FOR_FRAGMENTS, None).await;
        }
        let _ = self.fits();
    }

    fn fits(&mut self) -> bool {
        let kept = self.frames.kept() + self.fragments.bytes();
        self.unfinished.keep(kept)
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

    /// What comes next and is complete, once the client may be read.
    async fn next(&mut self) -> Option<Next> {
        while !self.shared.may_read() && !self.shared.finishing.get() {
            self.shared.room.notified().await;
        }
        if self.locked.is_none()
            && let Some(series) = self.frames.series()
        {
            return Some(Next::Series(series));
        }
        self.frames.next().map(Next::Frame)
    }

    /// Passes messages on as they are.
    async fn relay(&mut self, series: Series) {
        self.speaks_json = true;
        self.shared.unbatched.set(false);
        let from = self.id;
        let _ = self.registry.send(Relay { from, series }).await;
        due::done().await;
    }

    /// Performs one frame, to its end.
    async fn take(&mut self, frame: Result<Frame, FrameError>) {
        if let Some(token) = &self.locked {
            match admit(token, frame.as_ref()) {
                Ok(()) => self.locked = None,
                Err(why) => self.refuse(&why.to_string()),
            }
            return;
        }
        let length = frame.as_ref().map_or(0, |frame| frame.text.len());
        let mut room = self.shared.room_for(length).await;
        let frame = match frame {
            Ok(frame) => frame,
            Err(FrameError::NotAnObject(start)) if !self.speaks_json && is_host_line(&start) => {
                return self.refuse(Foreign::Http.explanation());
            }
            Err(error) => return self.complain(&error.to_string(), None).await,
        };
        self.speaks_json = true;
        self.shared.unbatched.set(!frame.newline);
        let Some(Incoming { id, op }) = self.assemble(op::read(&frame.text), &mut room).await
        else {
            return;
        };
        match op {
            Ok(Op::Subscribe(Subscribe { encoding, .. }))
                if encoding.compression != Compression::None && !self.shared.binary.get() =>
            {
                self.complain(NO_BINARY, id.as_deref()).await;
            }
            Ok(op) => {
                let from = self.id;
                self.perform(Request { from, id, op }, room).await;
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
    /// Then `room` is room for that.
    async fn assemble(&mut self, incoming: Incoming, room: &mut Share) -> Option<Incoming> {
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
        // The little room that there was is not kept while more is waited for.
        let _ = room.resize(0, Claim::Last);
        *room = self.shared.room_for(whole.len()).await;
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

    /// The client has not done what it has to, or speaks something else: it is told so, and nothing that it sends is looked at
    /// any more.
    fn refuse(&self, why: &str) {
        self.shared.refusing.set(true);
        self.shared.send(messages::status(Level::Error, why, None));
    }

    async fn complain(&self, why: &str, id: Option<&RawValue>) {
        tracing::debug!(connection = self.id.0, why, "refused");
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

    /// Performs an op; `room` is kept until it has taken effect.
    async fn perform(&self, request: Request, room: Share) {
        if let Op::CallService(CallService { service, .. }) = &request.op
            && Service::from_name(service).is_some_and(Service::is_computation)
        {
            let registry = &self.registry;
            self.shared.enqueue_computation(request, room, registry);
            return;
        }
        let publishes = matches!(request.op, Op::Publish { .. });
        if let Ok(handled) = self.registry.send(request).await
            && let Some(effect) = handled.0
        {
            stay_awake();
            // The sender is dropped, never used: its end is the news.
            let _ = effect.await;
        }
        if publishes {
            due::done().await;
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
