//! HTTP and WebSocket clients: requests are answered, until the client ends or opens a WebSocket. Then it is served
//! like any other.
//!
//! A WebSocket message is a frame. The rest of the protocol is done here. Both halves share one socket, since reading a
//! ping means writing a pong. A peer that shows no sign of life is given up.
//!
//! **Invariant:** over WebSocket no status is sent before the client has asked for such.

mod link;
mod watched;

use std::cell::Cell;
use std::future::{pending, poll_fn};
use std::io;
use std::pin::{Pin, pin};
use std::rc::Rc;
use std::task::Poll;
use std::time::Duration;

use bytes::{Buf, Bytes, BytesMut};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::time::{Instant, sleep_until};
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::error::{CapacityError, Error};
use tokio_tungstenite::tungstenite::protocol::frame::coding::{CloseCode, Data, OpCode};
use tokio_tungstenite::tungstenite::protocol::frame::{CloseFrame, Frame, Utf8Bytes};

use self::link::{FRAGMENT, Link};
use super::admission::authentication::AuthError;
use super::admission::slots::HeldSlot;
use super::session::{ClientSession, Newcomer};
use super::shared::{Ending, Shared};
use super::transport::{CHUNK, Inbound, Outbound, read_some};
use crate::actors::gateway::limits::OPENING_TIME;
use crate::actors::gateway::messages::{Outlets, Refused, Request};
use crate::actors::resources::memory::{Permit, SHORT};
use crate::protocol::messages::ErrorForm;
use crate::protocol::op::{Op, Verbosity};
use crate::protocol::wire::frame::FrameReader;
use crate::web::message::OneLine;
use crate::web::serve::{self, Gate};

/// Ping interval: below the idle timeouts of NATs and proxies.
pub(super) const PING_INTERVAL: Duration = Duration::from_secs(15);
/// How long a peer that was asked may be silent. Any byte that it sends or takes counts, not only the pong, which can
/// be far behind in a full pipe.
pub(super) const PONG_TIME: Duration = Duration::from_secs(30);

/// Decides about the requests of one client.
struct HttpGate<'a> {
    session: &'a ClientSession,
    /// The ways to a client that has no place yet.
    outlets: Cell<Option<Outlets>>,
    /// Its slot, and why it is turned away without.
    newcomer: Option<(HeldSlot<'a>, Option<Refused>)>,
}

impl Gate for HttpGate<'_> {
    async fn admit(&self) -> Result<(), String> {
        let Some(outlets) = self.outlets.take() else {
            return Ok(());
        };
        if let Some((slot, _)) = &self.newcomer {
            slot.give_back();
        }
        let slot = self.session.admission.newcomers.waiting.take();
        let due = Instant::now() + OPENING_TIME;
        let place = self.session.wait_for_place(&outlets, &slot, due).await;
        place.map(drop).map_err(|why| {
            self.session.count_refusal(why);
            why.to_string()
        })
    }

    async fn delay(&self) -> bool {
        self.session.delay_wrong_token().await
    }
}

impl HttpGate<'_> {
    /// Ends when the connection has to: with a sentence, if its slot is another client's.
    async fn cut_off(&self) -> Option<String> {
        let evicted = async {
            let Some((slot, refused)) = &self.newcomer else {
                return pending().await;
            };
            slot.evicted().await;
            match *refused {
                None => AuthError::Crowded.to_string(),
                Some(why) => {
                    self.session.count_refusal(why);
                    why.to_string()
                }
            }
        };
        tokio::select! {
            () = self.session.shared.finished() => None,
            why = evicted => Some(why),
        }
    }
}

