//! Reads the frames of one client, one op at a time. [`Performer`] makes an op of each frame, and the registry performs
//! it.
//!
//! **Invariant:** the next frame is parsed after the last op has taken effect, except for pure computations. So a
//! client's requests take effect in the order sent. A series of messages counts as one op. One poll reads a bounded
//! number of bytes and performs a bounded number of ops. Every frame becomes one op or one error.

use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::task::{self, Poll, ready};

use actix::prelude::*;
use bytes::{Bytes, BytesMut};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::time::Instant;

use super::flow::has_closed;
use super::session::Opened;
use super::timer::Timer;
use super::transport::Transport;
use super::turns::Turns;
use super::writer::ClientWriter;
use super::{Connection, Ends};
use crate::actors::ConnectionId;
use crate::actors::gateway::ends::ClientLost;
use crate::actors::gateway::limits::{
    CLOSED_CHECK, DISCARD_BYTES, DISCARD_TIME, FRAME_TIME, FRAMES_IN_A_ROW, LOOK_AGAIN, READ_BYTES,
    RESPONSES_TIME,
};
use crate::actors::gateway::messages::{Disconnect, FrameKind, Request, Respond, Retire, form_of};
use crate::actors::gateway::registry::Registry;
use crate::actors::panics::contain;
use crate::actors::resources::long_work::{WorkKind, run_long_work};
use crate::actors::resources::memory::{Memory, Permit, SHORT, cover};
use crate::protocol::catalog::Service;
use crate::protocol::limits::MEDIUM;
use crate::protocol::messages::{self, Level};
use crate::protocol::op::{
    self, CallService, Compression, GoalStatus, Incoming, Op, OpError, Problem, Subscribe,
};
use crate::protocol::wire::fragments::{Fragments, MAX_AGE};
use crate::protocol::wire::frame::{Foreign, FrameError, FramePart, RawFrame, is_host_line};
use crate::protocol::wire::json::Payload;

/// The error for a frame that takes longer than [`FRAME_TIME`].
const TOO_SLOW: &str = "a frame that has begun must be complete within a minute";

type BoxFuture<T> = Pin<Box<dyn Future<Output = T>>>;

/// The reading half of a connection.
struct ClientReader {
    step: ReadStep,
    /// Received bytes that the transport has not read yet.
    chunk: BytesMut,
    /// Whether all complete frames have been taken out of the transport.
    is_cut: bool,
    /// `None` while it performs an op.
    performer: Option<Performer>,
    performing: Option<BoxFuture<(Performer, OpOutcome)>>,
    /// Waits for the memory permit of the incoming long frame.
    room: Option<BoxFuture<Permit>>,
    /// Deadline of the incomplete frame. It is set only while the reader waits for the rest.
    frame_due: Option<Instant>,
    /// Start of the wait for a client that has ended its stream and does not read.
    waits_since: Option<Instant>,
    /// The next check whether a client that is not read has closed its socket.
    closed_check: Option<Instant>,
    /// The stream has ended. Earlier bytes may still wait.
    has_ended: bool,
    /// The last op is being performed.
    is_last: bool,
    turns: Turns,
    timer: Timer,
}

/// The states of the reader.
enum ReadStep {
    /// It handles frames.
    Frames,
    /// The client has stopped sending, but may still read. The reader waits for the pending responses.
    Retiring(Option<BoxFuture<()>>, Instant),
    /// The registry removes the client.
    Leaving(BoxFuture<()>),
    /// The client was refused. At most this many bytes of its input are discarded, until this time.
    Discarding(usize, Instant),
}

