//! Reads the frames of one client, and has their ops performed by the registry, one at a time.
//!
//! The actor polls the reader after each message that it has handled. So the reader may wait for the client's state
//! without a waker. Work that waits for others is a future of its own, without access to that state.
//!
//! The waits for the rest of a frame, for a client that reads nothing, and for the end of its stream have deadlines.
//!
//! **Invariant:** the next frame is parsed after the last op has taken effect, except for pure computations. So a
//! client's requests take effect in the order sent. A series of messages counts as one op. One poll reads a bounded
//! number of bytes and performs a bounded number of ops. Every frame becomes one op or one error.

use std::mem;
use std::pin::Pin;
use std::task::{self, Poll, ready};

use actix::prelude::*;
use bytes::BytesMut;
use tokio::time::{Instant, timeout};

use super::client::Connection;
use super::transport::{ClientLost, ClientStream};
use crate::actors::ConnectionId;
use crate::actors::compute::long_frames::{LongFrame, LongFrames, Parsed};
use crate::actors::gateway::limits::{
    DISCARD_TIME, FRAME_TIME, FRAMES_IN_A_ROW, LOOK_AGAIN, READ_BYTES, RESPONSES_TIME,
};
use crate::actors::gateway::registry::{Request, Retire};
use crate::actors::node::Completion;
use crate::actors::resources::long_work::SHORT_WORK;
use crate::actors::resources::memory::{Permit, time_to_read};
use crate::actors::resources::turns::{Timer, end_turn};
use crate::actors::resources::unread::closed;
use crate::protocol::catalog::Service;
use crate::protocol::limits::{MAX_FRAME, MEDIUM, SHORT};
use crate::protocol::op::{
    self, CallService, Compression, Incoming, Op, OpError, Problem, Subscribe,
};
use crate::protocol::wire::fragments::MAX_AGE;
use crate::protocol::wire::frame::{Foreign, FrameError, FramePart, is_host_line};

/// The error for a client that requests binary frames over raw TCP.
const NO_BINARY: &str = "subscribe: compression cbor and cbor-raw need WebSocket; \
                         over raw TCP every frame is a line of JSON";

/// The error for a frame that takes longer than [`FRAME_TIME`].
const TOO_SLOW: &str = "a frame that has begun must be complete within a minute";
/// The error for a long frame that takes longer than [`LONG_FRAME_TIME`](crate::actors::resources::memory::LONG_FRAME_TIME).
const TOO_SLOW_LONG: &str = "the rest of a frame of more than 272 KiB must arrive within 5 s";
/// The error for a long formula behind other computations of its client.
const TOO_LONG: &str = "a computation of more than 272 KiB waits at most 20 s for earlier ones of its connection; \
                        call again once they have been answered";

type BoxFuture<T> = Pin<Box<dyn Future<Output = T>>>;

/// The reading half of a connection.
#[derive(Default)]
pub(super) struct ClientReader {
    step: ReadStep,
    id: ConnectionId,
    /// Pieces of a message and the memory permit. While a long frame or a piece is read, its future owns them.
    long: LongFrames,
    /// Received bytes that the transport has not read yet.
    chunk: BytesMut,
    /// The stream has ended. Earlier bytes may still wait.
    has_ended: bool,
    /// The last frame has been taken.
    is_last: bool,
    /// Deadline of the incomplete frame. It is set only while the reader waits for the rest.
    frame_due: Option<Instant>,
    /// While a client that has ended its stream must not be read: the start of this time, and the wait until it has
    /// closed its socket.
    blocked: Option<(Instant, BoxFuture<()>)>,
    /// Whether a JSON object has arrived. Then the client does not use HTTP, because a request has its head first.
    speaks_json: bool,
    timer: Timer,
    /// Bytes that this poll has given to the transport.
    bytes: usize,
    /// Frames that this poll has taken.
    frames: usize,
}

