//! Reading from one client: frames as they come, one op at a time. [`Performer`] acts on each.
//!
//! **Invariant:** the next frame is looked at only when the last op has taken effect (pure computations excepted). So a
//! client's requests happen in the order in which it sent them. A series of messages counts as one op. One poll reads a
//! bounded number of bytes and performs a bounded number of ops.

use std::collections::VecDeque;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{self, Poll, ready};

use actix::prelude::*;
use bytes::{Bytes, BytesMut};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::time::Instant;

use super::Connection;
use super::perform::{OpOutcome, Performer, refusal};
use super::plain::{CHUNK, ClientLost, DISCARD_BYTES, DISCARD_TIME, LONG_CHUNK, yield_turn};
use super::session::Opened;
use super::timer::Timer;
use super::transport::ReceivedData;
use super::writer::ClientWriter;
use crate::actors::gateway::limits::{FRAME_TIME, FRAMES_IN_A_ROW, LOOK_AGAIN, RESPONSES_TIME};
use crate::actors::gateway::messages::{Disconnect, Retire};
use crate::actors::panics::contain;
use crate::actors::resources::memory::Permit;
use crate::protocol::limits::MEDIUM;
use crate::protocol::wire::fragments::MAX_AGE;
use crate::protocol::wire::frame::{FramePart, FrameReader};

/// The error for a frame that takes longer than [`FRAME_TIME`].
const TOO_SLOW: &str = "a frame that has begun must be complete within a minute";

type BoxFuture<T> = Pin<Box<dyn Future<Output = T>>>;

/// The reading half of a connection.
struct ClientReader {
    step: ReadStep,
    frames: FrameReader,
    /// Bytes that have come and not been given to `frames`.
    chunk: BytesMut,
    /// Messages of a WebSocket that have come, with the room of long ones.
    messages: VecDeque<(Bytes, Option<Permit>)>,
    /// Whether all frames that have come have been cut off.
    is_cut: bool,
    /// None while it performs an op.
    performer: Option<Performer>,
    performing: Option<BoxFuture<(Performer, OpOutcome)>>,
    /// The room for the long frame that comes, while it is waited for.
    room: Option<BoxFuture<Permit>>,
    /// When the frame that has begun is late: time counts while the rest of it is waited for.
    frame_due: Option<Instant>,
    /// Since when a client that has ended its stream has been waited for to read.
    waits_since: Option<Instant>,
    /// The stream has ended; earlier bytes may still wait.
    has_ended: bool,
    /// The last op is being performed.
    is_last: bool,
    timer: Timer,
}

/// What the reader does.
enum ReadStep {
    /// It handles frames.
    Frames,
    /// The client has stopped sending, and may still be reading: it waits for the responses that are still to come.
    Retiring(Option<BoxFuture<()>>, Instant),
    /// The registry forgets the client.
    Leaving(BoxFuture<()>),
    /// The client was refused: at most that many bytes of its input are discarded, until that time.
    Discarding(usize, Instant),
}