impl ReadStep {
    fn discarding() -> Self {
        Self::Discarding(DISCARD_BYTES, Instant::now() + DISCARD_TIME)
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> Connection<S> {
    /// Reads and writes until the client disconnects, or has received all its messages.
    pub(super) fn converse(&mut self, opened: Opened<S>, ctx: &mut Context<Self>) {
        let takes_binary = opened.transport.has_messages();
        self.transport = Some(opened.transport);
        let (step, performer) = match opened.place {
            Ok(place) => {
                let performer = Performer {
                    id: place.id(),
                    registry: self.registry.clone(),
                    memory: self.memory.clone(),
                    wants_text: Arc::clone(&self.wants_text),
                    takes_binary,
                    fragments: Fragments::default(),
                    permit: None,
                    speaks_json: false,
                    deliveries: 0,
                };
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
            chunk: opened.first,
            is_cut: true,
            performer,
            performing: None,
            room: None,
            frame_due: None,
            waits_since: None,
            closed_check: None,
            has_ended: false,
            is_last: false,
            turns: Turns::default(),
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
                        // A broken stream takes no answers, so pending computations are dropped.
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
                        let due = Some(*due);
                        ready!(self.poll_gone(connection.ends, due, cx));
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
                    match transport.poll_read(cx, &mut self.chunk) {
                        Poll::Ready(Ok(bytes)) if bytes > 0 && *left > bytes => {
                            *left -= bytes;
                            self.turns.end(cx);
                            return self.timer.poll(Some(*due), cx);
                        }
                        Poll::Ready(_) => return Poll::Ready(()),
                        Poll::Pending => return self.timer.poll(Some(*due), cx),
                    }
                }
            }
        }
    }

    /// Withdraws the client's registrations, because it can no longer answer calls. Then waits for the pending
    /// responses.
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

    /// Removes the client from the registry. Answers already sent arrive before the registry's reply.
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

    /// Handles frames until the stream ends or the client is refused. Returns an error if the stream broke.
    fn poll_frames<S: AsyncRead + AsyncWrite + Unpin + 'static>(
        &mut self,
        connection: &mut Connection<S>,
        cx: &mut task::Context<'_>,
    ) -> Poll<Result<(), ClientLost>> {
        let (mut ops, mut bytes) = (0, 0);
        loop {
            if let Some(performing) = &mut self.performing {
                let (performer, outcome) = ready!(performing.as_mut().poll(cx));
                let deliveries = performer.deliveries;
                if self.end_op(connection, performer, outcome) {
                    return Poll::Ready(Ok(()));
                }
                ops += 1 + deliveries;
                if ops >= FRAMES_IN_A_ROW {
                    // Other connections have a turn.
                    self.turns.end(cx);
                    return Poll::Pending;
                }
            }
            if !self.is_cut {
                if !connection.may_read() && !connection.is_finishing {
                    self.frame_due = None;
                    ready!(self.poll_ahead(connection, cx))?;
                    continue;
                }
                if self.cut(connection)? {
                    continue;
                }
                // A client with messages is read until it answers the close frame.
                if connection.is_finishing && !transport_of(connection)?.has_messages() {
                    return self.poll_last(connection, cx);
                }
            }
            if let Some(room) = &mut self.room {
                let Poll::Ready(permit) = room.as_mut().poll(cx) else {
                    // The end of the stream comes after bytes that are not read without a permit.
                    ready!(self.poll_gone(connection.ends, None, cx));
                    return Poll::Ready(Err(ClientLost::Gone));
                };
                self.room = None;
                if let Some(performer) = &mut self.performer {
                    performer.permit = Some(permit);
                }
            }
            if bytes >= READ_BYTES / 2 {
                // All chunks of a long frame may be available at once.
                self.turns.end(cx);
                return Poll::Pending;
            }
            if !self.chunk.is_empty() {
                bytes += self.chunk.len();
                transport_of(connection)?.push(&self.chunk);
                self.chunk.clear();
                self.is_cut = false;
            } else if self.has_ended {
                return self.poll_last(connection, cx);
            } else if !ready!(self.poll_read(connection, cx))? {
                connection.refuse(refusal(TOO_SLOW));
                return Poll::Ready(Ok(()));
            }
        }
    }

    /// Ends an op that has taken effect. Returns whether it was the last op.
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

    /// Takes the next frame, if it is complete, and begins to perform it.
    fn cut<S: AsyncRead + AsyncWrite + Unpin>(
        &mut self,
        connection: &mut Connection<S>,
    ) -> Result<bool, ClientLost> {
        let Some(mut performer) = self.performer.take() else {
            return Ok(false);
        };
        let transport = transport_of(connection)?;
        performer.give_back(transport.is_long_coming());
        self.waits_since = None;
        let cut = transport.cut()?;
        if cut.is_some() || !transport.is_unfinished() {
            self.frame_due = None;
        }
        let Some(cut) = cut else {
            self.is_cut = true;
            if performer.permit.is_none() && transport.is_long_coming() {
                self.frame_due = None;
                self.room = Some(Box::pin(performer.room()));
            }
            self.performer = Some(performer);
            return Ok(false);
        };
        match &cut {
            FramePart::Lines(_) => connection.outgoing.set_singly(false),
            FramePart::Frame(frame) => connection.outgoing.set_singly(!frame.newline()),
            FramePart::Error(..) => {}
        }
        self.performing = Some(Box::pin(performer.take(cut)));
        Ok(true)
    }

