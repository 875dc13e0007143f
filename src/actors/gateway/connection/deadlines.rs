//! Waits for a client that is slow, has stopped sending or is refused, and their deadlines.
//!
//! **Invariant:** the waits for the rest of a frame, for a client that reads nothing, and for the end of its stream
//! have deadlines.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::task::{self, Poll, ready};

use actix::Context;
use bytes::{Bytes, BytesMut};
use tokio::time::{Instant, timeout};

use super::client::{ClientWriter, Connection};
use super::reader::{ClientReader, ReadStep, effect};
use super::transport::{ClientLost, ClientStream};
use crate::actors::compute::computations::Computations;
use crate::actors::compute::long_frames::LongFrames;
use crate::actors::gateway::limits::{
    DISCARD_BYTES, DISCARD_TIME, FRAME_TIME, LINGER, LOOK_AGAIN, READ_BYTES, RESPONSES_TIME,
    STALL_LIMIT,
};
use crate::actors::gateway::registry::{Request, Retire};
use crate::actors::resources::memory::time_to_read;
use crate::actors::resources::turns::end_turn;
use crate::actors::resources::unread::closed;
use crate::protocol::limits::MEDIUM;
use crate::protocol::messages::{self, Level};
use crate::protocol::op::{CallService, Op, OpError, Problem};
use crate::protocol::wire::fragments::MAX_AGE;

/// The error for a frame that takes longer than [`FRAME_TIME`].
const TOO_SLOW: &str = "a frame that has begun must be complete within a minute";
/// The error for a long frame that takes longer than [`LONG_FRAME_TIME`](crate::actors::resources::memory::LONG_FRAME_TIME).
const TOO_SLOW_LONG: &str = "the rest of a frame of more than 272 KiB must arrive within 5 s";

/// The error for a long formula behind other computations of its client.
const TOO_LONG: &str = "a computation of more than 272 KiB waits at most 20 s for earlier ones of its connection; \
                        call again once they have been answered";

impl ClientReader {
    /// Waits for the memory permit of the incoming long frame.
    pub(super) fn wait_for_room<S>(&mut self, client: &Connection<S>) -> ReadStep {
        self.frame_due = None;
        let (memory, ends) = (client.gauges.memory().clone(), client.ends);
        // The end of the stream comes after bytes that are not read without a permit.
        ReadStep::WaitingForRoom(Box::pin(async move {
            tokio::select! {
                biased;
                permit = memory.long_frame() => Ok(permit),
                () = closed(ends) => Err(ClientLost::Gone),
            }
        }))
    }

    /// Refuses the client if an incomplete frame takes too long. Meanwhile drops expired pieces of messages.
    pub(super) fn poll_deadlines<S: ClientStream>(
        &mut self,
        client: &mut Connection<S>,
        cx: &mut task::Context<'_>,
    ) -> Poll<Result<(), ClientLost>> {
        let transport = client.transport()?;
        loop {
            let begin = || Instant::now() + FRAME_TIME;
            let is_unfinished = transport.is_unfinished();
            let late = is_unfinished.then(|| *self.frame_due.get_or_insert_with(begin));
            let began = self.long.fragments.began().map(Instant::from_std);
            let old = began.map(|began| began + MAX_AGE + LOOK_AGAIN);
            let first = late.into_iter().chain(old).chain(self.long.due).min();
            ready!(self.timer.poll(first, cx));
            let now = Instant::now();
            if late.is_some_and(|late| late <= now) {
                transport.give_up(TOO_SLOW)?;
                client.refuse(TOO_SLOW);
                return Poll::Ready(Ok(()));
            }
            if self.long.due.is_some_and(|due| due <= now) {
                return Poll::Ready(self.release_late(client));
            }
            self.long.fragments.forget_old(now.into_std());
            self.long.give_back(transport.is_long_coming());
        }
    }