/// The states of the reader.
#[derive(Default)]
enum ReadStep {
    /// It reads from the stream.
    #[default]
    Reading,
    /// It cuts off the frames that are complete.
    Cutting,
    /// It waits until an op has taken effect.
    Performing(BoxFuture<()>),
    /// It waits for the memory permit of the incoming long frame.
    WaitingForPermit(BoxFuture<Result<Permit, ClientLost>>),
    /// A computation whose frame keeps its permit waits for the earlier ones of its client. Its length, and the deadline.
    AwaitingTurn(Option<Box<Request>>, usize, Instant),
    /// It reads a long frame, or joins pieces.
    Parsing(BoxFuture<(LongFrames, Parsed)>),
    /// The client has stopped sending, but may still read. The reader waits for the answers to its calls and
    /// computations, until the second future ends.
    Retiring(Option<BoxFuture<()>>, BoxFuture<()>),
    /// The client is not served any more. If it is refused, its input is discarded. The bytes so far, and the deadline.
    Discarding(usize, Instant),
}

impl<S: ClientStream> ActorFuture<Connection<S>> for ClientReader {
    type Output = ();

    /// Reads until the client ends or is refused.
    fn poll(
        self: Pin<&mut Self>,
        client: &mut Connection<S>,
        ctx: &mut Context<Connection<S>>,
        cx: &mut task::Context<'_>,
    ) -> Poll<()> {
        let reader = self.get_mut();
        (reader.bytes, reader.frames) = (0, 0);
        loop {
            let next = match &mut reader.step {
                ReadStep::Reading => ready!(reader.poll_chunk(client, cx)),
                ReadStep::Cutting => ready!(reader.poll_cut(client, cx)),
                ReadStep::Performing(op) => {
                    ready!(op.as_mut().poll(cx));
                    Ok(ReadStep::Cutting)
                }
                ReadStep::WaitingForPermit(permit) => {
                    ready!(permit.as_mut().poll(cx)).map(|permit| {
                        reader.long.hold(permit);
                        ReadStep::Reading
                    })
                }
                ReadStep::AwaitingTurn(request, length, due) => {
                    if !client.computations.is_empty() {
                        ready!(reader.timer.poll(Some(*due), cx));
                    }
                    let request = request.take().map(|request| *request);
                    Ok(request.map_or(ReadStep::Cutting, |request| {
                        Self::queue(client, request, *length, *due)
                    }))
                }
                ReadStep::Parsing(frame) => {
                    let (long, parsed) = ready!(frame.as_mut().poll(cx));
                    reader.long = long;
                    Ok(match parsed {
                        Ok(Some((incoming, length))) => reader.perform(client, incoming, length),
                        Ok(None) => ReadStep::Cutting,
                        Err(why) => {
                            client.refuse(why);
                            ReadStep::Cutting
                        }
                    })
                }
                ReadStep::Retiring(answers, gone) => {
                    if let Some(all) = answers
                        && all.as_mut().poll(cx).is_ready()
                    {
                        *answers = None;
                    }
                    if answers.is_some() || !client.computations.is_empty() {
                        ready!(gone.as_mut().poll(cx));
                    }
                    *reader = Self::discarding(client);
                    continue;
                }
                ReadStep::Discarding(bytes, due) => {
                    if reader.timer.poll(Some(*due), cx).is_pending() {
                        ready!(client.poll_discard(bytes, cx));
                    }
                    return client.end_half(ctx);
                }
            };
            match next {
                Ok(step) => reader.step = step,
                Err(lost) => {
                    client.is_refused |= lost == ClientLost::Refused;
                    client.registry.do_send(Retire(reader.id));
                    *reader = Self::discarding(client);
                }
            }
        }
    }
}

impl ClientReader {
    /// A reader of a client with a place, whose bytes `first` have been read.
    pub(super) fn new(id: ConnectionId, first: BytesMut) -> Self {
        Self {
            id,
            chunk: first,
            ..Self::default()
        }
    }