    /// Handles the end of the stream. An incomplete frame is an error.
    fn poll_last<S: AsyncRead + AsyncWrite + Unpin>(
        &mut self,
        connection: &mut Connection<S>,
        cx: &mut task::Context<'_>,
    ) -> Poll<Result<(), ClientLost>> {
        let performer = self.performer.take();
        let error = transport_of(connection)?.finish();
        let Some((performer, error)) = performer.zip(error) else {
            return Poll::Ready(Ok(()));
        };
        self.is_last = true;
        let part = FramePart::Error(error, Vec::new());
        self.performing = Some(Box::pin(performer.take(part)));
        self.turns.end(cx);
        Poll::Pending
    }

    /// Reads more data. Returns false if an incomplete frame takes too long. Meanwhile drops expired pieces of messages.
    fn poll_read<S: AsyncRead + AsyncWrite + Unpin>(
        &mut self,
        connection: &mut Connection<S>,
        cx: &mut task::Context<'_>,
    ) -> Poll<Result<bool, ClientLost>> {
        let transport = transport_of(connection)?;
        if let Poll::Ready(read) = transport.poll_read(cx, &mut self.chunk) {
            self.has_ended = read? == 0;
            return Poll::Ready(Ok(true));
        }
        self.turns.rest();
        let begin = || Instant::now() + FRAME_TIME;
        let is_unfinished = transport.is_unfinished();
        let late = is_unfinished.then(|| *self.frame_due.get_or_insert_with(begin));
        self.frame_due = late;
        loop {
            let pieces = self.performer.as_mut();
            let began = pieces.and_then(|performer| performer.fragments.began());
            let old = began.map(|began| Instant::from_std(began) + MAX_AGE + LOOK_AGAIN);
            ready!(self.timer.poll(late.into_iter().chain(old).min(), cx));
            if late.is_some_and(|late| late <= Instant::now()) {
                return Poll::Ready(transport.give_up(TOO_SLOW).map(|()| false));
            }
            if let Some(performer) = &mut self.performer {
                performer.fragments.forget_old(Instant::now().into_std());
                performer.give_back(transport.is_long_coming());
            }
        }
    }

    /// Waits until the client has closed its socket, or until `due`.
    fn poll_gone(
        &mut self,
        ends: Ends,
        due: Option<Instant>,
        cx: &mut task::Context<'_>,
    ) -> Poll<()> {
        loop {
            let check = *self.closed_check.get_or_insert_with(Instant::now);
            ready!(self.timer.poll(due.into_iter().chain([check]).min(), cx));
            let now = Instant::now();
            if due.is_some_and(|due| now >= due) || has_closed(ends) {
                return Poll::Ready(());
            }
            self.closed_check = Some(now + CLOSED_CHECK);
        }
    }

    /// Waits until something was written or computed. Meanwhile reads up to [`READ_BYTES`] bytes, to detect the end of
    /// the stream. Returns an error if the client has disconnected. A client that has ended its stream counts as
    /// disconnected if nothing was written or computed for [`RESPONSES_TIME`].
    fn poll_ahead<S: AsyncRead + AsyncWrite + Unpin>(
        &mut self,
        connection: &mut Connection<S>,
        cx: &mut task::Context<'_>,
    ) -> Poll<Result<(), ClientLost>> {
        if self.has_ended {
            let since = *self.waits_since.get_or_insert_with(Instant::now);
            let due = since.max(connection.room_since) + RESPONSES_TIME;
            ready!(self.poll_gone(connection.ends, Some(due), cx));
            return Poll::Ready(Err(ClientLost::Gone));
        }
        let transport = transport_of(connection)?;
        if self.chunk.len() + transport.taken_ahead() >= READ_BYTES {
            return Poll::Pending;
        }
        self.has_ended = ready!(transport.poll_read(cx, &mut self.chunk))? == 0;
        Poll::Ready(transport.look_ahead(&mut self.chunk))
    }
}

/// The transport of a client that is served.
fn transport_of<S>(connection: &mut Connection<S>) -> Result<&mut Transport<S>, ClientLost> {
    connection.transport.as_mut().ok_or(ClientLost::Gone)
}

// ---- from a frame to its effect -------------------------------------------------------------------------------------