impl ClientSession {
    /// Answers the requests of a client, and speaks with it once it has opened a WebSocket. A newcomer has no place
    /// before its first request is admitted.
    pub(super) async fn serve_http<S>(
        &self,
        stream: S,
        first: BytesMut,
        due: Instant,
        newcomer: Option<Newcomer<'_>>,
    ) where
        S: AsyncRead + AsyncWrite + Unpin + 'static,
    {
        let (outlets, newcomer) = newcomer
            .map(|newcomer| (newcomer.outlets, (newcomer.slot, newcomer.refused)))
            .unzip();
        let gate = HttpGate {
            session: self,
            outlets: Cell::new(outlets),
            newcomer,
        };
        let place = (&self.admission.site, self.ends.local);
        let cut_off = gate.cut_off();
        let served = serve::serve(stream, first, due, place, &gate, cut_off).await;
        let (Some((stream, behind)), Some(id)) = (served, self.shared.id.get()) else {
            return;
        };
        let quiet = Request {
            from: id,
            id: None,
            op: Op::SetLevel {
                verbosity: Verbosity::NONE,
                errors: Some(ErrorForm::Text),
            },
            permit: None,
        };
        let _ = self.shared.registry.send(quiet).await;
        let link = Link::open(stream, behind, &self.shared).await;
        let input = Input::new(Rc::clone(&link), Rc::clone(&self.shared));
        let output = Output {
            link,
            shared: Rc::clone(&self.shared),
            unfinished: None,
        };
        let reader = self.reader(id, FrameReader::of_messages());
        self.talk(reader, input, output, BytesMut::new()).await;
    }
}

/// The receiving half.
struct Input<S> {
    link: Rc<Link<S>>,
    shared: Rc<Shared>,
    next_ping: Instant,
    /// The time since which a sign of life has been waited for.
    asked: Option<Instant>,
    /// When the last read ended; none while one is under way, also one that was given up.
    unread_since: Option<Instant>,
    /// The message that has come, while some of it has not been read.
    line: Option<OneLine>,
    /// A long message, kept until the library reads on: it would keep the memory of one that is gone for the next.
    spent: Option<Bytes>,
}

impl<S: AsyncRead + AsyncWrite + Unpin> Input<S> {
    fn new(link: Rc<Link<S>>, shared: Rc<Shared>) -> Self {
        let now = Instant::now();
        Self {
            link,
            shared,
            next_ping: now + PING_INTERVAL,
            asked: None,
            unread_since: Some(now),
            line: None,
            spent: None,
        }
    }

