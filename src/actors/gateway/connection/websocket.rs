//! The WebSocket of a client: its messages, the answers to pings, and its close. A message is a frame. Also the end of
//! a stream, for both transports.
//!
//! **Invariant:** a peer that has closed gets only a close frame. At most one write and one pong wait to be written.

use std::io;
use std::iter::once;
use std::pin::Pin;
use std::task::{Context, Poll, ready};

use bytes::{Bytes, BytesMut};

use super::client::Connection;
use super::transport::{ClientLost, ClientStream, Protocol, Transport, write_some};
use crate::actors::gateway::limits::FRAMES_IN_A_ROW;
use crate::protocol::wire::frame::FrameError;
use crate::protocol::wire::websocket::{SocketEnd, WebSocket};

impl<S: ClientStream> Connection<S> {
    /// Whether the client is served over WebSocket. Then its frames are messages, which may be binary, and it answers
    /// the close frame.
    pub(super) fn is_socket(&self) -> bool {
        let protocol = self.transport.as_ref().map(|transport| &transport.protocol);
        matches!(protocol, Some(Protocol::WebSocket(..)))
    }
}

impl<S: ClientStream> Transport<S> {
    /// An error if the peer has ended the stream.
    pub(super) fn check_end(socket: &mut WebSocket) -> Result<(), ClientLost> {
        match socket.end() {
            None => Ok(()),
            Some(SocketEnd::Closed(_)) => Err(ClientLost::Gone),
            Some(SocketEnd::Violated) => Err(ClientLost::Refused),
        }
    }

    /// Reads pings and a close in `chunk`, which follow messages that wait. Returns an error if the client has ended.
    /// Lines stay in `chunk`.
    pub(super) fn look_ahead(&mut self, chunk: &mut BytesMut) -> Result<(), ClientLost> {
        let Protocol::WebSocket(socket, _) = &mut self.protocol else {
            return Ok(());
        };
        socket.incoming.push(chunk);
        chunk.clear();
        socket.incoming.look_ahead(FRAMES_IN_A_ROW);
        Self::check_end(socket)
    }

    /// Bytes that [`look_ahead`](Self::look_ahead) has taken.
    pub(super) fn taken_ahead(&self) -> usize {
        match &self.protocol {
            Protocol::Plain(_) => 0,
            Protocol::WebSocket(socket, _) => socket.incoming.waiting(),
        }
    }

    /// Ends the stream. An incomplete frame is an error.
    pub(super) fn finish(&mut self) -> Option<FrameError> {
        match &mut self.protocol {
            Protocol::Plain(frames) => frames.finish(),
            Protocol::WebSocket(..) => None,
        }
    }

    /// Abandons a frame that takes too long. Returns an error if the transport itself sends `why` to the client.
    pub(super) fn give_up(&mut self, why: &'static str) -> Result<(), ClientLost> {
        match &mut self.protocol {
            Protocol::Plain(_) => Ok(()),
            Protocol::WebSocket(socket, _) => {
                socket.outgoing.refuse(why);
                Err(ClientLost::Refused)
            }
        }
    }

    /// Sends a part of `frames`. Returns their number of bytes, once that part is sent. A peer that has closed gets
    /// only a close frame.
    pub(super) fn poll_messages<'a>(
        socket: &mut WebSocket,
        stream: &mut S,
        cx: &mut Context<'_>,
        frames: impl ExactSizeIterator<Item = &'a Bytes>,
    ) -> Poll<io::Result<usize>> {
        if let Some(SocketEnd::Closed(_)) = socket.incoming.end() {
            ready!(Self::poll_close(socket, stream, cx))?;
            return Poll::Ready(Err(io::ErrorKind::ConnectionAborted.into()));
        }
        if !socket.outgoing.has_messages() {
            ready!(Self::poll_output(socket, stream, cx))?;
            socket.outgoing.put(frames);
        }
        let sent = ready!(write_some(stream, cx, once(socket.outgoing.output())))?;
        Poll::Ready(Ok(socket.outgoing.sent(sent)))
    }

    /// Sends the output, and the answer to the latest ping.
    pub(super) fn poll_output(
        socket: &mut WebSocket,
        stream: &mut S,
        cx: &mut Context<'_>,
    ) -> Poll<io::Result<()>> {
        while let Some(output) = socket.output() {
            let sent = ready!(write_some(stream, cx, once(output)))?;
            socket.outgoing.sent(sent);
        }
        Poll::Ready(Ok(()))
    }

    /// Sends the close frame.
    fn poll_close(
        socket: &mut WebSocket,
        stream: &mut S,
        cx: &mut Context<'_>,
    ) -> Poll<io::Result<()>> {
        ready!(Self::poll_output(socket, stream, cx))?;
        socket.outgoing.put_close();
        Self::poll_output(socket, stream, cx)
    }

    /// Closes the stream in an orderly way, after a close frame over WebSocket. The input of a refused peer is
    /// discarded, including its close frame. The end of the stream is enough for it.
    pub(super) fn poll_end(
        &mut self,
        cx: &mut Context<'_>,
        is_refused: bool,
    ) -> Poll<io::Result<()>> {
        if let Protocol::WebSocket(socket, _) = &mut self.protocol {
            ready!(Self::poll_close(socket, &mut self.stream, cx))?;
            if !is_refused {
                return Poll::Ready(Ok(()));
            }
        }
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}
