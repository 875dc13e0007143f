//! The reading task of a connection: frames as they come, one op at a time. [`perform`](super::perform) acts on each.
//!
//! **Invariant:** the next frame is looked at only when the last op has taken effect (pure computations excepted). So a
//! client's requests happen in the order in which it sent them. A series of messages counts as one op.

use std::rc::Rc;

use actix::prelude::*;
use bytes::BytesMut;
use tokio::task::yield_now;
use tokio::time::{Instant, timeout, timeout_at};

use crate::actors::ConnectionId;
use crate::actors::gateway::connection::shared::Shared;
use crate::actors::gateway::connection::transport::{CHUNK, Inbound, discard};
use crate::actors::gateway::connection::unfinished::Unfinished;
use crate::actors::gateway::limits::{FRAMES_IN_A_ROW, LOOK_AGAIN, RESPONSES_TIME};
use crate::actors::gateway::messages::{Disconnect, Finish, Retire};
use crate::actors::resources::memory::Permit;
use crate::protocol::limits::MEDIUM;
use crate::protocol::wire::fragments::{Fragments, MAX_AGE};
use crate::protocol::wire::frame::{FramePart, FrameReader};

/// The error for a frame that takes longer than [`FRAME_TIME`](crate::actors::gateway::limits::FRAME_TIME).
const TOO_SLOW: &str = "a frame that has begun must be complete within a minute";

/// The reading half of a connection.
pub(crate) struct Reader {
    pub(super) id: ConnectionId,
    pub(super) shared: Rc<Shared>,
    finish: Recipient<Finish>,
    frames: FrameReader,
    /// Frames that come in pieces.
    pub(super) fragments: Fragments,
    unfinished: Unfinished,
    /// The room for those pieces, once they are long together.
    pub(super) pieces: Option<Permit>,
    /// The room for the long frame that is coming.
    coming: Option<Permit>,
    /// The room for the long frame that has come, until its client may be read again: then the answers to it have been
    /// written.
    pub(super) performed: Option<Permit>,
    /// Whether a JSON object has come: then this is no HTTP request, whose head would have come first.
    pub(super) speaks_json: bool,
    /// The stream has ended; earlier bytes may still wait.
    has_ended: bool,
}

impl Reader {
    pub(super) fn new(
        id: ConnectionId,
        shared: Rc<Shared>,
        finish: Recipient<Finish>,
        frames: FrameReader,
    ) -> Self {
        Self {
            id,
            shared,
            finish,
            frames,
            fragments: Fragments::default(),
            unfinished: Unfinished::default(),
            pieces: None,
            coming: None,
            performed: None,
            speaks_json: false,
            has_ended: false,
        }
    }

    /// Whether frames may be binary: over raw TCP they are lines of text.
    pub(super) const fn takes_binary(&self) -> bool {
        self.frames.is_of_messages()
    }

    /// Reads until the client ends or is refused, then lets the connection finish; `first` has been read already.
    pub(super) async fn run<I: Inbound>(mut self, mut input: I, first: BytesMut) {
        match self.converse(&mut input, first).await {
            Ok(()) => self.await_responses().await,
            // A broken stream takes no answers, and nobody waits for those that don't come.
            Err(_) => self.shared.abandon_computations(),
        }
        (self.coming, self.pieces) = (None, None);
        // Answers that are on their way arrive before the registry answers this, and so before the end.
        let _ = self.shared.registry.send(Disconnect(self.id)).await;
        let _ = self.finish.send(Finish).await;
        if self.shared.is_refused() {
            discard(input).await;
        }
    }