    /// Gives the transport the next bytes.
    fn poll_chunk<S: ClientStream>(
        &mut self,
        client: &mut Connection<S>,
        cx: &mut task::Context<'_>,
    ) -> Poll<Result<ReadStep, ClientLost>> {
        // All chunks of a long frame may be available at once.
        if self.bytes >= READ_BYTES / 2 {
            return end_turn(cx);
        }
        if self.chunk.is_empty() && !self.has_ended {
            match client.transport()?.poll_read(cx, &mut self.chunk) {
                Poll::Ready(read) => self.has_ended = read? == 0,
                Poll::Pending => ready!(self.poll_deadlines(client, cx))?,
            }
        }
        if self.chunk.is_empty() && self.has_ended {
            self.is_last = true;
            // An incomplete frame is an error.
            let unfinished = client.transport()?.finish();
            return Poll::Ready(Ok(unfinished.map_or(ReadStep::Cutting, |error| {
                self.perform(client, op::read_start(&[], &error), 0)
            })));
        }
        self.bytes += self.chunk.len();
        client.transport()?.push(&self.chunk);
        self.chunk.clear();
        Poll::Ready(Ok(ReadStep::Cutting))
    }

    /// Waits until the client may be read, and cuts off its next frame, if that is complete.
    fn poll_cut<S: ClientStream>(
        &mut self,
        client: &mut Connection<S>,
        cx: &mut task::Context<'_>,
    ) -> Poll<Result<ReadStep, ClientLost>> {
        if client.is_refused || self.is_last {
            return Poll::Ready(Ok(self.retire(client)));
        }
        if self.frames >= FRAMES_IN_A_ROW {
            return end_turn(cx);
        }
        self.long.give_back(client.transport()?.is_long_coming());
        ready!(self.poll_may_read(client, cx))?;
        let transport = client.transport()?;
        let part = transport.cut()?;
        let (is_long_coming, is_single) = (transport.is_long_coming(), transport.is_single());
        if part.is_some() || !transport.is_unfinished() {
            self.frame_due = None;
        }
        client.is_single = is_single;
        Poll::Ready(Ok(match part {
            Some(part) => self.take_part(client, part),
            None if client.is_finishing && !client.is_socket() => {
                // Answers to further frames would wait in memory if the client reads nothing. A WebSocket is read until
                // its close frame.
                self.has_ended = true;
                self.chunk.clear();
                ReadStep::Reading
            }
            None if is_long_coming && self.long.permit.is_none() => self.wait_for_permit(client),
            None => ReadStep::Reading,
        }))
    }

    /// Performs a short frame, lines or an error. A long frame and a piece are read by a future.
    fn take_part<S: ClientStream>(
        &mut self,
        client: &mut Connection<S>,
        part: FramePart,
    ) -> ReadStep {
        self.frames += 1;
        match part {
            FramePart::Lines(lines) => {
                self.speaks_json = true;
                let op = Ok(Op::PublishLines(lines));
                self.perform(client, Incoming { id: None, op }, 0)
            }
            FramePart::Frame(frame) => {
                self.speaks_json = true;
                let length = frame.len();
                let frame = if length > SHORT_WORK {
                    LongFrame::Unread(frame)
                } else {
                    match op::read_raw(frame) {
                        None => return ReadStep::Cutting,
                        Some(one) if !matches!(one.op, Ok(Op::Fragment(_))) => {
                            return self.perform(client, one, length);
                        }
                        Some(piece) => LongFrame::Piece(piece, length),
                    }
                };
                let memory = client.gauges.memory().clone();
                let mut long = mem::take(&mut self.long);
                ReadStep::Parsing(Box::pin(async move {
                    let parsed = long.read(&memory, frame).await;
                    (long, parsed)
                }))
            }
            FramePart::Error(FrameError::NotAnObject(start), _)
                if !self.speaks_json && !client.is_socket() && is_host_line(&start) =>
            {
                client.refuse(Foreign::Http.explanation());
                ReadStep::Cutting
            }
            FramePart::Error(error, start) => {
                self.perform(client, op::read_start(&start, &error), 0)
            }
        }
    }