/// The error for a client that requests binary frames over raw TCP.
const NO_BINARY: &str = "subscribe: compression cbor and cbor-raw need WebSocket; \
                         over raw TCP every frame is a line of JSON";
const NESTED_FRAGMENT: &str = "fragment: the joined pieces must not be a fragment";

/// The remaining work after a part of the stream has been performed.
enum OpOutcome {
    /// Nothing.
    Done,
    /// The computation waits for its turn. Its frame had this length.
    Computation(Request, usize),
    /// The client is refused with this status. It violated a rule, or uses another protocol.
    Refused(Bytes),
}

/// Performs the ops of one client, one at a time. The future of an op owns the performer, and returns it.
struct Performer {
    id: ConnectionId,
    registry: Addr<Registry>,
    /// The shared memory for long frames.
    memory: Memory,
    /// Set while the reason of a failed call is sent in `values` too.
    wants_text: Arc<AtomicBool>,
    /// Whether frames may be binary. Over raw TCP they are lines of text.
    takes_binary: bool,
    /// Frames that come in pieces.
    fragments: Fragments,
    /// The memory permit of the client's long frame. It is held until the frame was performed and its answers written,
    /// and while pieces of a frame are kept.
    permit: Option<Permit>,
    /// Whether a JSON object has arrived. Then the client does not use HTTP, because a request has its head first.
    speaks_json: bool,
    /// Messages that the last op has sent to subscribers.
    deliveries: usize,
}

