//! Reads the frames of one client, and has their ops performed by the registry, one at a time.
//!
//! The actor polls the reader after each message that it has handled. So the reader may wait for the client's state
//! without a waker.
//!
//! **Invariant:** the next frame is parsed after the last op has taken effect, except for pure computations. So a
//! client's requests take effect in the order sent. A series of messages counts as one op. One poll reads a bounded
//! number of bytes and performs a bounded number of ops. Every frame becomes one op or one error.

use std::cell::{Cell, RefCell};
use std::future::{pending, poll_fn};
use std::rc::Rc;
use std::task::{self, Poll, ready};

use actix::prelude::*;
use bytes::BytesMut;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::time::{Instant, sleep, sleep_until, timeout};

use super::client::ClientState;
use super::flow::{Ends, has_closed};
use super::session::HeldPlace;
use super::transport::{ClientLost, Transport};
use super::turns::Turns;
use crate::actors::gateway::limits::{
    CLOSED_CHECK, DISCARD_BYTES, DISCARD_TIME, FRAME_TIME, FRAMES_IN_A_ROW, LOOK_AGAIN, READ_BYTES,
    RESPONSES_TIME,
};
use crate::actors::gateway::registry::{Disconnect, Registry, Request, Retire};
use crate::actors::resources::long_work::{WorkKind, run_long_work};
use crate::actors::resources::memory::{Memory, Permit, SHORT};
use crate::protocol::catalog::Service;
use crate::protocol::limits::MEDIUM;
use crate::protocol::op::{
    self, CallService, Compression, Incoming, Op, OpError, Problem, Subscribe,
};
use crate::protocol::wire::fragments::{Fragments, MAX_AGE};
use crate::protocol::wire::frame::{Foreign, FrameError, FramePart, RawFrame, is_host_line};
use crate::protocol::wire::json::Payload;

/// The error for a frame that takes longer than [`FRAME_TIME`].
const TOO_SLOW: &str = "a frame that has begun must be complete within a minute";
/// The error for a client that requests binary frames over raw TCP.
const NO_BINARY: &str = "subscribe: compression cbor and cbor-raw need WebSocket; \
                         over raw TCP every frame is a line of JSON";
const NESTED_FRAGMENT: &str = "fragment: the joined pieces must not be a fragment";

/// The reading half of a connection.
pub(super) struct ClientReader<S> {
    client: Rc<RefCell<ClientState<S>>>,
    registry: Addr<Registry>,
    place: HeldPlace,
    ends: Ends,
    /// The shared memory for long frames.
    memory: Memory,
    /// Whether frames may be binary. Over raw TCP they are lines of text.
    takes_binary: bool,
    /// Received bytes that the transport has not read yet.
    chunk: BytesMut,
    /// The stream has ended. Earlier bytes may still wait.
    has_ended: bool,
    /// Deadline of the incomplete frame. It is set only while the reader waits for the rest.
    frame_due: Option<Instant>,
    /// Frames that come in pieces.
    fragments: Fragments,
    /// The memory permit of the client's long frame. It is held until the frame was performed and its answers written,
    /// and while pieces of a frame are kept.
    permit: Option<Permit>,
    /// Whether a JSON object has arrived. Then the client does not use HTTP, because a request has its head first.
    speaks_json: bool,
    turns: Turns,
    spent: Rc<Spent>,
}

/// The work of one poll of the reader.
#[derive(Default)]
struct Spent {
    /// Bytes that were given to the transport.
    bytes: Cell<usize>,
    /// Performed ops, and deliveries of their messages.
    ops: Cell<usize>,
}

impl<S: AsyncRead + AsyncWrite + Unpin> ClientReader<S> {
    /// A reader of a client with a place, whose bytes `first` have been read.
    pub(super) fn new(
        client: &Rc<RefCell<ClientState<S>>>,
        place: HeldPlace,
        first: BytesMut,
    ) -> Self {
        let state = client.borrow();
        Self {
            client: Rc::clone(client),
            registry: state.registry.clone(),
            place,
            ends: state.ends,
            memory: state.gauges.memory().clone(),
            takes_binary: state.transport.as_ref().is_some_and(Transport::is_socket),
            chunk: first,
            has_ended: false,
            frame_due: None,
            fragments: Fragments::default(),
            permit: None,
            speaks_json: false,
            turns: Turns::default(),
            spent: Rc::default(),
        }
    }

