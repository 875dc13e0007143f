//! The course of a connection: by its first bytes it is refused, served over HTTP, or spoken with.
//!
//! **Invariant:** nothing of what a client sends is read as JSON before its opening is decided, and what has been read by
//! then is not lost.

use std::cell::RefCell;
use std::net::SocketAddr;
use std::rc::Rc;
use std::sync::Arc;

use actix::prelude::*;
use bytes::BytesMut;
use tokio::io::{AsyncRead, AsyncWrite, AsyncWriteExt};
use tokio::time::{Instant, sleep_until, timeout};

use super::gate::{Gate, HEAD_TIME};
use super::reader::{Reader, discard};
use super::transport::{CHUNK, Inbound, Outbound, Plain, Sending, read_some, take_tcp};
use super::unfinished::FRAME_TIME;
use super::{Finish, LINGER, Shared, Task, writer};
use crate::actors::ConnectionId;
use crate::actors::panics::contained;
use crate::actors::registry::{Disconnect, Refused, Registry};
#[cfg(feature = "web")]
use crate::protocol::frame::Foreign;
use crate::protocol::frame::{Opening, opening};
use crate::protocol::messages::{self, Level};
use crate::protocol::token::Token;

/// What one connection's tasks need to know of the rest.
pub(super) struct Reception {
    pub(super) shared: Rc<Shared>,
    pub(super) registry: Addr<Registry>,
    pub(super) finish: Recipient<Finish>,
    pub(super) gate: Arc<Gate>,
    /// The address that the client has connected to.
    #[cfg_attr(not(feature = "web"), allow(dead_code, reason = "HTTP asks for it"))]
    pub(super) local: SocketAddr,
}

/// What a client turns out to be.
enum Greeting {
    /// One that speaks JSON, if anything.
    Json,
    /// One that sends an HTTP request that is answered.
    #[cfg(feature = "web")]
    Web,
    /// Another protocol's; holds what it is told.
    Foreign(&'static str),
    /// The runtime has ended the connection first.
    Finished,
}

impl Reception {
    /// Serves a client that the registry has taken, or tells it why not; returns when nothing can be sent any more.
    pub(super) async fn run<S>(self, mut stream: S, admitted: Result<ConnectionId, Refused>)
    where
        S: AsyncRead + AsyncWrite + Unpin + 'static,
    {
        let id = match admitted {
            Ok(id) => id,
            Err(why) => return self.refuse(stream, &why.to_string()).await,
        };
        self.shared.id.set(Some(id));
        let mut first = BytesMut::with_capacity(CHUNK);
        match self.greet(&mut stream, &mut first).await {
            Greeting::Json => self.serve_json(stream, id, first).await,
            #[cfg(feature = "web")]
            Greeting::Web => self.serve_web(stream, id, first).await,
            Greeting::Foreign(explanation) => {
                let _ = self.registry.send(Disconnect(id)).await;
                self.refuse(stream, explanation).await;
            }
            Greeting::Finished => {
                let _ = timeout(LINGER, stream.shutdown()).await;
            }
        }
    }

    /// Speaks JSON over the plain stream.
    async fn serve_json<S>(&self, stream: S, id: ConnectionId, first: BytesMut)
    where
        S: AsyncRead + AsyncWrite + Unpin + 'static,
    {
        let reader = self.reader(id, self.gate.token.clone());
        let mut stream = Some(stream);
        if let Some(tcp) = take_tcp(&mut stream) {
            let (input, output) = tcp.into_split();
            let output = Rc::new(RefCell::new(output));
            self.shared.stream.replace(Some(Rc::clone(&output)));
            let output = Plain(Sending(output));
            self.talk(reader, Plain(input), output, first).await;
        } else if let Some(stream) = stream {
            let (input, output) = tokio::io::split(stream);
            self.talk(reader, Plain(input), Plain(output), first).await;
        }
    }

    /// The reading half for client `id`; `locked` is what it has to show first.
    pub(super) fn reader(&self, id: ConnectionId, locked: Option<Token>) -> Reader {
        let shared = Rc::clone(&self.shared);
        let (registry, finish) = (self.registry.clone(), self.finish.clone());
        Reader::new(id, shared, registry, finish, locked)
    }

    /// Reads until the first bytes tell what the client speaks. A client that ends before that spoke JSON, if anything.
    /// One that is silent may stay so; one that has begun what may become a request has to go on.
    async fn greet<S: AsyncRead + Unpin>(&self, stream: &mut S, first: &mut BytesMut) -> Greeting {
        let mut deadline = None;
        loop {
            let read = tokio::select! {
                biased;
                () = self.shared.finished() => return Greeting::Finished,
                read = read_some(stream, first) => read,
                () = sleep_until(deadline.unwrap_or_else(Instant::now)), if deadline.is_some() => {
                    return Greeting::Foreign("what this connection began with did not go on");
                }
            };
            if read.unwrap_or(0) == 0 {
                return Greeting::Json;
            }
            match opening(first) {
                Opening::Undecided => {
                    let may_be_foreign = !first.trim_ascii_start().starts_with(b"{");
                    let time = if may_be_foreign {
                        HEAD_TIME
                    } else {
                        FRAME_TIME
                    };
                    if !first.trim_ascii().is_empty() {
                        deadline.get_or_insert_with(|| Instant::now() + time);
                    }
                }
                Opening::Json => return Greeting::Json,
                #[cfg(feature = "web")]
                Opening::Foreign(Foreign::Http) if first.starts_with(b"GET ") => {
                    return Greeting::Web;
                }
                Opening::Foreign(foreign) => return Greeting::Foreign(foreign.explanation()),
            }
        }
    }

    /// Tells a client why it is not served, and swallows what it sends so that it can read that.
    async fn refuse<S: AsyncRead + AsyncWrite + Unpin + 'static>(&self, stream: S, why: &str) {
        self.shared.refusing.set(true);
        self.shared.send(messages::status(Level::Error, why, None));
        self.shared.finish();
        let (input, output) = tokio::io::split(stream);
        let swallowing = actix_rt::spawn(discard(Plain(input)));
        if writer::run(Plain(output), &self.shared, &self.registry).await {
            let _ = swallowing.await;
        } else {
            swallowing.abort();
        }
    }

    /// Reads and writes until the client is gone or has all that it is owed.
    pub(super) async fn talk<I, O>(&self, reader: Reader, input: I, output: O, first: BytesMut)
    where
        I: Inbound + 'static,
        O: Outbound,
    {
        let (shared, registry) = (Rc::clone(&self.shared), self.registry.clone());
        let mut reading = Task(actix_rt::spawn(async move {
            if let Err(panic) = contained(reader.run(input, first)).await {
                tracing::error!(%panic, "a client's reader failed; its connection ends");
                shared.abandon_computations();
                if let Some(id) = shared.id.get() {
                    let _ = registry.send(Disconnect(id)).await;
                }
                shared.finish();
            }
        }));
        let all_written = writer::run(output, &self.shared, &self.registry).await;
        self.shared.stream.take();
        // Whatever still reads after this ends here.
        if all_written && self.shared.refusing.get() {
            let _ = (&mut reading.0).await;
        } else if all_written && O::END_IS_ANSWERED {
            let _ = timeout(LINGER, &mut reading.0).await;
        }
    }
}
