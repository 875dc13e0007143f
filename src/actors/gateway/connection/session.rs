//! The session of one client: by its first bytes it is refused, served over HTTP, or spoken with.
//!
//! **Invariant:** nothing of what a client sends is read as JSON before its opening is decided, and what has been
//! read by then is not lost.

use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use actix::prelude::*;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::time::{Instant, sleep, sleep_until, timeout};

use super::admission::Admission;
use super::admission::authentication::{AuthError, authenticate};
use super::shared::Shared;
use super::transport::{CHUNK, Plain, discard};
use super::unfinished::First;
use crate::actors::ConnectionId;
use crate::actors::gateway::ends::Ends;
use crate::actors::gateway::limits::{FRAME_TIME, HEAD_TIME, LINGER};
use crate::actors::gateway::messages::{Connect, Disconnect, Finish, Outlets, Refused};
use crate::protocol::messages::{self, Level};
use crate::protocol::op::token::Token;
#[cfg(feature = "web")]
use crate::protocol::wire::frame::Foreign;
use crate::protocol::wire::frame::{FrameReader, Opening, opening};
#[cfg(feature = "web")]
use crate::web::{response::HttpResponse, response::HttpStatus, serve};

/// One client, from its first bytes to its last.
pub(super) struct ClientSession {
    pub(super) shared: Rc<Shared>,
    pub(super) finish: Recipient<Finish>,
    pub(super) admission: Arc<Admission>,
    pub(super) ends: Ends,
}

/// The protocol that a client speaks, by its first bytes.
enum DetectedProtocol {
    /// It speaks JSON, if anything.
    Json,
    /// It sends an HTTP request that is answered.
    #[cfg(feature = "web")]
    Http,
    /// It speaks another protocol, or has not spoken in time; holds the error for it.
    Foreign(String),
    /// The runtime has ended the connection first.
    Finished,
}

/// How a client is served.
enum HowServed {
    /// Frames are exchanged with it; this holds what has been read of it so far.
    Json(FrameReader),
    /// Its request is answered.
    #[cfg(feature = "web")]
    Web(serve::Served),
    /// It is refused: not at once, if it has tried a token that is not ours.
    Refused {
        message: RefusalMessage,
        is_wrong_token: bool,
    },
    /// There is nobody left to serve.
    Gone,
}

/// Says to a client why it is not served.
enum RefusalMessage {
    /// A sentence, in a status.
    Status(String),
    /// Over HTTP.
    #[cfg(feature = "web")]
    Http(HttpResponse),
}

impl ClientSession {
    /// Serves a client, or tells it why not; returns when nothing can be sent any more.
    pub(super) async fn run<S>(self, mut stream: S, outlets: Outlets)
    where
        S: AsyncRead + AsyncWrite + Unpin + 'static,
    {
        let mut first = First::with_room(CHUNK, &self.shared.account);
        let admitted = match &self.admission.token {
            None => None,
            // Nothing is asked of the registry for a client that has not shown the token.
            Some(token) => match self.admit(token, &mut stream, &mut first).await {
                Some(verdict) => Some(verdict),
                None => return,
            },
        };
        let id = match self.connect(outlets).await {
            Ok(id) => id,
            Err(why) => return self.refuse(&mut stream, &why.to_string()).await,
        };
        let verdict = match admitted {
            Some(verdict) => verdict,
            None => self.examine(&mut stream, &mut first, None).await,
        };
        self.serve(stream, id, first, verdict).await;
    }

    /// Has the client show the token, and gives what is to be done about it then. Who does not show it in time, or
    /// has waited longest of too many, is closed.
    async fn admit<S>(&self, token: &Token, stream: &mut S, first: &mut First) -> Option<HowServed>
    where
        S: AsyncRead + AsyncWrite + Unpin,
    {
        let slot = self.admission.newcomers.unauthenticated.take();
        let due = Instant::now() + HEAD_TIME;
        // A client that has sent the token gets in, also where its slot is lost in the same moment.
        let verdict = tokio::select! {
            biased;
            verdict = self.examine(stream, first, Some((token, due))) => verdict,
            () = slot.evicted() => {
                refuse_evicted(stream, &first.bytes).await;
                return None;
            }
        };
        match verdict {
            HowServed::Gone => None,
            HowServed::Refused {
                message,
                is_wrong_token,
            } => {
                tokio::select! {
                    () = self.refuse_unauthenticated(stream, message, is_wrong_token) => {}
                    () = slot.evicted() => {}
                }
                None
            }
            admitted => Some(admitted),
        }
    }

