//! HTTP and WebSocket clients: a request is answered and that is all, or the stream becomes a WebSocket and its client is
//! one like any other.
//!
//! A WebSocket message is a frame. What is asked of the protocol beside that is done here: both sides of the stream keep
//! sharing one socket, for reading a ping means writing a pong; a peer that shows no sign of life is given up.
//!
//! **Invariant:** over WebSocket no status is sent before the client has asked for such.

use std::cell::{Cell, RefCell};
use std::future::poll_fn;
use std::io;
use std::pin::Pin;
use std::rc::Rc;
use std::task::{Context, Poll};
use std::time::Duration;

use bytes::{Bytes, BytesMut};
use futures_util::{SinkExt, StreamExt};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Instant, sleep_until};
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::error::{CapacityError, Error};
use tokio_tungstenite::tungstenite::protocol::frame::coding::{CloseCode, Data, OpCode};
use tokio_tungstenite::tungstenite::protocol::frame::{CloseFrame, Frame, Utf8Bytes};
use tokio_tungstenite::tungstenite::protocol::{Role, WebSocketConfig};

use super::Shared;
use super::gate::HEAD_TIME;
use super::reception::Reception;
use super::transport::{Inbound, Outbound, read_some};
use super::unfinished::{FRAME_TIME, Unfinished};
use crate::actors::ConnectionId;
use crate::actors::registry::Request;
use crate::protocol::frame::MAX_FRAME;
use crate::protocol::op::{Op, Verbosity};
use crate::web::{message, serve};

/// How often a peer is asked for a sign of life: often enough for whatever between us forgets silent connections.
pub(super) const PING_INTERVAL: Duration = Duration::from_secs(15);
/// How long a peer that was asked may be silent. Any byte that it sends or takes counts, not only the pong: that can be a
/// long way behind in a full pipe.
pub(super) const PONG_TIME: Duration = Duration::from_secs(30);
/// Bytes of payload in one WebSocket frame and in one write; a longer message goes in fragments, so that a client is seen
/// to take it.
const FRAGMENT: usize = 64 * 1024;
/// Buffer of a WebSocket for what comes in. It is there as long as the connection, so it is small.
const READ_BUFFER: usize = 8 * 1024;

impl Reception {
    /// Serves a client that has begun an HTTP request with `first`.
    pub(super) async fn serve_web<S>(self, mut stream: S, id: ConnectionId, first: BytesMut)
    where
        S: AsyncRead + AsyncWrite + Unpin + 'static,
    {
        let door = &self.gate.door;
        let behind = tokio::select! {
            biased;
            () = self.shared.finished() => return,
            behind = serve::serve(&mut stream, first, door, self.local, HEAD_TIME) => behind,
        };
        let Some(behind) = behind else {
            return;
        };
        let quiet = Request {
            from: id,
            id: None,
            op: Op::SetLevel(Verbosity::NONE),
        };
        let _ = self.registry.send(quiet).await;
        self.shared.binary.set(true);
        let unfinished = Unfinished::new(&self.shared.gauges.totals().input);
        let link = Link::open(stream, &behind, unfinished).await;
        let input = Input::new(Rc::clone(&link), Rc::clone(&self.shared));
        let output = Output {
            link,
            shared: Rc::clone(&self.shared),
            unfinished: None,
        };
        // Whoever got here has shown the token already, if there is one.
        let reader = self.reader(id, None);
        self.talk(reader, input, output, BytesMut::new()).await;
    }
}