    /// Handles frames until the stream ends or the client is refused; an error if it broke.
    async fn converse<I: Inbound>(
        &mut self,
        input: &mut I,
        mut chunk: BytesMut,
    ) -> std::io::Result<()> {
        loop {
            let full = chunk.len() >= CHUNK / 2;
            self.frames.push(&chunk);
            chunk.clear();
            let mut in_a_row = 0;
            while let Some(cut) = self.next(input, &mut chunk).await? {
                in_a_row += 1;
                if in_a_row % FRAMES_IN_A_ROW == 0 {
                    yield_now().await;
                }
                self.unfinished.begin_anew();
                self.take(cut, input).await;
                if self.shared.is_refused() {
                    return Ok(());
                }
            }
            if !self.frames.is_unfinished() {
                self.unfinished.begin_anew();
            } else if self.coming.is_none() && self.frames.buffered() > MEDIUM {
                self.coming = Some(self.permit(input).await);
            }
            if full {
                // The many chunks of a long frame may all be at hand.
                yield_now().await;
            }
            if self.shared.is_finishing() {
                break;
            }
            if !chunk.is_empty() {
                continue;
            }
            if self.has_ended {
                break;
            }
            match self.read(input, &mut chunk).await? {
                Some(0) => self.has_ended = true,
                Some(_) => {}
                None => {
                    self.refuse(TOO_SLOW);
                    return Ok(());
                }
            }
        }
        if let Some(error) = self.frames.finish() {
            self.complain(&error.to_string(), None).await;
        }
        Ok(())
    }

    /// Reads on; `None` if a frame that has begun takes too long. Meanwhile pieces of messages grow old, and are
    /// forgotten.
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
            self.keep_room_for_pieces();
        }
    }

    /// The room for a long frame: it has been taken, or the client has some for pieces, or it is waited for. Nobody
    /// waits who has room: that might be what others wait for.
    pub(super) async fn permit<I: Inbound>(&mut self, input: &mut I) -> Permit {
        let taken = self.coming.take().or_else(|| input.take_permit());
        match taken.or_else(|| self.pieces.clone()) {
            Some(permit) => permit,
            None => self.shared.memory.long_frame().await,
        }
    }

    /// Gives back the room for pieces once there are none.
    fn keep_room_for_pieces(&mut self) {
        if self.pieces.is_some() && self.fragments.allocated() == 0 {
            self.pieces = None;
        }
    }

    /// The client has stopped sending, and may still be reading. Withdraws its registrations, since it can no longer
    /// answer or withdraw, and waits for the responses that are still to come.
    async fn await_responses(&self) {
        let answered = async {
            if let Ok(handled) = self.shared.registry.send(Retire(self.id)).await {
                handled.effect().await;
            }
            while self.shared.is_computing() {
                self.shared.room.notified().await;
            }
        };
        if timeout(RESPONSES_TIME, answered).await.is_err() {
            self.shared.abandon_computations();
        }
    }

    /// Cuts off what is complete, once the client's frames may be performed. Until then `chunk` takes some of the bytes
    /// that follow, so that the end of the stream is seen.
    async fn next<I: Inbound>(
        &mut self,
        input: &mut I,
        chunk: &mut BytesMut,
    ) -> std::io::Result<Option<FramePart>> {
        while !self.shared.may_read() && !self.shared.is_finishing() {
            self.wait_for_room(input, chunk).await?;
        }
        self.performed = None;
        self.keep_room_for_pieces();
        Ok(self.frames.cut())
    }

    /// Waits until something was written or computed, and reads on meanwhile, up to [`CHUNK`]. It is an error if the
    /// client is gone. A client that has ended its stream counts as gone when nothing was written or computed for
    /// [`RESPONSES_TIME`].
    async fn wait_for_room<I: Inbound>(
        &mut self,
        input: &mut I,
        chunk: &mut BytesMut,
    ) -> std::io::Result<()> {
        let shared = Rc::clone(&self.shared);
        if self.has_ended {
            let room = timeout(RESPONSES_TIME, shared.room.notified()).await;
            return room.map_err(|_| std::io::ErrorKind::TimedOut.into());
        }
        tokio::select! {
            biased;
            () = shared.room.notified() => {}
            read = input.read(chunk), if chunk.len() < CHUNK => {
                if read? == 0 {
                    self.has_ended = true;
                }
            }
        }
        Ok(())
    }
}
