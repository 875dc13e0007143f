//! The reading task of a connection: what kind of client it is, its frames, one op at a time.
//!
//! **Invariant:** the next frame is looked at only when the last op has taken effect (pure computations excepted), so
//! all that a client asks of the runtime happens in the order in which it asked.

use std::rc::Rc;
use std::time::Duration;

use actix::prelude::*;
use bytes::{Bytes, BytesMut};
use serde_json::value::RawValue;
use tokio::io::{AsyncRead, AsyncReadExt};
use tokio::time::timeout;

use super::{ANSWERS_OWED, Finish, Shared};
use crate::actors::ConnectionId;
use crate::actors::registry::{Disconnect, Handled, Registry, Request, Respond, Retire};
use crate::protocol::catalog::Service;
use crate::protocol::frame::{Frame, FrameError, FrameReader, Opening, opening};
use crate::protocol::messages::{self, Level};
use crate::protocol::op::{self, CallService, Incoming, Op, OpError};

/// Bytes asked of the stream at a time: large enough for a burst of small frames, small enough to be fair.
const CHUNK: usize = 64 * 1024;
/// How long, and how many bytes, of a refused client's input are swallowed so that it can still read why: closing
/// a socket with unread input resets it.
const DISCARD_TIME: Duration = Duration::from_secs(1);
const DISCARD_BYTES: usize = 16 * 1024 * 1024;

/// The reading half of a connection.
pub(super) struct Reader {
    id: ConnectionId,
    shared: Rc<Shared>,
    registry: Addr<Registry>,
    finish: Recipient<Finish>,
    frames: FrameReader,
}

impl Reader {
    pub(super) fn new(
        id: ConnectionId,
        shared: Rc<Shared>,
        registry: Addr<Registry>,
        finish: Recipient<Finish>,
    ) -> Self {
        Self {
            id,
            shared,
            registry,
            finish,
            frames: FrameReader::new(),
        }
    }

    /// Reads until the client ends or is refused, then lets the connection finish.
    pub(super) async fn run<R: AsyncRead + Unpin>(mut self, mut input: R) {
        let mut chunk = BytesMut::with_capacity(CHUNK);
        match self.greet(&mut input, &mut chunk).await {
            Opening::Json => match self.converse(&mut input, &mut chunk).await {
                Ok(()) => self.settle().await,
                // A broken stream takes no answers.
                Err(_) => self.shared.abandon_computations(),
            },
            Opening::Foreign(foreign) => {
                self.shared.refusing.set(true);
                self.shared
                    .send(messages::status(Level::Error, foreign.explanation(), None));
            }
            Opening::Undecided => {}
        }
        // Answers that are on their way arrive before the registry answers this, and so before the end.
        let _ = self.registry.send(Disconnect(self.id)).await;
        let _ = self.finish.send(Finish).await;
        if self.shared.refusing.get() {
            discard(input).await;
        }
    }

    /// Reads until the first bytes tell what the client speaks. A client that ends before that spoke JSON, if anything.
    async fn greet<R: AsyncRead + Unpin>(&self, input: &mut R, chunk: &mut BytesMut) -> Opening {
        loop {
            match read_some(input, chunk).await {
                Ok(0) | Err(_) => return Opening::Json,
                Ok(_) => match opening(chunk) {
                    Opening::Undecided => {}
                    decided => return decided,
                },
            }
        }
    }

    /// Handles frames until the stream ends; an error if it broke.
    async fn converse<R: AsyncRead + Unpin>(
        &mut self,
        input: &mut R,
        chunk: &mut BytesMut,
    ) -> std::io::Result<()> {
        loop {
            let full = chunk.len() >= CHUNK / 2;
            self.frames.push(chunk);
            chunk.clear();
            while let Some(frame) = self.next_frame().await {
                self.take(frame).await;
            }
            if full {
                // A long frame comes in many chunks, all of them at hand: the other clients have a turn in between.
                tokio::task::yield_now().await;
            }
            if self.shared.finishing.get() || read_some(input, chunk).await? == 0 {
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
    async fn take(&self, frame: Result<Frame, FrameError>) {
        let frame = match frame {
            Ok(frame) => frame,
            Err(error) => return self.complain(&error.to_string(), None).await,
        };
        self.shared.unbatched.set(!frame.newline);
        let Incoming { id, op } = op::read(&frame.text);
        match op {
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
                self.say(messages::failure(&service, id.as_deref(), &why))
                    .await;
            }
            Err(OpError::Status(problem)) => {
                self.complain(&problem.to_string(), id.as_deref()).await;
            }
        }
    }

    async fn complain(&self, why: &str, id: Option<&RawValue>) {
        self.say(messages::status(Level::Error, why, id)).await;
    }

    /// Sends a frame to the client by way of the registry: an answer to an earlier frame may still be in its mailbox,
    /// and must not be overtaken.
    async fn say(&self, frame: Bytes) {
        let respond = Respond {
            connection: self.id,
            frame,
            service: None,
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
            // The sender is dropped, never used: its end is the news.
            let _ = effect.await;
        }
    }
}

/// Reads what is there; 0 at the end of the stream.
async fn read_some<R: AsyncRead + Unpin>(
    input: &mut R,
    chunk: &mut BytesMut,
) -> std::io::Result<usize> {
    chunk.reserve(CHUNK);
    input.read_buf(chunk).await
}

/// Swallows a refused client's input for a bounded time.
pub(super) async fn discard<R: AsyncRead + Unpin>(mut input: R) {
    let mut chunk = BytesMut::new();
    let swallow = async {
        let mut swallowed = 0;
        while swallowed < DISCARD_BYTES {
            chunk.clear();
            match read_some(&mut input, &mut chunk).await {
                Ok(0) | Err(_) => break,
                Ok(read) => swallowed += read,
            }
        }
    };
    let _ = timeout(DISCARD_TIME, swallow).await;
}