    /// Releases the permit of a client that has held it for too long. The client is refused if a long frame is incomplete.
    /// Pieces of a frame are dropped.
    fn release_late<S: ClientStream>(
        &mut self,
        client: &mut Connection<S>,
    ) -> Result<(), ClientLost> {
        let transport = client.transport()?;
        let is_coming = transport.is_long_coming();
        self.long = LongFrames::default();
        if is_coming {
            transport.give_up(TOO_SLOW_LONG)?;
            client.refuse(TOO_SLOW_LONG);
            return Err(ClientLost::Refused);
        }
        Ok(())
    }

    /// Waits until enough was written and computed that the client may be read. Meanwhile reads up to [`READ_BYTES`]
    /// bytes, to detect the end of the stream. Returns an error if the client has disconnected. A client that has ended
    /// its stream counts as disconnected if nothing was written for [`RESPONSES_TIME`].
    pub(super) fn poll_may_read<S: ClientStream>(
        &mut self,
        client: &mut Connection<S>,
        cx: &mut task::Context<'_>,
    ) -> Poll<Result<(), ClientLost>> {
        while !client.may_read() {
            self.frame_due = None;
            if self.has_ended {
                let begin = || (Instant::now(), Box::pin(closed(client.ends)) as _);
                let (since, closed) = self.blocked.get_or_insert_with(begin);
                let due = client.progress.max(*since) + RESPONSES_TIME;
                // The rest of a long frame will not come.
                self.long = LongFrames::default();
                if closed.as_mut().poll(cx).is_pending() {
                    ready!(self.timer.poll(Some(due), cx));
                }
                return Poll::Ready(Err(ClientLost::Gone));
            }
            if self.timer.poll(self.long.due, cx).is_ready() {
                self.release_late(client)?;
                continue;
            }
            let transport = client.transport()?;
            if self.chunk.len() + transport.taken_ahead() >= READ_BYTES {
                return Poll::Pending;
            }
            self.has_ended = ready!(transport.poll_read(cx, &mut self.chunk))? == 0;
            transport.look_ahead(&mut self.chunk)?;
        }
        self.blocked = None;
        Poll::Ready(Ok(()))
    }

    /// The reader of a client that is not served any more.
    pub(super) fn discarding<S: ClientStream>(client: &mut Connection<S>) -> Self {
        client.leave();
        let mut reader = Self::default();
        reader.step = ReadStep::Discarding(0, Instant::now() + DISCARD_TIME);
        reader
    }

    /// Withdraws the client's registrations, because it can no longer answer calls.
    pub(super) fn retire<S: ClientStream>(&mut self, client: &Connection<S>) -> ReadStep {
        self.long = LongFrames::default();
        let retired = client.registry.send(Retire(self.id));
        let gone = timeout(RESPONSES_TIME, closed(client.ends));
        let gone = async move { gone.await.unwrap_or_default() };
        ReadStep::Retiring(Some(Box::pin(effect(retired))), Box::pin(gone))
    }

    /// Queues a computation of this connection. Its frame needs no permit there up to [`MEDIUM`], because a connection that
    /// waits for it reads no other frame. A longer one keeps the permit, so it must begin until `due`.
    pub(super) fn queue<S: ClientStream>(
        client: &mut Connection<S>,
        mut request: Request,
        length: usize,
        due: Instant,
    ) -> ReadStep {
        if length <= MEDIUM {
            request.permit = None;
        } else if !client.computations.is_empty() && Instant::now() < due {
            return ReadStep::AwaitingTurn(Some(Box::new(request)), length, due);
        } else if let Ok(Op::CallService(CallService { service, .. })) = &request.incoming.op
            && !client.computations.is_empty()
        {
            let (service, problem) = (service.clone(), Problem::NotAFrame(TOO_LONG.to_owned()));
            request.incoming.op = Err(OpError::Call { service, problem });
            return ReadStep::Performing(Box::pin(effect(client.registry.send(request))));
        }
        client.computations.push(request, length);
        client.start_computation();
        ReadStep::Cutting
    }
}

impl<S: ClientStream> Connection<S> {
    /// The deadline of a client that does not take a write. `None` if no response and no bytes with a permit wait,
    /// unless it is finishing.
    pub(super) fn stall_deadline(&mut self) -> Option<Instant> {
        let stalled = match self.responses_since {
            Some(since) => Some(since.max(self.progress) + STALL_LIMIT),
            None => self.is_finishing.then(|| self.progress + LINGER),
        };
        stalled.into_iter().chain(self.permit_deadline()).min()
    }