    /// The next message; an error if the peer shows no sign of life.
    async fn next(&mut self) -> io::Result<Option<Result<Message, Error>>> {
        if self.spent.is_some() {
            let mut next = pin!(self.link.next());
            let polled = poll_fn(|cx| Poll::Ready(next.as_mut().poll(cx))).await;
            self.spent = None;
            if let Poll::Ready(message) = polled {
                return Ok(message);
            }
        }
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

    /// Takes what is still to be read of a message: a long one as it would come over TCP, a chunk at a time.
    fn take(&mut self, mut line: OneLine, chunk: &mut BytesMut) {
        if !line.append(CHUNK, chunk) {
            self.line = Some(line);
        }
    }

    fn read_on(&self, unread: Duration, is_next: bool) {
        let mut socket = self.link.socket.borrow_mut();
        socket.get_mut().read_on(unread, is_next);
    }

    /// A message has come.
    fn begin(&mut self, message: Bytes, chunk: &mut BytesMut) {
        self.spent = (message.len() > SHORT).then(|| message.clone());
        self.take(OneLine::new(message), chunk);
    }

    fn look_for_life(&mut self) -> io::Result<()> {
        let now = Instant::now();
        let late = self.link.socket.borrow().get_ref().late();
        if late.is_some_and(|late| late <= now) {
            self.link.close_reason.set((CloseCode::Policy, TOO_SLOW));
            self.shared.ending.set(Ending::Refused);
            return Err(io::ErrorKind::TimedOut.into());
        }
        if let Some(asked) = self.asked {
            if self.link.life.get() > asked {
                self.asked = None;
            } else if now >= asked + PONG_TIME {
                self.link
                    .close_reason
                    .set((CloseCode::Away, "no sign of life"));
                return Err(io::ErrorKind::TimedOut.into());
            }
        }
        if now >= self.next_ping {
            self.next_ping = now + PING_INTERVAL;
            self.asked.get_or_insert(now);
            self.link.ping_is_due.set(true);
            self.shared.outgoing.wake_writer();
        }
        Ok(())
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin> Inbound for Input<S> {
    async fn read(&mut self, chunk: &mut BytesMut) -> io::Result<usize> {
        // While nothing was read, no sign of life could be seen.
        let unread = self.unread_since.take();
        let unread = unread.map_or(Duration::ZERO, |since| since.elapsed());
        self.asked = self.asked.map(|asked| asked + unread);
        let is_next = self.line.is_none();
        self.read_on(unread, is_next);
        let before = chunk.len();
        if let Some(line) = self.line.take() {
            self.take(line, chunk);
        }
        while chunk.len() == before {
            match self.next().await? {
                Some(Ok(Message::Text(text))) => self.begin(text.into(), chunk),
                Some(Ok(Message::Binary(bytes))) => self.begin(bytes, chunk),
                // Pings and closes are answered by the library, as soon as reading goes on; frames never come out of
                // it.
                Some(Ok(_)) => self.link.socket.borrow_mut().get_mut().control(),
                // The peer has closed, and takes no answers any more.
                None => return Err(io::ErrorKind::ConnectionAborted.into()),
                Some(Err(error)) => {
                    self.link.close_reason.set(close_reason(&error));
                    self.shared.ending.set(Ending::Refused);
                    return Err(io::ErrorKind::InvalidData.into());
                }
            }
        }
        self.unread_since = Some(Instant::now());
        Ok(chunk.len() - before)
    }

    fn take_permit(&mut self) -> Option<Permit> {
        self.link.socket.borrow_mut().get_mut().permit.take()
    }

    async fn swallow(&mut self, chunk: &mut BytesMut) -> io::Result<usize> {
        let link = &self.link;
        poll_fn(|cx| {
            let mut socket = link.socket.borrow_mut();
            socket.get_mut().begin_turn();
            let mut reading = std::pin::pin!(read_some(socket.get_mut(), chunk));
            reading.as_mut().poll(cx)
        })
        .await
    }
}

/// The reason given where a message takes longer than `FRAME_TIME`.
const TOO_SLOW: &str = "a message that has begun must be complete within a minute";

/// The reason given where a peer has broken a rule.
fn close_reason(error: &Error) -> (CloseCode, &'static str) {
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
    /// The kind of message that the next write goes on with, if it does not begin one.
    unfinished: Option<Data>,
}

impl<S: AsyncRead + AsyncWrite + Unpin> Outbound for Output<S> {
    const END_IS_ANSWERED: bool = true;

    async fn write(&mut self, frames: &[Bytes]) -> Option<usize> {
        // Waiting pongs would take the room of the message.
        self.link.flush().await?;
        let mut written = 0;
        let mut waiting = frames.iter().cloned();
        let mut frame = waiting.next()?;
        loop {
            let room = FRAGMENT.saturating_sub(written);
            let kind = self.unfinished.unwrap_or_else(|| kind_of(&frame));
            let (piece, is_last) = first_piece(&frame, kind == Data::Text, room);
            if written > 0 && !is_last {
                break;
            }
            written += piece.len();
            frame.advance(piece.len());
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
            if !is_last {
                break;
            }
            if frame.is_empty() {
                let Some(next) = waiting.next() else {
                    break;
                };
                frame = next;
            }
        }
        self.link.flush().await?;
        Some(written)
    }

    async fn send_due_ping(&mut self) -> Option<()> {
        // Another pong may be due by the time that this one has gone out.
        while self.link.ping_is_due.take() {
            self.link.flush().await?;
            self.link.put(Message::Ping(Bytes::new()))?;
            self.link.flush().await?;
        }
        Some(())
    }

    async fn end(&mut self) -> io::Result<()> {
        let (code, why) = self.link.close_reason.get();
        let reason = Utf8Bytes::from_static(why);
        let gone = || io::Error::from(io::ErrorKind::ConnectionAborted);
        let close = Message::Close(Some(CloseFrame { code, reason }));
        self.link.flush().await.ok_or_else(gone)?;
        self.link.put(close).ok_or_else(gone)?;
        self.link.flush().await.ok_or_else(gone)?;
        if !self.shared.is_refused() {
            return Ok(());
        }
        // Nothing that the peer sends is looked at any more, not even a close frame: the end of the stream is enough.
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

/// The part of a frame that one WebSocket frame has room for, and whether a message ends there. A text may be several
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