    /// Sends an op, or the error of its frame, to the registry. The frame had `length` bytes.
    fn perform<S: ClientStream>(
        &self,
        client: &mut Connection<S>,
        mut incoming: Incoming,
        length: usize,
    ) -> ReadStep {
        let (mut is_computation, mut may_wait) = (false, false);
        match &incoming.op {
            Ok(Op::Subscribe(Subscribe { encoding, .. }))
                if encoding.compression != Compression::None && !client.is_socket() =>
            {
                incoming.op = Err(Problem::NotAFrame(NO_BINARY.to_owned()).into());
            }
            Ok(Op::CallService(CallService { service, .. })) => {
                let service = Service::from_name(service);
                is_computation = service.is_some_and(Service::is_computation);
                may_wait = matches!(service, Some(Service::Rosapi(_)));
            }
            _ => {}
        }
        if let Some(permit) = &self.long.permit
            && self.long.fragments.allocated() > SHORT
        {
            // The pieces need it after the op too.
            permit.add(MAX_FRAME);
        }
        let request = Request {
            from: self.id,
            incoming,
            permit: self.long.permit.clone(),
        };
        if is_computation {
            let due = Instant::now() + time_to_read(length);
            return Self::queue(client, request, length, due);
        }
        let completed = completed(client.registry.send(request));
        if !may_wait {
            return ReadStep::Performing(Box::pin(completed));
        }
        ReadStep::Performing(Box::pin(client.gone.clone().unless_closed(completed)))
    }

    // ---- waits and their deadlines ----------------------------------------------------------------------------------

    /// Waits for the memory permit of the incoming long frame.
    fn wait_for_permit<S>(&mut self, client: &Connection<S>) -> ReadStep {
        self.frame_due = None;
        let (memory, ends) = (client.gauges.memory().clone(), client.ends);
        // The end of the stream comes after bytes that are not read without a permit.
        ReadStep::WaitingForPermit(Box::pin(async move {
            tokio::select! {
                biased;
                permit = memory.long_frame() => Ok(permit),
                () = closed(ends) => Err(ClientLost::Gone),
            }
        }))
    }

    /// Refuses the client if an incomplete frame takes too long. Meanwhile drops expired pieces of messages.
    fn poll_deadlines<S: ClientStream>(
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
    fn poll_may_read<S: ClientStream>(
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
        Self {
            step: ReadStep::Discarding(0, Instant::now() + DISCARD_TIME),
            ..Self::default()
        }
    }

    /// Withdraws the client's registrations, because it can no longer answer calls.
    fn retire<S: ClientStream>(&mut self, client: &Connection<S>) -> ReadStep {
        self.long = LongFrames::default();
        let retired = client.registry.send(Retire(self.id));
        let gone = timeout(RESPONSES_TIME, closed(client.ends));
        let gone = async move { gone.await.unwrap_or_default() };
        ReadStep::Retiring(Some(Box::pin(completed(retired))), Box::pin(gone))
    }

    /// Queues a computation of this connection. Its frame needs no permit there up to [`MEDIUM`], because a connection that
    /// waits for it reads no other frame. A longer one keeps the permit, so it must begin until `due`.
    fn queue<S: ClientStream>(
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
            return ReadStep::Performing(Box::pin(completed(client.registry.send(request))));
        }
        client.computations.push(request, length);
        client.start_computation();
        ReadStep::Cutting
    }
}

/// Waits until a request to the registry has taken effect.
async fn completed(request: impl Future<Output = Result<Completion, MailboxError>>) {
    if let Ok(completion) = request.await {
        completion.wait().await;
    }
}