impl ReadStep {
    fn discarding() -> Self {
        Self::Discarding(DISCARD_BYTES, Instant::now() + DISCARD_TIME)
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> Connection<S> {
    /// Reads and writes until the client is gone or has all that is for it.
    pub(super) fn converse(&mut self, opened: Opened<S>, ctx: &mut Context<Self>) {
        let takes_binary = opened.transport.has_messages();
        self.transport = Some(opened.transport);
        let (step, performer) = match opened.place {
            Ok(place) => {
                let (registry, memory) = (self.registry.clone(), self.memory.clone());
                let wants_text = Arc::clone(&self.wants_text);
                let id = place.id();
                let performer = Performer::new(id, registry, memory, wants_text, takes_binary);
                self.place = Some(place);
                (ReadStep::Frames, Some(performer))
            }
            Err(why) => {
                self.refuse(refusal(&why));
                self.finish();
                (ReadStep::discarding(), None)
            }
        };
        ctx.spawn(ClientReader {
            step,
            frames: FrameReader::new(),
            chunk: opened.first,
            messages: VecDeque::new(),
            is_cut: true,
            performer,
            performing: None,
            room: None,
            frame_due: None,
            waits_since: None,
            has_ended: false,
            is_last: false,
            timer: Timer::default(),
        });
        ctx.spawn(ClientWriter::default());
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> ActorFuture<Connection<S>> for ClientReader {
    type Output = ();

    fn poll(
        self: Pin<&mut Self>,
        connection: &mut Connection<S>,
        ctx: &mut Context<Connection<S>>,
        cx: &mut task::Context<'_>,
    ) -> Poll<()> {
        let this = self.get_mut();
        match contain(|| this.poll_to_the_end(connection, cx)) {
            Ok(Poll::Pending) => return Poll::Pending,
            Ok(Poll::Ready(())) => connection.is_read_to_its_end = true,
            Err(panic) => {
                tracing::error!(%panic, "a client's reader failed; its connection ends");
                ctx.stop();
            }
        }
        Poll::Ready(())
    }
}

impl ClientReader {
    /// Reads until the client ends or is refused, then lets the connection finish.
    fn poll_to_the_end<S: AsyncRead + AsyncWrite + Unpin + 'static>(
        &mut self,
        connection: &mut Connection<S>,
        cx: &mut task::Context<'_>,
    ) -> Poll<()> {
        loop {
            match &mut self.step {
                ReadStep::Frames => {
                    self.step = match ready!(self.poll_frames(connection, cx)) {
                        Ok(()) => Self::retire(connection),
                        // A broken stream takes no answers, and nobody waits for those that don't come.
                        Err(lost) => {
                            connection.is_refused |= lost != ClientLost::Gone;
                            connection.abandon_computations();
                            self.leave(connection)
                        }
                    };
                }
                ReadStep::Retiring(answered, due) => {
                    if let Some(all) = answered
                        && all.as_mut().poll(cx).is_ready()
                    {
                        *answered = None;
                    }
                    if answered.is_some() || connection.is_computing() {
                        ready!(self.timer.poll(Some(*due), cx));
                        connection.abandon_computations();
                    }
                    self.step = self.leave(connection);
                }
                ReadStep::Leaving(left) => {
                    ready!(left.as_mut().poll(cx));
                    connection.finish();
                    if !connection.is_refused {
                        return Poll::Ready(());
                    }
                    self.step = ReadStep::discarding();
                }
                ReadStep::Discarding(left, due) => {
                    let Some(transport) = &mut connection.transport else {
                        return Poll::Ready(());
                    };
                    self.chunk.clear();
                    match transport.poll_swallow(cx, &mut self.chunk) {
                        Poll::Ready(Ok(bytes)) if bytes > 0 && *left > bytes => {
                            *left -= bytes;
                            yield_turn(cx);
                            return self.timer.poll(Some(*due), cx);
                        }
                        Poll::Ready(_) => return Poll::Ready(()),
                        Poll::Pending => return self.timer.poll(Some(*due), cx),
                    }
                }
            }
        }
    }

    /// Withdraws the client's registrations, since it can no longer answer or withdraw, and waits for the responses
    /// that are still to come.
    fn retire<S>(connection: &Connection<S>) -> ReadStep {
        let place = connection.place.as_ref();
        let retired = place.map(|place| connection.registry.send(Retire(place.id())));
        let answered = async move {
            if let Some(retired) = retired
                && let Ok(handled) = retired.await
            {
                handled.effect().await;
            }
        };
        ReadStep::Retiring(Some(Box::pin(answered)), Instant::now() + RESPONSES_TIME)
    }

    /// Answers that are on their way arrive before the registry answers this, and so before the end.
    fn leave<S>(&mut self, connection: &Connection<S>) -> ReadStep {
        (self.performer, self.room) = (None, None);
        let place = connection.place.as_ref();
        let left = place.map(|place| connection.registry.send(Disconnect(place.id())));
        ReadStep::Leaving(Box::pin(async move {
            if let Some(left) = left {
                let _ = left.await;
            }
        }))
    }

    /// Handles frames until the stream ends or the client is refused; an error if it broke.
    fn poll_frames<S: AsyncRead + AsyncWrite + Unpin + 'static>(
        &mut self,
        connection: &mut Connection<S>,
        cx: &mut task::Context<'_>,
    ) -> Poll<Result<(), ClientLost>> {
        if let Some(transport) = &mut connection.transport {
            transport.begin_turn();
        }
        let (mut ops, mut bytes) = (0, 0);
        loop {
            if let Some(performing) = &mut self.performing {
                let (performer, outcome) = ready!(performing.as_mut().poll(cx));
                if self.end_op(connection, performer, outcome) {
                    return Poll::Ready(Ok(()));
                }
                ops += 1;
                if ops == FRAMES_IN_A_ROW {
                    // Other connections have a turn.
                    yield_turn(cx);
                    return Poll::Pending;
                }
            }
            if !self.is_cut {
                if !connection.may_read() && !connection.is_finishing {
                    self.frame_due = None;
                    ready!(self.poll_ahead(connection, cx))?;
                    continue;
                }
                if self.cut(connection) {
                    continue;
                }
                if connection.is_finishing {
                    return self.poll_last(cx);
                }
            }
            if let Some(room) = &mut self.room {
                let permit = ready!(room.as_mut().poll(cx));
                self.room = None;
                if let Some(performer) = &mut self.performer {
                    performer.permit = Some(permit);
                }
            }
            if bytes >= CHUNK / 2 {
                // The many chunks of a long frame may all be there.
                yield_turn(cx);
                return Poll::Pending;
            }
            if !self.chunk.is_empty() {
                bytes += self.chunk.len();
                self.frames.push(&self.chunk);
                self.chunk.clear();
                self.is_cut = false;
            } else if self.has_ended {
                return self.poll_last(cx);
            } else {
                let Some(received) = ready!(self.poll_read(connection, cx))? else {
                    connection.refuse(refusal(TOO_SLOW));
                    return Poll::Ready(Ok(()));
                };
                bytes += self.take_in(received);
            }
        }
    }

    /// Notes what has come. Returns the bytes of a message.
    fn take_in(&mut self, received: ReceivedData) -> usize {
        match received {
            ReceivedData::Bytes(bytes) => {
                self.has_ended = bytes == 0;
                0
            }
            #[cfg(feature = "web")]
            ReceivedData::Message(message, permit) => {
                let bytes = message.len();
                self.messages.push_back((message, permit));
                self.is_cut = false;
                bytes
            }
        }
    }

    /// The op that was under way has taken effect. Whether it was the last.
    fn end_op<S>(
        &mut self,
        connection: &mut Connection<S>,
        performer: Performer,
        outcome: OpOutcome,
    ) -> bool {
        self.performing = None;
        self.performer = Some(performer);
        match outcome {
            OpOutcome::Done => self.is_last,
            OpOutcome::Computation(request, length) => {
                connection.enqueue_computation(request, length);
                self.is_last
            }
            OpOutcome::Refused(status) => {
                connection.refuse(status);
                true
            }
        }
    }

    /// Cuts off the next frame, if it is complete, and begins to perform it.
    fn cut<S: AsyncRead + AsyncWrite + Unpin>(&mut self, connection: &mut Connection<S>) -> bool {
        let Some(mut performer) = self.performer.take() else {
            return false;
        };
        performer.give_back(self.is_long_coming());
        self.waits_since = None;
        let cut = match self.messages.pop_front() {
            Some((message, permit)) => {
                performer.permit = permit.or(performer.permit);
                Some(FramePart::Message(message))
            }
            None => self.frames.cut(),
        };
        if cut.is_some() || !self.frames.is_unfinished() {
            self.frame_due = None;
        }
        let Some(cut) = cut else {
            self.is_cut = true;
            if performer.permit.is_none() && self.is_long_coming() {
                self.frame_due = None;
                self.room = Some(Box::pin(performer.room()));
            }
            self.performer = Some(performer);
            return false;
        };
        match &cut {
            FramePart::Lines(_) => connection.outgoing.set_singly(false),
            FramePart::Frame(frame) => connection.outgoing.set_singly(!frame.newline()),
            FramePart::Message(_) | FramePart::Error(..) => {}
        }
        self.performing = Some(Box::pin(performer.take(cut)));
        true
    }

    /// Whether a frame has begun that takes room.
    fn is_long_coming(&self) -> bool {
        self.frames.is_unfinished() && self.frames.buffered() > MEDIUM
    }

    /// The end of the stream. A frame that has begun there is incomplete.
    fn poll_last(&mut self, cx: &mut task::Context<'_>) -> Poll<Result<(), ClientLost>> {
        let performer = self.performer.take();
        let Some((performer, error)) = performer.zip(self.frames.finish()) else {
            return Poll::Ready(Ok(()));
        };
        self.is_last = true;
        self.performing = Some(Box::pin(performer.take_end(error)));
        yield_turn(cx);
        Poll::Pending
    }

    /// Reads on; `None` if a frame that has begun takes too long. Meanwhile, pieces of messages grow old, and are
    /// forgotten.
    fn poll_read<S: AsyncRead + AsyncWrite + Unpin>(
        &mut self,
        connection: &mut Connection<S>,
        cx: &mut task::Context<'_>,
    ) -> Poll<Result<Option<ReceivedData>, ClientLost>> {
        let Some(transport) = &mut connection.transport else {
            return Poll::Ready(Err(ClientLost::Gone));
        };
        let is_long = self.frames.is_unfinished() && self.frames.buffered() > CHUNK;
        let most = if is_long { LONG_CHUNK } else { CHUNK };
        if let Poll::Ready(read) = transport.poll_read(cx, &mut self.chunk, most) {
            return Poll::Ready(read.map(Some));
        }
        let is_unfinished = self.frames.is_unfinished() || transport.is_unfinished();
        let begin = || Instant::now() + FRAME_TIME;
        let late = is_unfinished.then(|| *self.frame_due.get_or_insert_with(begin));
        self.frame_due = late;
        loop {
            let pieces = self.performer.as_mut();
            let oldest = pieces.and_then(|performer| performer.fragments.oldest());
            let old = oldest.map(|oldest| Instant::from_std(oldest) + MAX_AGE + LOOK_AGAIN);
            ready!(self.timer.poll(late.into_iter().chain(old).min(), cx));
            if late.is_some_and(|late| late <= Instant::now()) {
                return Poll::Ready(transport.give_up(TOO_SLOW).map(|()| None));
            }
            let is_coming = self.is_long_coming();
            if let Some(performer) = &mut self.performer {
                performer.fragments.forget_old(Instant::now().into_std());
                performer.give_back(is_coming);
            }
        }
    }

    /// Waits until something was written or computed, and reads on meanwhile, up to [`CHUNK`] or [`FRAMES_IN_A_ROW`]
    /// messages, so that the end of the stream is seen. It is an error if the client is gone. A client that has ended
    /// its stream counts as gone when nothing was written or computed for [`RESPONSES_TIME`].
    fn poll_ahead<S: AsyncRead + AsyncWrite + Unpin>(
        &mut self,
        connection: &mut Connection<S>,
        cx: &mut task::Context<'_>,
    ) -> Poll<Result<(), ClientLost>> {
        let Some(transport) = &mut connection.transport else {
            return Poll::Ready(Err(ClientLost::Gone));
        };
        if self.has_ended {
            let since = *self.waits_since.get_or_insert_with(Instant::now);
            let due = since.max(connection.room_since) + RESPONSES_TIME;
            ready!(self.timer.poll(Some(due), cx));
            return Poll::Ready(Err(ClientLost::Gone));
        }
        let messages = self.messages.iter().map(|(message, _)| message.len());
        let bytes = self.chunk.len() + messages.sum::<usize>();
        if bytes >= CHUNK || self.messages.len() >= FRAMES_IN_A_ROW {
            return Poll::Pending;
        }
        let received = ready!(transport.poll_read(cx, &mut self.chunk, CHUNK))?;
        self.take_in(received);
        Poll::Ready(Ok(()))
    }
}