    /// Tells a client that has not shown the token why it is not admitted. The more wrong tokens came from its address,
    /// the later it is told.
    async fn refuse_unauthenticated<S>(
        &self,
        stream: &mut S,
        message: RefusalMessage,
        is_wrong_token: bool,
    ) where
        S: AsyncRead + AsyncWrite + Unpin,
    {
        if is_wrong_token {
            let Some(wait) = self
                .admission
                .newcomers
                .failed_attempts
                .wait(self.ends.peer.ip())
            else {
                return sleep(HEAD_TIME).await;
            };
            sleep(wait).await;
        }
        match message {
            RefusalMessage::Status(why) => self.refuse(stream, &why).await,
            #[cfg(feature = "web")]
            RefusalMessage::Http(response) => serve::answer(stream, &response).await,
        }
    }

    /// Makes the client known.
    async fn connect(&self, outlets: Outlets) -> Result<ConnectionId, Refused> {
        let answer = self.shared.registry.send(Connect(outlets)).await;
        let id = answer.unwrap_or(Err(Refused::Closed))?;
        self.shared.id.set(Some(id));
        Ok(id)
    }

    /// Reads until it is clear what is to be done about the client; `auth` is the token that it has to show, and
    /// until when.
    async fn examine<S>(
        &self,
        stream: &mut S,
        first: &mut First,
        auth: Option<(&Token, Instant)>,
    ) -> HowServed
    where
        S: AsyncRead + AsyncWrite + Unpin,
    {
        let due = auth.map(|(_, due)| due);
        match self.detect_protocol(stream, first, due).await {
            DetectedProtocol::Json => match auth {
                None => HowServed::Json(FrameReader::new()),
                Some((token, due)) => match authenticate(token, stream, first, due).await {
                    Ok(frames) => HowServed::Json(frames),
                    Err(why) => HowServed::Refused {
                        message: RefusalMessage::Status(why.to_string()),
                        is_wrong_token: why == AuthError::Wrong,
                    },
                },
            },
            #[cfg(feature = "web")]
            DetectedProtocol::Http => {
                let due = due.unwrap_or_else(|| Instant::now() + HEAD_TIME);
                let (site, newcomers) = (&self.admission.site, &self.admission.newcomers);
                // The client takes a slot until its request head is complete.
                let evicted = async { newcomers.heads.take().evicted().await };
                let received = tokio::select! {
                    biased;
                    received = serve::receive(stream, &mut first.bytes, site, self.ends.local, due) => received,
                    () = evicted, if auth.is_none() => {
                        Some(Err(HttpResponse::text(HttpStatus::RequestTimeout, CROWDED).into()))
                    }
                };
                match received {
                    Some(Ok(outcome)) => HowServed::Web(outcome),
                    Some(Err(refused)) => HowServed::Refused {
                        message: RefusalMessage::Http(refused.response),
                        is_wrong_token: refused.is_wrong_token,
                    },
                    None => HowServed::Gone,
                }
            }
            DetectedProtocol::Foreign(why) => HowServed::Refused {
                message: RefusalMessage::Status(why),
                is_wrong_token: false,
            },
            DetectedProtocol::Finished => {
                let _ = timeout(LINGER, stream.shutdown()).await;
                HowServed::Gone
            }
        }
    }

    /// Does what is to be done about a client that the registry knows.
    async fn serve<S>(self, mut stream: S, id: ConnectionId, first: First, verdict: HowServed)
    where
        S: AsyncRead + AsyncWrite + Unpin + 'static,
    {
        match verdict {
            HowServed::Json(frames) => self.serve_json(stream, id, frames, first).await,
            #[cfg(feature = "web")]
            HowServed::Web(outcome) => self.serve_web(stream, id, outcome, first).await,
            HowServed::Refused { message, .. } => match message {
                RefusalMessage::Status(why) => {
                    let _ = self.shared.registry.send(Disconnect(id)).await;
                    self.refuse(&mut stream, &why).await;
                }
                #[cfg(feature = "web")]
                RefusalMessage::Http(response) => serve::answer(&mut stream, &response).await,
            },
            HowServed::Gone => {}
        }
    }

