//! Reads the frames of one client, and has their ops performed by the registry, one at a time.
//!
//! The actor polls the reader after each message that it has handled. So the reader may wait for the client's state
//! without a waker. Work that waits for others is a future of its own, without access to that state.
//!
//! **Invariant:** the next frame is parsed after the last op has taken effect, except for pure computations. So a
//! client's requests take effect in the order sent. A series of messages counts as one op. One poll reads a bounded
//! number of bytes and performs a bounded number of ops. Every frame becomes one op or one error.

use std::mem;
use std::pin::Pin;
use std::task::{self, Poll, ready};

use actix::prelude::*;
use bytes::BytesMut;
use tokio::time::error::Elapsed;
use tokio::time::{Instant, sleep, timeout};

use super::client::Connection;
use super::transport::{ClientLost, ClientStream};
use crate::actors::ConnectionId;
use crate::actors::gateway::limits::{
    CLOSED_CHECK, DISCARD_BYTES, FRAME_TIME, FRAMES_IN_A_ROW, LOOK_AGAIN, READ_BYTES,
    RESPONSES_TIME,
};
use crate::actors::gateway::registry::{Handled, Request, Retire};
use crate::actors::resources::long_work::{SHORT_WORK, WorkKind, run_long_work};
use crate::actors::resources::memory::{Memory, Permit, SHORT};
use crate::actors::resources::turns::{Timer, end_turn};
use crate::actors::resources::unread::{Ends, has_closed};
use crate::protocol::catalog::Service;
use crate::protocol::limits::MEDIUM;
use crate::protocol::op::{
    self, CallService, Compression, Incoming, Op, OpError, Problem, Subscribe,
};
use crate::protocol::wire::fragments::{Fragments, MAX_AGE};
use crate::protocol::wire::frame::{Foreign, FrameError, FramePart, RawFrame, is_host_line};

/// The error for a frame that takes longer than [`FRAME_TIME`].
const TOO_SLOW: &str = "a frame that has begun must be complete within a minute";
/// The error for a client that requests binary frames over raw TCP.
const NO_BINARY: &str = "subscribe: compression cbor and cbor-raw need WebSocket; \
                         over raw TCP every frame is a line of JSON";
const NESTED_FRAGMENT: &str = "fragment: the joined pieces must not be a fragment";

type BoxFuture<T> = Pin<Box<dyn Future<Output = T>>>;

/// The reading half of a connection.
pub(super) struct ClientReader {
    step: ReadStep,
    id: ConnectionId,
    /// Pieces of a message and the memory permit. While a frame is parsed, its future owns it.
    parser: FrameParser,
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
enum ReadStep {
    /// It reads from the stream.
    Reading,
    /// It cuts off the frames that are complete.
    Cutting,
    /// It waits for the memory permit of the incoming long frame.
    WaitingForRoom(BoxFuture<Result<Permit, ClientLost>>),
    /// It reads a frame.
    Parsing(BoxFuture<(FrameParser, Parsed)>),
    /// It waits until an op has taken effect.
    Performing(BoxFuture<()>),
    /// The client has stopped sending, but may still read. The reader waits for the answers to its calls and
    /// computations, until the second future ends.
    Retiring(Option<BoxFuture<()>>, BoxFuture<Result<(), Elapsed>>),
}

impl<S: ClientStream> ActorFuture<Connection<S>> for ClientReader {
    type Output = ();