impl Performer {
    /// Waits for the memory permit of a long frame.
    fn room(&self) -> impl Future<Output = Permit> + 'static {
        let memory = self.memory.clone();
        async move { memory.long_frame().await }
    }

    /// Takes a memory permit. A client holds at most one, so two clients cannot block each other.
    async fn take_room(&mut self) {
        if self.permit.is_none() {
            self.permit = Some(self.room().await);
        }
    }

    /// Releases the client's memory permit, unless a long frame `is_coming` or pieces of one are kept.
    fn give_back(&mut self, is_coming: bool) {
        if !is_coming && self.fragments.allocated() <= SHORT {
            self.permit = None;
        }
    }

    /// Performs one part of the stream.
    async fn take(mut self, cut: FramePart) -> (Self, OpOutcome) {
        self.deliveries = 0;
        let outcome = self.perform_part(cut).await;
        (self, outcome)
    }

    async fn perform_part(&mut self, cut: FramePart) -> OpOutcome {
        match cut {
            FramePart::Frame(frame) => self.perform_frame(frame).await,
            FramePart::Lines(lines) => {
                self.speaks_json = true;
                self.perform(None, Op::PublishLines(lines), 0).await
            }
            FramePart::Error(FrameError::NotAnObject(start), _)
                if !self.speaks_json && !self.takes_binary && is_host_line(&start) =>
            {
                OpOutcome::Refused(refusal(Foreign::Http.explanation()))
            }
            FramePart::Error(error, start) => self.act_on(op::read_start(&start, &error), 0).await,
        }
    }

    /// Reads a frame and performs it.
    async fn perform_frame(&mut self, frame: RawFrame) -> OpOutcome {
        let length = frame.len();
        self.speaks_json = true;
        if length > MEDIUM {
            self.take_room().await;
        }
        let incoming = match read_frame(length, move || read(frame)).await {
            Ok(incoming) => incoming,
            Err(outcome) => return outcome,
        };
        let is_published = matches!(incoming.op, Ok(Op::Publish { .. } | Op::Fragment(_)));
        if length > SHORT && !is_published {
            self.take_room().await;
        }
        match self.assemble(incoming, length).await {
            Ok((incoming, length)) => self.act_on(incoming, length).await,
            Err(outcome) => outcome,
        }
    }

    /// Performs the op of a parsed frame, or sends its error.
    async fn act_on(&mut self, incoming: Incoming, length: usize) -> OpOutcome {
        let Incoming { id, op } = incoming;
        match op {
            Ok(Op::Subscribe(Subscribe { encoding, .. }))
                if encoding.compression != Compression::None && !self.takes_binary =>
            {
                self.send_error(NO_BINARY, id.as_ref()).await
            }
            Ok(op) => self.perform(id, op, length).await,
            Err(OpError::Call { service, problem }) => {
                let why = problem.to_string();
                let form = form_of(&self.wants_text);
                let failure = messages::failure(&service, id.as_ref(), &why, form);
                self.say(failure, FrameKind::End).await
            }
            Err(OpError::Goal { action, problem }) => {
                let (id, why, status) = (id.as_ref(), problem.to_string(), GoalStatus::Unknown);
                let result = messages::action_result(&action, id, &why, status as u8, false);
                self.say(result, FrameKind::End).await
            }
            Err(OpError::Status(why)) => self.send_error(&why.to_string(), id.as_ref()).await,
        }
    }

    /// Returns `incoming` unless it is a fragment. For the last missing fragment, returns the whole frame. Also returns
    /// the length of the frame.
    async fn assemble(
        &mut self,
        incoming: Incoming,
        length: usize,
    ) -> Result<(Incoming, usize), OpOutcome> {
        let Ok(Op::Fragment(piece)) = incoming.op else {
            return Ok((incoming, length));
        };
        let id = incoming.id;
        if self.fragments.allocated() + length > SHORT {
            self.take_room().await;
        }
        let whole = match self.fragments.take(piece, Instant::now().into_std()) {
            Ok(whole) => whole.ok_or(OpOutcome::Done)?,
            Err((why, start)) => {
                return Ok((under_id(op::read_start(&start, &why), id), 0));
            }
        };
        let length = whole.bytes();
        let join = move || RawFrame::of_message(whole.text().into_bytes());
        let whole = read_frame(length, move || read(join())).await?;
        let whole = match whole.op {
            Ok(Op::Fragment(_)) => Incoming {
                id,
                op: Err(Problem::NotAFrame(NESTED_FRAGMENT.to_owned()).into()),
            },
            Err(OpError::Status(Problem::NotAFrame(_))) => under_id(whole, id),
            _ => whole,
        };
        Ok((whole, length))
    }

    /// Sends the client an error status.
    async fn send_error(&self, why: &str, id: Option<&Payload>) -> OpOutcome {
        tracing::debug!(connection = self.id.0, why, "refused");
        let status = messages::status(Level::Error, why, id);
        self.say(status, FrameKind::Status(Level::Error)).await
    }

    /// Sends a frame to the client through the registry. Its mailbox may still have a response to an earlier frame,
    /// which must arrive first.
    async fn say(&self, frame: Bytes, kind: FrameKind) -> OpOutcome {
        let respond = Respond {
            connection: self.id,
            frame: cover(self.permit.as_ref(), frame),
            kind,
            done: None,
        };
        let _ = self.registry.send(respond).await;
        OpOutcome::Done
    }

    /// Sends an op to the registry. Its frame had `length` bytes.
    async fn perform(&mut self, id: Option<Payload>, op: Op, length: usize) -> OpOutcome {
        let is_computation = matches!(&op, Op::CallService(CallService { service, .. })
            if Service::from_name(service).is_some_and(Service::is_computation));
        let request = Request {
            from: self.id,
            id,
            op,
            permit: self.permit.clone(),
        };
        if is_computation {
            return OpOutcome::Computation(request, length);
        }
        if let Ok(handled) = self.registry.send(request).await {
            self.deliveries = handled.effect().await;
        }
        OpOutcome::Done
    }
}

/// The status for a client that is refused for this reason.
fn refusal(why: &str) -> Bytes {
    messages::status(Level::Error, why, None)
}

/// Parses a frame of `length` bytes. Parses a long one on a worker thread.
async fn read_frame(
    length: usize,
    read: impl FnOnce() -> Option<Incoming> + Send + 'static,
) -> Result<Incoming, OpOutcome> {
    let incoming = if length <= SHORT {
        read()
    } else {
        let incoming = run_long_work(WorkKind::of(length), read).await;
        incoming.ok_or_else(|| OpOutcome::Refused(refusal("a frame could not be read")))?
    };
    incoming.ok_or(OpOutcome::Done)
}

/// Gives an error the id of the pieces. An op, such as a bad answer, keeps its own id.
fn under_id(incoming: Incoming, id: Option<Payload>) -> Incoming {
    match incoming.op {
        Err(_) => Incoming { id, ..incoming },
        Ok(_) => incoming,
    }
}

/// Parses a complete frame, or returns its error. `None` for a message that has only white space.
fn read(frame: RawFrame) -> Option<Incoming> {
    Some(match frame.decode()? {
        Ok(frame) => op::read(&frame.text),
        Err((error, start)) => op::read_start(&start, &error),
    })
}