/// What both halves share; one thread, so plain cells do.
struct Link<S> {
    socket: RefCell<WebSocketStream<Watched<S>>>,
    /// When the peer last sent or took a byte.
    life: Rc<Cell<Instant>>,
    /// The peer is to be asked for a sign of life.
    ping_is_due: Cell<bool>,
    /// Why the connection ends, for the peer to know.
    farewell: Cell<(CloseCode, &'static str)>,
}

impl<S: AsyncRead + AsyncWrite + Unpin> Link<S> {
    /// Takes a stream on which the handshake has been made; `behind` came after it.
    async fn open(stream: S, behind: &[u8], unfinished: Unfinished) -> Rc<Self> {
        let life = Rc::new(Cell::new(Instant::now()));
        let watched = Watched {
            stream,
            life: Rc::clone(&life),
            is_blocked: false,
            unfinished,
            pending: 0,
            began: None,
            is_complete: false,
            no_room: false,
        };
        let config = WebSocketConfig::default()
            .read_buffer_size(READ_BUFFER)
            .write_buffer_size(FRAGMENT)
            .max_message_size(Some(MAX_FRAME))
            .max_frame_size(Some(MAX_FRAME));
        let role = Role::Server;
        let socket =
            WebSocketStream::from_partially_read(watched, behind.to_vec(), role, Some(config));
        Rc::new(Self {
            socket: RefCell::new(socket.await),
            life,
            ping_is_due: Cell::new(false),
            farewell: Cell::new((CloseCode::Away, "shutting down")),
        })
    }

    /// The next message; `None` once the connection is closed.
    async fn next(&self) -> Option<Result<Message, Error>> {
        poll_fn(|cx| self.socket.borrow_mut().poll_next_unpin(cx)).await
    }

    /// Puts a message where [`Link::flush`] finds it; `None` if the peer is gone.
    fn put(&self, message: Message) -> Option<()> {
        self.socket.borrow_mut().start_send_unpin(message).ok()
    }

    /// Waits until all that was put there has been written; `None` if the peer is gone.
    async fn flush(&self) -> Option<()> {
        poll_fn(|cx| self.socket.borrow_mut().poll_flush_unpin(cx))
            .await
            .ok()
    }
}

/// The receiving half.
struct Input<S> {
    link: Rc<Link<S>>,
    shared: Rc<Shared>,
    next_ping: Instant,
    /// Since when a sign of life has been waited for.
    asked: Option<Instant>,
    /// When the last read ended.
    read_until: Instant,
}

impl<S: AsyncRead + AsyncWrite + Unpin> Input<S> {
    fn new(link: Rc<Link<S>>, shared: Rc<Shared>) -> Self {
        let now = Instant::now();
        Self {
            link,
            shared,
            next_ping: now + PING_INTERVAL,
            asked: None,
            read_until: now,
        }
    }

    /// The next message; an error if the peer shows no sign of life.
    async fn next(&mut self) -> io::Result<Option<Result<Message, Error>>> {
        loop {
            let pong_due = self.asked.map(|asked| asked + PONG_TIME);
            let late = self.link.socket.borrow().get_ref().late();
            let due = pong_due.into_iter().chain(late).min();
            let wake = due.map_or(self.next_ping, |due| due.min(self.next_ping));
            tokio::select! {
                biased;
                message = self.link.next() => return Ok(message),
                () = sleep_until(wake) => self.look_for_life()?,
            }
        }
    }

    /// A message is complete.
    fn take(&self, message: &[u8], chunk: &mut BytesMut) {
        message::append_line(message, chunk);
        self.link.socket.borrow_mut().get_mut().is_complete = true;
    }