    /// Reads until the client ends or is refused, then lets the connection finish.
    pub(super) fn run(self) -> impl Future<Output = ()> {
        let spent = Rc::clone(&self.spent);
        let mut reading = Box::pin(self.read_to_the_end());
        poll_fn(move |cx| {
            spent.bytes.set(0);
            spent.ops.set(0);
            reading.as_mut().poll(cx)
        })
    }

    async fn read_to_the_end(mut self) {
        match self.read_frames().await {
            Ok(()) => self.retire().await,
            Err(lost) => self.client.borrow_mut().is_refused |= lost == ClientLost::Refused,
        }
        // Nobody waits for the computations any more: a broken stream takes no answers.
        self.client.borrow_mut().abandon_computations();
        (self.fragments, self.permit) = (Fragments::default(), None);
        // Answers already sent arrive before the registry's reply.
        let _ = self.registry.send(Disconnect(self.place.id())).await;
        self.client.borrow_mut().is_finishing = true;
        if self.client.borrow().is_refused {
            discard_input(self.client).await;
        }
    }

    /// Handles frames until the stream ends or the client is refused. Returns an error if the stream broke.
    async fn read_frames(&mut self) -> Result<(), ClientLost> {
        loop {
            if self.chunk.is_empty() && !self.has_ended && !self.read().await? {
                self.client.borrow_mut().refuse(TOO_SLOW);
                return Ok(());
            }
            if self.chunk.is_empty() {
                break;
            }
            self.spent.bytes.update(|bytes| bytes + self.chunk.len());
            self.client.borrow_mut().transport()?.push(&self.chunk);
            self.chunk.clear();
            while let Some(part) = self.cut().await? {
                let deliveries = self.perform_part(part).await;
                if self.client.borrow().is_refused {
                    return Ok(());
                }
                self.spent.ops.update(|ops| ops + 1 + deliveries);
                if self.spent.ops.get() >= FRAMES_IN_A_ROW {
                    self.turns.pause().await;
                }
            }
            // A client with messages is read until it answers the close frame.
            if self.client.borrow().is_finishing && !self.takes_binary {
                break;
            }
            if self.permit.is_none() && self.client.borrow_mut().transport()?.is_long_coming() {
                self.wait_for_room().await?;
            }
            // All chunks of a long frame may be available at once.
            if self.spent.bytes.get() >= READ_BYTES / 2 {
                self.turns.pause().await;
            }
        }
        let unfinished = self.client.borrow_mut().transport()?.finish();
        if let Some(error) = unfinished {
            self.turns.pause().await;
            self.perform_part(FramePart::Error(error, Vec::new())).await;
        }
        Ok(())
    }

    /// Waits until the client may be read, and cuts off its next frame, if that is complete.
    async fn cut(&mut self) -> Result<Option<FramePart>, ClientLost> {
        self.wait_until_may_read().await?;
        let client = &mut *self.client.borrow_mut();
        let transport = client.transport.as_mut().ok_or(ClientLost::Gone)?;
        give_back(
            &mut self.permit,
            &self.fragments,
            transport.is_long_coming(),
        );
        let part = transport.cut()?;
        if part.is_some() || !transport.is_unfinished() {
            self.frame_due = None;
        }
        match &part {
            Some(FramePart::Lines(_)) => client.is_single = false,
            Some(FramePart::Frame(frame)) => client.is_single = !frame.newline(),
            Some(FramePart::Error(..)) | None => {}
        }
        Ok(part)
    }

    /// Reads more data. Returns false if an incomplete frame takes too long. Meanwhile drops expired pieces of messages.
    async fn read(&mut self) -> Result<bool, ClientLost> {
        if let Poll::Ready(read) = poll_fn(|cx| Poll::Ready(self.poll_read(cx))).await {
            return read.map(|()| true);
        }
        self.turns.rest();
        loop {
            let is_unfinished = self.client.borrow_mut().transport()?.is_unfinished();
            let begin = || Instant::now() + FRAME_TIME;
            let late = is_unfinished.then(|| *self.frame_due.get_or_insert_with(begin));
            let began = self.fragments.began().map(Instant::from_std);
            let old = began.map(|began| began + MAX_AGE + LOOK_AGAIN);
            let due = late.into_iter().chain(old).min();
            tokio::select! {
                biased;
                read = poll_fn(|cx| self.poll_read(cx)) => return read.map(|()| true),
                () = passed(due) => {}
            }
            let now = Instant::now();
            let mut client = self.client.borrow_mut();
            let transport = client.transport()?;
            if late.is_some_and(|late| late <= now) {
                return transport.give_up(TOO_SLOW).map(|()| false);
            }
            self.fragments.forget_old(now.into_std());
            give_back(
                &mut self.permit,
                &self.fragments,
                transport.is_long_coming(),
            );
        }
    }