    /// Speaks JSON over the plain stream.
    async fn serve_json<S>(&self, stream: S, id: ConnectionId, frames: FrameReader, first: First)
    where
        S: AsyncRead + AsyncWrite + Unpin + 'static,
    {
        let (input, output) = tokio::io::split(stream);
        let reader = self.reader(id, frames, first.unfinished);
        self.talk(reader, Plain(input), Plain(output), first.bytes)
            .await;
    }

    /// Reads until the first bytes tell what the client speaks. A client that ends before that counts as one that
    /// speaks JSON. A silent client may stay silent, unless it has something to show until `due`; a client that has
    /// begun what may become a request has to go on.
    async fn detect_protocol<S: AsyncRead + Unpin>(
        &self,
        stream: &mut S,
        first: &mut First,
        due: Option<Instant>,
    ) -> DetectedProtocol {
        let mut deadline = due;
        loop {
            let read = tokio::select! {
                biased;
                () = self.shared.finished() => return DetectedProtocol::Finished,
                // A few bytes decide, and there is room for them.
                read = stream.read_buf(&mut first.bytes) => read,
                () = sleep_until(deadline.unwrap_or_else(Instant::now)), if deadline.is_some() => {
                    return DetectedProtocol::Foreign(match due {
                        Some(_) => AuthError::TooLate.to_string(),
                        None => "what this connection began with did not go on".to_owned(),
                    });
                }
            };
            if read.unwrap_or(0) == 0 {
                return DetectedProtocol::Json;
            }
            match opening(&first.bytes) {
                Opening::Undecided => {
                    let may_be_foreign = !first.bytes.trim_ascii_start().starts_with(b"{");
                    let time = if may_be_foreign {
                        HEAD_TIME
                    } else {
                        FRAME_TIME
                    };
                    if !first.bytes.trim_ascii().is_empty() {
                        deadline.get_or_insert_with(|| Instant::now() + time);
                    }
                }
                Opening::Json => return DetectedProtocol::Json,
                #[cfg(feature = "web")]
                Opening::Foreign(Foreign::Http) if first.bytes.starts_with(b"GET ") => {
                    return DetectedProtocol::Http;
                }
                Opening::Foreign(foreign) => {
                    return DetectedProtocol::Foreign(foreign.explanation().to_owned());
                }
            }
        }
    }

    /// Tells a client why it is not served, and swallows what it sends so that it can read that.
    async fn refuse<S: AsyncRead + AsyncWrite + Unpin>(&self, stream: &mut S, why: &str) {
        let status = messages::status(Level::Error, why, None);
        let tell = async {
            stream.write_all(&status).await?;
            stream.shutdown().await
        };
        if let Ok(Ok(())) = timeout(LINGER, tell).await {
            discard(Plain(stream)).await;
        }
    }
}

/// The response to a browser that has waited longest of too many to complete its request.
#[cfg(feature = "web")]
const CROWDED: &str = "the head of the request was not complete when too many others came";

/// Closes a client that has waited longest of too many to show its token, and tells it why if it takes that at once.
async fn refuse_evicted<S: AsyncWrite + Unpin>(stream: &mut S, first: &[u8]) {
    let why = AuthError::Crowded.to_string();
    let message = match opening(first) {
        #[cfg(feature = "web")]
        Opening::Foreign(Foreign::Http) => {
            let response = HttpResponse::text(HttpStatus::Unavailable, &why);
            [response.head().as_bytes(), response.body()]
                .concat()
                .into()
        }
        _ => messages::status(Level::Error, &why, None),
    };
    let tell = async {
        stream.write_all(&message).await?;
        stream.shutdown().await
    };
    let _ = timeout(Duration::ZERO, tell).await;
}
