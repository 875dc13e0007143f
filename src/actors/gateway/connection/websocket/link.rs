//! A WebSocket's stream, shared by both halves of its client: one may read a ping while the other writes.
//!
//! **Invariant:** no borrow of the socket outlives a poll.

use std::cell::{Cell, RefCell};
use std::future::poll_fn;
use std::rc::Rc;
use std::task::Poll;

use bytes::Bytes;
use futures_util::{SinkExt, StreamExt};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::task::yield_now;
use tokio::time::Instant;
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::error::Error;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use tokio_tungstenite::tungstenite::protocol::{Role, WebSocketConfig};

use super::watched::{MonitoredStream, READ_BUFFER};
use crate::actors::gateway::connection::shared::Shared;
use crate::protocol::limits::MAX_FRAME;

/// Bytes of payload in one WebSocket frame and in one write; a longer message goes in fragments, so that a client is
/// seen to take it.
pub(super) const FRAGMENT: usize = 32 * 1024;
/// Most bytes that wait to be written: a write of ours with its heads, and pongs. Where a pong finds no room, one
/// answers all the pings up to the last that has come, as RFC 6455 has it (section 5.5.3).
const WRITE_BUFFER: usize = 2 * FRAGMENT;

/// Both halves share this; one thread, so plain cells do.
pub(super) struct Link<S> {
    pub(super) socket: RefCell<WebSocketStream<MonitoredStream<S>>>,
    /// When the peer last sent or took a byte.
    pub(super) life: Rc<Cell<Instant>>,
    /// Whether the peer is to be asked for a sign of life.
    pub(super) ping_is_due: Cell<bool>,
    /// Why the connection ends, for the peer to know.
    pub(super) close_reason: Cell<(CloseCode, &'static str)>,
}

impl<S: AsyncRead + AsyncWrite + Unpin> Link<S> {
    /// Takes a stream on which the handshake has been made; `behind` came after it.
    pub(super) async fn open(stream: S, behind: Bytes, shared: &Shared) -> Rc<Self> {
        let life = Rc::new(Cell::new(Instant::now()));
        let watched = MonitoredStream::new(
            stream,
            behind,
            Rc::clone(&life),
            Rc::clone(&shared.outgoing),
            shared.memory.clone(),
        );
        let config = WebSocketConfig::default()
            .read_buffer_size(READ_BUFFER)
            .write_buffer_size(FRAGMENT)
            .max_write_buffer_size(WRITE_BUFFER)
            .max_message_size(Some(MAX_FRAME))
            .max_frame_size(Some(MAX_FRAME));
        let role = Role::Server;
        let socket = WebSocketStream::from_raw_socket(watched, role, Some(config));
        Rc::new(Self {
            socket: RefCell::new(socket.await),
            life,
            ping_is_due: Cell::new(false),
            close_reason: Cell::new((CloseCode::Away, "shutting down")),
        })
    }

    /// The next message; `None` once the connection is closed. Everything is received in turns, since one read may
    /// bring a thousand pings, each of which is answered.
    pub(super) async fn next(&self) -> Option<Result<Message, Error>> {
        loop {
            if !self.socket.borrow().get_ref().is_turn_over() {
                let received =
                    poll_fn(|cx| Poll::Ready(self.socket.borrow_mut().poll_next_unpin(cx)));
                if let Poll::Ready(message) = received.await {
                    return message;
                }
            }
            if self.socket.borrow_mut().get_mut().begin_turn() {
                // Other sockets are looked at too before this one goes on.
                yield_now().await;
            } else {
                let mut next = Poll::Pending;
                poll_fn(|_| std::mem::replace(&mut next, Poll::Ready(()))).await;
            }
        }
    }

    /// Puts a message where [`Link::flush`] finds it; `None` if the peer is gone.
    pub(super) fn put(&self, message: Message) -> Option<()> {
        self.socket.borrow_mut().start_send_unpin(message).ok()
    }

    /// Waits until all that was put there has been written; `None` if the peer is gone.
    pub(super) async fn flush(&self) -> Option<()> {
        poll_fn(|cx| self.socket.borrow_mut().poll_flush_unpin(cx))
            .await
            .ok()
    }
}