    fn poll_read(&mut self, cx: &mut task::Context<'_>) -> Poll<Result<(), ClientLost>> {
        let mut client = self.client.borrow_mut();
        let bytes = ready!(client.transport()?.poll_read(cx, &mut self.chunk))?;
        self.has_ended = bytes == 0;
        Poll::Ready(Ok(()))
    }

    /// Waits until enough was written and computed that the client may be read. Meanwhile reads up to [`READ_BYTES`]
    /// bytes, to detect the end of the stream. Returns an error if the client has disconnected. A client that has ended
    /// its stream counts as disconnected if nothing was written for [`RESPONSES_TIME`].
    async fn wait_until_may_read(&mut self) -> Result<(), ClientLost> {
        let (ends, mut ended) = (self.ends, None);
        while !self.client.borrow().may_read() {
            self.frame_due = None;
            let since = self
                .has_ended
                .then(|| *ended.get_or_insert_with(Instant::now));
            let progress = self.client.borrow().progress;
            let due = since.map(|since| since.max(progress) + RESPONSES_TIME);
            if due.is_some_and(|due| due <= Instant::now()) {
                return Err(ClientLost::Gone);
            }
            tokio::select! {
                biased;
                ahead = poll_fn(|cx| self.poll_ahead(cx)) => ahead?,
                () = closed(ends), if due.is_some() => return Err(ClientLost::Gone),
                () = passed(due) => {}
            }
        }
        Ok(())
    }

    /// Reads some bytes while the client must not be read. Ready at once when it may be.
    fn poll_ahead(&mut self, cx: &mut task::Context<'_>) -> Poll<Result<(), ClientLost>> {
        let mut client = self.client.borrow_mut();
        if client.may_read() {
            return Poll::Ready(Ok(()));
        }
        let taken = client.transport()?.taken_ahead();
        drop(client);
        if self.has_ended || self.chunk.len() + taken >= READ_BYTES {
            return Poll::Pending;
        }
        ready!(self.poll_read(cx))?;
        let mut client = self.client.borrow_mut();
        Poll::Ready(client.transport()?.look_ahead(&mut self.chunk))
    }

    /// Waits for the memory permit of the incoming long frame. The end of the stream comes after bytes that are not read
    /// without a permit.
    async fn wait_for_room(&mut self) -> Result<(), ClientLost> {
        self.frame_due = None;
        let ends = self.ends;
        tokio::select! {
            biased;
            () = self.take_room() => Ok(()),
            () = closed(ends) => Err(ClientLost::Gone),
        }
    }

    /// Withdraws the client's registrations, because it can no longer answer calls. The client may still read, so this
    /// waits for the pending responses.
    async fn retire(&self) {
        let retired = self.registry.send(Retire(self.place.id()));
        let answered = async {
            if let Ok(handled) = retired.await {
                handled.effect().await;
            }
            poll_fn(|_| match self.client.borrow().is_computing() {
                true => Poll::Pending,
                false => Poll::Ready(()),
            })
            .await;
        };
        tokio::select! {
            biased;
            () = answered => {}
            () = closed(self.ends) => {}
            () = sleep(RESPONSES_TIME) => {}
        }
    }
}

/// Releases the client's memory permit, unless a long frame `is_coming` or pieces of one are kept.
fn give_back(permit: &mut Option<Permit>, fragments: &Fragments, is_coming: bool) {
    if !is_coming && fragments.allocated() <= SHORT {
        *permit = None;
    }
}

/// Ends at `due`, if there is a deadline.
async fn passed(due: Option<Instant>) {
    match due {
        Some(due) => sleep_until(due).await,
        None => pending().await,
    }
}

/// Ends when the client has closed its socket, if that can be detected.
async fn closed(ends: Ends) {
    while !has_closed(ends) {
        sleep(CLOSED_CHECK).await;
    }
}

/// Reads and discards the input of a refused client, up to a limit.
pub(super) async fn discard_input<S>(client: Rc<RefCell<ClientState<S>>>)
where
    S: AsyncRead + AsyncWrite + Unpin,
{
    let discarding = async {
        let (mut chunk, mut left) = (BytesMut::new(), DISCARD_BYTES);
        let mut turns = Turns::default();
        loop {
            chunk.clear();
            let read = poll_fn(|cx| client.borrow_mut().transport()?.poll_read(cx, &mut chunk));
            match read.await {
                Ok(bytes) if bytes > 0 && bytes < left => left -= bytes,
                _ => return,
            }
            turns.pause().await;
        }
    };
    let _ = timeout(DISCARD_TIME, discarding).await;
}