    /// The earliest deadline of the waiting bytes that hold a permit.
    pub(super) fn permit_deadline(&mut self) -> Option<Instant> {
        self.permitted.retain(|(_, left)| left.strong_count() > 0);
        self.permitted.iter().map(|(due, _)| *due).min()
    }

    /// Notes the deadline of a frame that holds a permit, because it has more than `most` bytes.
    pub(super) fn limit_time(&mut self, frame: Bytes, most: usize) -> Bytes {
        if frame.len() <= most {
            return frame;
        }
        self.permit_deadline();
        let left = Arc::new(());
        let due = Instant::now() + time_to_read(frame.len());
        self.permitted.push_back((due, Arc::downgrade(&left)));
        Bytes::from_owner(Limited(frame, left))
    }

    /// The earliest time of the next write, if nothing can be written now. Either a message is throttled, or the client
    /// must read first.
    pub(super) fn next_release(&self) -> Option<Instant> {
        let release = self.outbox.next_release();
        let waits = self.outbox.has_topics() && !self.outbox.has_responses();
        let query = self.flow.next_query().filter(|_| waits);
        let first = release.into_iter().chain(query).min();
        first.map(Instant::from_std)
    }

    /// Starts the next computation if none runs and not too many responses wait.
    pub(super) fn start_computation(&mut self) {
        if self.may_compute()
            && let Some(request) = self.computations.start()
        {
            self.registry.do_send(request);
        }
    }

    /// Refuses the client: it gets a status with the reason, and its further input is discarded.
    pub(super) fn refuse(&mut self, why: &str) {
        self.refuse_with(messages::status(Level::Error, why, None));
    }

    /// The same, for a reason that is already a status.
    pub(super) fn refuse_with(&mut self, status: Bytes) {
        self.is_refused = true;
        self.backlog.fetch_add(status.len(), Ordering::Relaxed);
        self.push_response(status, &[]);
    }

    /// The client is not served any more. Its output remains to be written, but it no longer waits for computations.
    pub(super) fn leave(&mut self) {
        self.computations = Computations::default();
        self.gone.set();
        self.is_finishing = true;
    }

    /// Reads and discards the input of a client, up to a limit, if it is refused. `bytes` were discarded before.
    pub(super) fn poll_discard(
        &mut self,
        bytes: &mut usize,
        cx: &mut task::Context<'_>,
    ) -> Poll<()> {
        let Some(transport) = self.transport.as_mut().filter(|_| self.is_refused) else {
            return Poll::Ready(());
        };
        let read = ready!(transport.poll_read(cx, &mut BytesMut::new()));
        *bytes += read.unwrap_or(0);
        if read.unwrap_or(0) == 0 || *bytes >= DISCARD_BYTES {
            return Poll::Ready(());
        }
        end_turn(cx)
    }
}

/// A frame whose client has a deadline, until its last byte is written or dropped.
struct Limited(
    Bytes,
    #[expect(dead_code, reason = "it is dropped with the frame")] Arc<()>,
);

impl AsRef<[u8]> for Limited {
    fn as_ref(&self) -> &[u8] {
        &self.0
    }
}

impl ClientWriter {
    /// Ends the stream after the last message.
    pub(super) fn poll_end<S: ClientStream>(
        &mut self,
        client: &mut Connection<S>,
        ctx: &mut Context<Connection<S>>,
        cx: &mut task::Context<'_>,
    ) -> Poll<()> {
        let is_refused = client.is_refused;
        if let Some(transport) = &mut client.transport
            && let Poll::Ready(ended) = transport.poll_end(cx, is_refused)
        {
            return client.end_writer(ended.is_ok(), ctx);
        }
        let due = *self.end_due.get_or_insert_with(|| Instant::now() + LINGER);
        ready!(self.timer.poll(Some(due), cx));
        client.end_writer(false, ctx)
    }
}