    /// Reads until the client ends or is refused, then lets the connection finish.
    fn poll(
        self: Pin<&mut Self>,
        client: &mut Connection<S>,
        _: &mut Context<Connection<S>>,
        cx: &mut task::Context<'_>,
    ) -> Poll<()> {
        let reader = self.get_mut();
        (reader.bytes, reader.frames) = (0, 0);
        loop {
            let next = match &mut reader.step {
                ReadStep::Reading => ready!(reader.poll_chunk(client, cx)),
                ReadStep::Cutting => ready!(reader.poll_cut(client, cx)),
                ReadStep::WaitingForRoom(room) => ready!(room.as_mut().poll(cx)).map(|permit| {
                    reader.parser.permit = Some(permit);
                    ReadStep::Reading
                }),
                ReadStep::Parsing(frame) => {
                    let (parser, parsed) = ready!(frame.as_mut().poll(cx));
                    reader.parser = parser;
                    Ok(match parsed {
                        Ok(Some((incoming, length))) => reader.perform(client, incoming, length),
                        Ok(None) => ReadStep::Cutting,
                        Err(why) => {
                            client.refuse(why);
                            ReadStep::Cutting
                        }
                    })
                }
                ReadStep::Performing(op) => {
                    ready!(op.as_mut().poll(cx));
                    Ok(ReadStep::Cutting)
                }
                ReadStep::Retiring(answers, gone) => {
                    if let Some(all) = answers
                        && all.as_mut().poll(cx).is_ready()
                    {
                        *answers = None;
                    }
                    if answers.is_some() || client.is_computing() {
                        let _ = ready!(gone.as_mut().poll(cx));
                    }
                    client.leave();
                    return Poll::Ready(());
                }
            };
            match next {
                Ok(step) => reader.step = step,
                Err(lost) => {
                    client.is_refused |= lost == ClientLost::Refused;
                    client.registry.do_send(Retire(reader.id));
                    client.leave();
                    return Poll::Ready(());
                }
            }
        }
    }
}

impl ClientReader {
    /// A reader of a client with a place, whose bytes `first` have been read.
    pub(super) fn new(id: ConnectionId, first: BytesMut) -> Self {
        Self {
            step: ReadStep::Reading,
            id,
            parser: FrameParser::default(),
            chunk: first,
            has_ended: false,
            is_last: false,
            frame_due: None,
            blocked: None,
            speaks_json: false,
            timer: Timer::default(),
            bytes: 0,
            frames: 0,
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
            ready!(self.poll_read(client, cx))?;
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
        ready!(self.poll_may_read(client, cx))?;
        let transport = client.transport()?;
        self.parser.give_back(transport.is_long_coming());
        let part = transport.cut()?;
        let is_long_coming = transport.is_long_coming();
        if part.is_some() || !transport.is_unfinished() {
            self.frame_due = None;
        }
        Poll::Ready(Ok(match part {
            Some(part) => self.take_part(client, part),
            None => self.wait_for_rest(client, is_long_coming),
        }))
    }

    /// Starts to read a frame, or performs lines or an error that need no reading.
    fn take_part<S: ClientStream>(
        &mut self,
        client: &mut Connection<S>,
        part: FramePart,
    ) -> ReadStep {
        self.frames += 1;
        match part {
            FramePart::Lines(lines) => {
                (self.speaks_json, client.is_single) = (true, false);
                let op = Ok(Op::PublishLines(lines));
                self.perform(client, Incoming { id: None, op }, 0)
            }
            FramePart::Frame(frame) => {
                (self.speaks_json, client.is_single) = (true, !frame.newline());
                let memory = client.gauges.memory().clone();
                let mut parser = mem::take(&mut self.parser);
                ReadStep::Parsing(Box::pin(async move {
                    let parsed = parser.read_frame(&memory, frame).await;
                    (parser, parsed)
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

    /// Reads on, for the rest of a frame. A long frame first waits for its memory permit.
    fn wait_for_rest<S: ClientStream>(
        &mut self,
        client: &Connection<S>,
        is_long_coming: bool,
    ) -> ReadStep {
        if client.is_finishing && !client.is_socket() {
            // Answers to further frames would wait in memory if the client reads nothing. A WebSocket is read until its
            // close frame.
            self.has_ended = true;
            self.chunk.clear();
        } else if is_long_coming && self.parser.permit.is_none() {
            self.frame_due = None;
            let (memory, ends) = (client.gauges.memory().clone(), client.ends);
            // The end of the stream comes after bytes that are not read without a permit.
            return ReadStep::WaitingForRoom(Box::pin(async move {
                tokio::select! {
                    biased;
                    permit = memory.long_frame() => Ok(permit),
                    () = closed(ends) => Err(ClientLost::Gone),
                }
            }));
        }
        ReadStep::Reading
    }

    /// Reads more data, or refuses the client if an incomplete frame takes too long. Meanwhile drops expired pieces of
    /// messages.
    fn poll_read<S: ClientStream>(
        &mut self,
        client: &mut Connection<S>,
        cx: &mut task::Context<'_>,
    ) -> Poll<Result<(), ClientLost>> {
        let transport = client.transport()?;
        if let Poll::Ready(read) = transport.poll_read(cx, &mut self.chunk) {
            self.has_ended = read? == 0;
            return Poll::Ready(Ok(()));
        }
        loop {
            let begin = || Instant::now() + FRAME_TIME;
            let is_unfinished = transport.is_unfinished();
            let late = is_unfinished.then(|| *self.frame_due.get_or_insert_with(begin));
            let began = self.parser.fragments.began().map(Instant::from_std);
            let old = began.map(|began| began + MAX_AGE + LOOK_AGAIN);
            ready!(self.timer.poll(late.into_iter().chain(old).min(), cx));
            let now = Instant::now();
            if late.is_some_and(|late| late <= now) {
                transport.give_up(TOO_SLOW)?;
                client.refuse(TOO_SLOW);
                return Poll::Ready(Ok(()));
            }
            self.parser.fragments.forget_old(now.into_std());
            self.parser.give_back(transport.is_long_coming());
        }
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
                if closed.as_mut().poll(cx).is_pending() {
                    ready!(self.timer.poll(Some(due), cx));
                }
                return Poll::Ready(Err(ClientLost::Gone));
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

    /// Sends an op, or the error of its frame, to the registry. The frame had `length` bytes.
    fn perform<S: ClientStream>(
        &self,
        client: &mut Connection<S>,
        mut incoming: Incoming,
        length: usize,
    ) -> ReadStep {
        let mut is_computation = false;
        match &incoming.op {
            Ok(Op::Subscribe(Subscribe { encoding, .. }))
                if encoding.compression != Compression::None && !client.is_socket() =>
            {
                incoming.op = Err(Problem::NotAFrame(NO_BINARY.to_owned()).into());
            }
            Ok(Op::CallService(CallService { service, .. })) => {
                let service = Service::from_name(service);
                is_computation = service.is_some_and(Service::is_computation);
            }
            _ => {}
        }
        let request = Request {
            from: self.id,
            incoming,
            permit: self.parser.permit.clone(),
        };
        if is_computation {
            client.enqueue_computation(request, length);
            return ReadStep::Cutting;
        }
        ReadStep::Performing(Box::pin(effect(client.registry.send(request))))
    }

    /// Withdraws the client's registrations, because it can no longer answer calls.
    fn retire<S: ClientStream>(&self, client: &Connection<S>) -> ReadStep {
        let retired = client.registry.send(Retire(self.id));
        let gone = timeout(RESPONSES_TIME, closed(client.ends));
        ReadStep::Retiring(Some(Box::pin(effect(retired))), Box::pin(gone))
    }
}

/// Waits until a request to the registry has taken effect.
async fn effect(handled: impl Future<Output = Result<Handled, MailboxError>>) {
    if let Ok(handled) = handled.await {
        handled.effect().await;
    }
}

/// Ends when the client has closed its socket, if that can be detected.
async fn closed(ends: Ends) {
    while !has_closed(ends) {
        sleep(CLOSED_CHECK).await;
    }
}

/// Reads and discards the input of a client, up to a limit, if it is refused.
#[derive(Default)]
pub(super) struct Discarder {
    bytes: usize,
}

impl<S: ClientStream> ActorFuture<Connection<S>> for Discarder {
    type Output = ();

    fn poll(
        mut self: Pin<&mut Self>,
        client: &mut Connection<S>,
        _: &mut Context<Connection<S>>,
        cx: &mut task::Context<'_>,
    ) -> Poll<()> {
        let Some(transport) = client.transport.as_mut().filter(|_| client.is_refused) else {
            return Poll::Ready(());
        };
        let read = ready!(transport.poll_read(cx, &mut BytesMut::new()));
        self.bytes += read.unwrap_or(0);
        if read.unwrap_or(0) == 0 || self.bytes >= DISCARD_BYTES {
            return Poll::Ready(());
        }
        end_turn(cx)
    }
}

// ---- from bytes to an op --------------------------------------------------------------------------------------------

/// The input that a client keeps in memory between its frames.
#[derive(Default)]
struct FrameParser {
    /// Frames that come in pieces.
    fragments: Fragments,
    /// The memory permit of the client's long frame. It is held until the frame was performed and its answers written,
    /// and while pieces of a frame are kept.
    permit: Option<Permit>,
}

/// The op of a frame, or the frame's error, and the length of the frame. A piece of a message and white space have none.
/// An error is the reason why the client is refused.
type Parsed = Result<Option<(Incoming, usize)>, &'static str>;

impl FrameParser {
    /// Takes the memory permit, unless the client has it.
    async fn take_room(&mut self, memory: &Memory) {
        if self.permit.is_none() {
            self.permit = Some(memory.long_frame().await);
        }
    }

    /// Releases the memory permit, unless a long frame `is_coming` or pieces of one are kept.
    fn give_back(&mut self, is_coming: bool) {
        if !is_coming && self.fragments.allocated() <= SHORT {
            self.permit = None;
        }
    }

    /// Parses a frame. A piece of a message is kept, and the last one gives the op of the message.
    async fn read_frame(&mut self, memory: &Memory, frame: RawFrame) -> Parsed {
        let length = frame.len();
        if length > MEDIUM {
            self.take_room(memory).await;
        }
        let Some(incoming) = parse(length, move || frame).await? else {
            return Ok(None);
        };
        let is_published = matches!(incoming.op, Ok(Op::Publish { .. } | Op::Fragment(_)));
        if length > SHORT && !is_published {
            self.take_room(memory).await;
        }
        let Incoming { id, op } = incoming;
        let Ok(Op::Fragment(piece)) = op else {
            return Ok(Some((Incoming { id, op }, length)));
        };
        if self.fragments.allocated() + length > SHORT {
            self.take_room(memory).await;
        }
        let whole = match self.fragments.take(piece, Instant::now().into_std()) {
            Ok(Some(whole)) => whole,
            Ok(None) => return Ok(None),
            Err((why, start)) => return Ok(Some((op::read_start(&start, &why).under_id(id), 0))),
        };
        let length = whole.bytes();
        let join = move || RawFrame::of_message(whole.text().into_bytes());
        Ok(parse(length, join).await?.map(|whole| match whole.op {
            Ok(Op::Fragment(_)) => {
                let op = Err(Problem::NotAFrame(NESTED_FRAGMENT.to_owned()).into());
                (Incoming { id, op }, length)
            }
            Err(OpError::Status(Problem::NotAFrame(_))) => (whole.under_id(id), length),
            _ => (whole, length),
        }))
    }
}

/// Parses a frame of `length` bytes, or returns its error. Parses a long one on a worker thread.
async fn parse(
    length: usize,
    frame: impl FnOnce() -> RawFrame + Send + 'static,
) -> Result<Option<Incoming>, &'static str> {
    let parse = move || op::read_raw(frame());
    if length <= SHORT_WORK {
        return Ok(parse());
    }
    let parsed = run_long_work(WorkKind::of(length), parse).await;
    parsed.ok_or("a frame could not be read")
}