// ---- from a frame to its effect -------------------------------------------------------------------------------------

impl<S> ClientReader<S> {
    /// Performs one part of the stream. Returns how many messages were sent to subscribers.
    async fn perform_part(&mut self, part: FramePart) -> usize {
        let (incoming, length) = match part {
            FramePart::Frame(frame) => {
                self.speaks_json = true;
                match self.read_frame(frame).await {
                    Some(read) => read,
                    None => return 0,
                }
            }
            FramePart::Lines(lines) => {
                self.speaks_json = true;
                let op = Ok(Op::PublishLines(lines));
                (Incoming { id: None, op }, 0)
            }
            FramePart::Error(FrameError::NotAnObject(start), _)
                if !self.speaks_json && !self.takes_binary && is_host_line(&start) =>
            {
                self.client.borrow_mut().refuse(Foreign::Http.explanation());
                return 0;
            }
            FramePart::Error(error, start) => (op::read_start(&start, &error), 0),
        };
        self.perform(incoming, length).await
    }

    /// Reads a frame and its length. `None` if nothing is to be performed.
    async fn read_frame(&mut self, frame: RawFrame) -> Option<(Incoming, usize)> {
        let length = frame.len();
        if length > MEDIUM {
            self.take_room().await;
        }
        let incoming = self.parse(length, move || frame).await?;
        let is_published = matches!(incoming.op, Ok(Op::Publish { .. } | Op::Fragment(_)));
        if length > SHORT && !is_published {
            self.take_room().await;
        }
        let Incoming { id, op } = incoming;
        let Ok(Op::Fragment(piece)) = op else {
            return Some((Incoming { id, op }, length));
        };
        if self.fragments.allocated() + length > SHORT {
            self.take_room().await;
        }
        let whole = match self.fragments.take(piece, Instant::now().into_std()) {
            Ok(whole) => whole?,
            Err((why, start)) => return Some((under_id(op::read_start(&start, &why), id), 0)),
        };
        let length = whole.bytes();
        let join = move || RawFrame::of_message(whole.text().into_bytes());
        let whole = self.parse(length, join).await?;
        let whole = match whole.op {
            Ok(Op::Fragment(_)) => Incoming {
                id,
                op: Err(Problem::NotAFrame(NESTED_FRAGMENT.to_owned()).into()),
            },
            Err(OpError::Status(Problem::NotAFrame(_))) => under_id(whole, id),
            _ => whole,
        };
        Some((whole, length))
    }

    /// Takes a memory permit. A client holds at most one, so two clients cannot block each other.
    async fn take_room(&mut self) {
        if self.permit.is_none() {
            self.permit = Some(self.memory.long_frame().await);
        }
    }

    /// Parses a frame of `length` bytes, or returns its error. Parses a long one on a worker thread. `None` for a message
    /// that has only white space.
    async fn parse(
        &self,
        length: usize,
        frame: impl FnOnce() -> RawFrame + Send + 'static,
    ) -> Option<Incoming> {
        let parse = move || {
            Some(match frame().decode()? {
                Ok(frame) => op::read(&frame.text),
                Err((error, start)) => op::read_start(&start, &error),
            })
        };
        if length <= SHORT {
            return parse();
        }
        let parsed = run_long_work(WorkKind::of(length), parse).await;
        if parsed.is_none() {
            self.client.borrow_mut().refuse("a frame could not be read");
        }
        parsed?
    }

    /// Sends an op, or the error of its frame, to the registry. The frame had `length` bytes.
    async fn perform(&mut self, mut incoming: Incoming, length: usize) -> usize {
        let mut is_computation = false;
        match &incoming.op {
            Ok(Op::Subscribe(Subscribe { encoding, .. }))
                if encoding.compression != Compression::None && !self.takes_binary =>
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
            from: self.place.id(),
            incoming,
            permit: self.permit.clone(),
        };
        if is_computation {
            self.client
                .borrow_mut()
                .enqueue_computation(request, length);
            return 0;
        }
        match self.registry.send(request).await {
            Ok(handled) => handled.effect().await,
            Err(_) => 0,
        }
    }
}

/// Gives an error the id of the pieces. An op, such as a bad answer, keeps its own id.
fn under_id(incoming: Incoming, id: Option<Payload>) -> Incoming {
    match incoming.op {
        Err(_) => Incoming { id, ..incoming },
        Ok(_) => incoming,
    }
}