    fn look_for_life(&mut self) -> io::Result<()> {
        let now = Instant::now();
        let late = self.link.socket.borrow().get_ref().late();
        if late.is_some_and(|late| late <= now) {
            self.link.farewell.set((CloseCode::Policy, TOO_SLOW));
            self.shared.refusing.set(true);
            return Err(io::ErrorKind::TimedOut.into());
        }
        if let Some(asked) = self.asked {
            if self.link.life.get() > asked {
                self.asked = None;
            } else if now >= asked + PONG_TIME {
                self.link.farewell.set((CloseCode::Away, "no sign of life"));
                return Err(io::ErrorKind::TimedOut.into());
            }
        }
        if now >= self.next_ping {
            self.next_ping = now + PING_INTERVAL;
            self.asked.get_or_insert(now);
            self.link.ping_is_due.set(true);
            self.shared.outgoing.notify_one();
        }
        Ok(())
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin> Inbound for Input<S> {
    async fn read(&mut self, chunk: &mut BytesMut) -> io::Result<usize> {
        // While nothing was read, no sign of life could be seen.
        let unread = self.read_until.elapsed();
        self.asked = self.asked.map(|asked| asked + unread);
        self.link.socket.borrow_mut().get_mut().read_on(unread);
        let before = chunk.len();
        while chunk.len() == before {
            match self.next().await? {
                Some(Ok(Message::Text(text))) => self.take(text.as_bytes(), chunk),
                Some(Ok(Message::Binary(bytes))) => self.take(&bytes, chunk),
                // Pings and closes are answered by the library, as soon as reading goes on; frames never come out of it.
                Some(Ok(control)) => {
                    let mut socket = self.link.socket.borrow_mut();
                    socket.get_mut().control(control.len());
                }
                // The peer has closed, and takes no answers any more.
                None => return Err(io::ErrorKind::ConnectionAborted.into()),
                Some(Err(error)) => {
                    let no_room = self.link.socket.borrow().get_ref().no_room;
                    let why = if no_room { NO_ROOM } else { farewell(&error) };
                    self.link.farewell.set(why);
                    self.shared.refusing.set(true);
                    return Err(io::ErrorKind::InvalidData.into());
                }
            }
        }
        self.read_until = Instant::now();
        Ok(chunk.len() - before)
    }

    async fn swallow(&mut self, chunk: &mut BytesMut) -> io::Result<usize> {
        let link = &self.link;
        poll_fn(|cx| {
            let mut socket = link.socket.borrow_mut();
            let mut reading = std::pin::pin!(read_some(socket.get_mut(), chunk));
            reading.as_mut().poll(cx)
        })
        .await
    }
}

/// What a peer is told whose message takes longer than [`FRAME_TIME`].
const TOO_SLOW: &str = "a message that has begun must be complete within a minute";
/// What a peer is told for whose message there is no room.
const NO_ROOM: (CloseCode, &str) = (
    CloseCode::Again,
    "too many unfinished messages of all clients; try again later",
);

/// What a peer is told that broke a rule.
fn farewell(error: &Error) -> (CloseCode, &'static str) {
    match error {
        Error::Capacity(CapacityError::MessageTooLong { .. }) => {
            (CloseCode::Size, "a message has at most 4 MiB")
        }
        Error::Utf8(_) => (CloseCode::Invalid, "a text message is UTF-8"),
        _ => (CloseCode::Protocol, "not as RFC 6455 has it"),
    }
}

/// The sending half.
struct Output<S> {
    link: Rc<Link<S>>,
    shared: Rc<Shared>,
    /// What the first frame of the next write goes on with, if it does not begin a message.
    unfinished: Option<Data>,
}

impl<S: AsyncRead + AsyncWrite + Unpin> Outbound for Output<S> {
    const END_IS_ANSWERED: bool = true;

    async fn write(&mut self, frames: &[Bytes]) -> Option<usize> {
        let mut written = 0;
        for frame in frames {
            let room = FRAGMENT.saturating_sub(written);
            if written > 0 && frame.len() > room {
                break;
            }
            let kind = self.unfinished.unwrap_or_else(|| kind_of(frame));
            let (piece, is_last) = first_piece(frame, kind == Data::Text, room);
            written += piece.len();
            let is_whole = piece.len() == frame.len();
            let opcode = match self.unfinished {
                Some(_) => Data::Continue,
                None => kind,
            };
            self.unfinished = (!is_last).then_some(kind);
            let payload = match piece.strip_suffix(b"\n") {
                Some(line) if is_last && kind == Data::Text => piece.slice_ref(line),
                _ => piece,
            };
            let part = Frame::message(payload, OpCode::Data(opcode), is_last);
            self.link.put(Message::Frame(part))?;
            if !is_whole {
                break;
            }
        }
        self.link.flush().await?;
        Some(written)
    }

    async fn tend(&mut self) -> Option<()> {
        if !self.link.ping_is_due.take() {
            return Some(());
        }
        self.link.put(Message::Ping(Bytes::new()))?;
        self.link.flush().await
    }

    async fn end(&mut self) -> io::Result<()> {
        let (code, why) = self.link.farewell.get();
        let reason = Utf8Bytes::from_static(why);
        let gone = || io::Error::from(io::ErrorKind::ConnectionAborted);
        let close = Message::Close(Some(CloseFrame { code, reason }));
        self.link.put(close).ok_or_else(gone)?;
        self.link.flush().await.ok_or_else(gone)?;
        if !self.shared.refusing.get() {
            return Ok(());
        }
        // Nothing that it sends is looked at any more, a close frame included: the stream's own end has to do.
        poll_fn(|cx| Pin::new(self.link.socket.borrow_mut().get_mut()).poll_shutdown(cx)).await
    }
}

/// How a frame goes out: JSON begins with a brace, CBOR never does.
fn kind_of(frame: &Bytes) -> Data {
    if frame.first() == Some(&b'{') {
        Data::Text
    } else {
        Data::Binary
    }
}

/// As much of a frame as there is room for in one WebSocket frame, and whether a message ends there. A text may be several
/// messages, one per line.
fn first_piece(frame: &Bytes, is_text: bool, room: usize) -> (Bytes, bool) {
    let offered = frame.slice(..frame.len().min(room));
    if !is_text {
        let is_last = offered.len() == frame.len();
        return (offered, is_last);
    }
    match offered.iter().position(|&byte| byte == b'\n') {
        Some(end) => (offered.slice(..=end), true),
        None => (offered, false),
    }
}

/// A stream that notes when its other side last gave a sign of life: sent a byte, or took one after having taken none. And what it
/// has sent of a message that is not complete yet.
struct Watched<S> {
    stream: S,
    life: Rc<Cell<Instant>>,
    /// The last write found no room: the next that does shows that there is somebody.
    is_blocked: bool,
    unfinished: Unfinished,
    /// Bytes that belong to no complete message yet.
    pending: usize,
    /// When the first of them came, later by the time that nothing was read.
    began: Option<Instant>,
    /// They do now.
    is_complete: bool,
    /// There was no room for them.
    no_room: bool,
}

/// Bytes of a control frame beside its payload: two, and the mask's four.
const CONTROL_HEAD: usize = 6;

impl<S> Watched<S> {
    /// Reading goes on after so long a time: what was complete has been dealt with.
    fn read_on(&mut self, unread: Duration) {
        if std::mem::take(&mut self.is_complete) {
            self.settle(0);
        }
        self.began = self.began.map(|began| began + unread);
    }

    /// A control frame with so much payload has come: it may stand between the parts of a message.
    fn control(&mut self, payload: usize) {
        self.settle(self.pending.saturating_sub(CONTROL_HEAD + payload));
    }

    fn settle(&mut self, pending: usize) {
        self.pending = pending;
        if pending == 0 {
            self.began = None;
        }
        // Less always fits.
        let _ = self.unfinished.keep(pending);
    }

    /// When the message that has begun is late.
    fn late(&self) -> Option<Instant> {
        self.began.map(|began| began + FRAME_TIME)
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Watched<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        let polled = Pin::new(&mut self.stream).poll_read(cx, buffer);
        let received = buffer.filled().len() - before;
        if received > 0 {
            let now = Instant::now();
            self.life.set(now);
            self.began.get_or_insert(now);
            self.pending += received;
            let pending = self.pending;
            if !self.unfinished.keep(pending) {
                self.no_room = true;
                return Poll::Ready(Err(io::ErrorKind::QuotaExceeded.into()));
            }
        }
        polled
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Watched<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let polled = Pin::new(&mut self.stream).poll_write(cx, bytes);
        if polled.is_ready() && self.is_blocked {
            self.life.set(Instant::now());
        }
        self.is_blocked = polled.is_pending();
        polled
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}
