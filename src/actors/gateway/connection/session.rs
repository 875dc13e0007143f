//! The session of one client. Its first bytes decide whether it is refused, served over HTTP, or exchanges frames.
//!
//! **Invariant:** no input is parsed as JSON before the protocol is detected. The bytes read for the detection are not
//! lost.

use std::sync::Arc;
use std::time::Duration;

use actix::prelude::*;
use bytes::{Bytes, BytesMut};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::time::{Instant, sleep, sleep_until, timeout};

use super::admission::{Admission, WRONG_TOKEN_TIME, first_frame};
use super::transport::{ClientStream, Transport};
use crate::actors::gateway::limits::{FRAME_TIME, HEAD_TIME, LOOK_AGAIN, OPENING_TIME, READ_BYTES};
use crate::actors::gateway::registry::{Connect, CountRefusal, HeldPlace, Outlets, Registry};
use crate::actors::resources::places::{HeldSlot, Refused};
use crate::actors::resources::unread::Ends;
use crate::protocol::messages::{self, Level};
use crate::protocol::op::token::{AuthError, authenticate};
#[cfg(feature = "web")]
use crate::protocol::wire::frame::Foreign;
use crate::protocol::wire::frame::{Opening, opening};
use crate::protocol::wire::json::Payload;

/// A client whose protocol is being detected.
pub(super) struct ClientSession {
    pub(super) registry: Addr<Registry>,
    pub(super) admission: Arc<Admission>,
    pub(super) ends: Ends,
    pub(super) outlets: Outlets,
}

/// A client that exchanges frames from now on.
pub(super) struct Opened<S> {
    /// Its place, or the status with the reason why it gets none.
    pub(super) place: Result<HeldPlace, Bytes>,
    pub(super) transport: Transport<S>,
    /// Bytes that were already read.
    pub(super) first: BytesMut,
}

/// The result of the detection by a client's first bytes.
enum Detected {
    /// It exchanges frames, or has ended or was too slow before its protocol was known.
    Frames,
    /// It exchanges frames, and is a command of this program.
    Command,
    /// It uses HTTP. The head of its first request must be complete by this time.
    #[cfg(feature = "web")]
    Http(Instant),
    /// It is refused with this status.
    Refused(Bytes),
}

impl ClientSession {
    /// Runs the session. Returns the client if it exchanges frames, or if it is refused in a frame.
    pub(super) async fn run<S: ClientStream>(self, mut stream: S) -> Option<Opened<S>> {
        let mut first = BytesMut::with_capacity(READ_BYTES);
        let asks_token = self.admission.token.is_some();
        let mut place = if asks_token {
            // A client without the token makes no request to the registry.
            Err(Refused::NoToken)
        } else {
            self.connect(false).await
        };
        let how = match place {
            Ok(_) => self.detect(&mut stream, &mut first, None).await,
            Err(Refused::Closed) => Detected::Frames,
            Err(why) => {
                let mut slot = self.admission.newcomers.take();
                let time = if asks_token { HEAD_TIME } else { OPENING_TIME };
                // `biased`: a client that sends the token is admitted, even if it is evicted at the same time.
                let how = tokio::select! {
                    biased;
                    how = self.qualify(&mut stream, &mut first, Instant::now() + time) => how,
                    _ = &mut slot => {
                        self.refuse_evicted(&mut stream, why).await;
                        return None;
                    }
                };
                place = match how {
                    #[cfg(feature = "web")]
                    Detected::Http(due) => {
                        return self.serve_http(stream, first, due, Err((slot, why))).await;
                    }
                    Detected::Command => self.wait_for_place(&mut slot).await,
                    Detected::Frames => self.connect(false).await,
                    Detected::Refused(_) => place,
                };
                how
            }
        };
        let place = match (how, place) {
            (Detected::Refused(why), _) => Err(why),
            #[cfg(feature = "web")]
            (Detected::Http(due), Ok(place)) => {
                return self.serve_http(stream, first, due, Ok(place)).await;
            }
            (_, place) => place.map_err(|why| refused(&self.turn_away(why), None)),
        };
        Some(Opened {
            place,
            transport: Transport::plain(stream),
            first,
        })
    }

    /// Waits until `due` for the first frame of a client without a place. It must send the token, if one is required.
    async fn qualify<S>(&self, stream: &mut S, first: &mut BytesMut, due: Instant) -> Detected
    where
        S: AsyncRead + Unpin,
    {
        let how = self.detect(stream, first, Some(due)).await;
        if !matches!(how, Detected::Frames) {
            return how;
        }
        let frame = first_frame(stream, first, due).await;
        if let Some(token) = &self.admission.token {
            let shown = frame.as_ref().map_err(|why| *why);
            if let Err(why) = shown.and_then(|frame| authenticate(token, frame)) {
                if why == AuthError::Wrong {
                    self.delay_wrong_token().await;
                }
                let id = shown.ok().and_then(|frame| frame.id.as_ref());
                return Detected::Refused(refused(&why.to_string(), id));
            }
        }
        if frame.is_ok_and(|frame| frame.is_command()) {
            Detected::Command
        } else {
            Detected::Frames
        }
    }

    /// Takes a place, possibly a kept one. If none is free, waits up to [`OPENING_TIME`] for one.
    pub(super) async fn wait_for_place(&self, slot: &mut HeldSlot) -> Result<HeldPlace, Refused> {
        let due = Instant::now() + OPENING_TIME;
        loop {
            let place = self.connect(true).await;
            if !matches!(place, Err(Refused::Full { .. })) || Instant::now() >= due {
                return place;
            }
            tokio::select! {
                _ = &mut *slot => return place,
                () = sleep(LOOK_AGAIN) => {}
            }
        }
    }

    /// Counts a client that gets no place. Returns the reason.
    pub(super) fn turn_away(&self, why: Refused) -> String {
        if matches!(why, Refused::Full { .. }) {
            self.registry.do_send(CountRefusal);
        }
        why.to_string()
    }

    /// Delays the answer to a wrong token. A correct token is admitted at once.
    pub(super) async fn delay_wrong_token(&self) {
        let from = self.ends.peer.ip();
        tracing::warn!(%from, "a client sent a wrong token");
        sleep(WRONG_TOKEN_TIME).await;
    }

    /// Registers the client.
    async fn connect(&self, may_use_kept: bool) -> Result<HeldPlace, Refused> {
        let connect = Connect {
            outlets: self.outlets.clone(),
            from: self.ends.peer.ip().to_canonical(),
            may_use_kept,
        };
        let answer = self.registry.send(connect).await;
        answer.unwrap_or(Err(Refused::Closed))
    }

    /// Reads until the first bytes identify the client's protocol. A client that ends before that counts as JSON. A
    /// client with a place may stay silent. Without a place, its deadline is `due`. A client that has sent its first
    /// bytes must complete them in time.
    async fn detect<S: AsyncRead + Unpin>(
        &self,
        stream: &mut S,
        first: &mut BytesMut,
        due: Option<Instant>,
    ) -> Detected {
        let foreign = |why: &str| Detected::Refused(refused(why, None));
        let mut deadline = due;
        loop {
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
                Opening::Json => return Detected::Frames,
                #[cfg(feature = "web")]
                Opening::Foreign(Foreign::Http)
                    if first.starts_with(b"GET ") || first.starts_with(b"HEAD ") =>
                {
                    return Detected::Http(deadline.unwrap_or_else(|| Instant::now() + HEAD_TIME));
                }
                Opening::Foreign(protocol) => return foreign(protocol.explanation()),
            }
            let read = tokio::select! {
                biased;
                // A few bytes are enough, and `first` has room for them.
                read = stream.read_buf(first) => read,
                () = sleep_until(deadline.unwrap_or_else(Instant::now)), if deadline.is_some() => {
                    return match due {
                        None => foreign("the first bytes of this connection were never completed"),
                        Some(_) if self.admission.token.is_some() => {
                            foreign(&AuthError::TooLate(HEAD_TIME).to_string())
                        }
                        // It is refused like other clients without a place.
                        Some(_) => Detected::Frames,
                    };
                }
            };
            if read.unwrap_or(0) == 0 {
                return Detected::Frames;
            }
        }
    }

    /// Closes an evicted client that has sent no whole first frame and no request. Sends the reason if the socket accepts
    /// it without delay.
    async fn refuse_evicted<S: AsyncWrite + Unpin>(&self, stream: &mut S, why: Refused) {
        let message = refused(&self.turn_away(why), None);
        let tell = async {
            stream.write_all(&message).await?;
            stream.shutdown().await
        };
        let _ = timeout(Duration::ZERO, tell).await;
    }
}

/// The status of a client that is refused. `id` is that of its frame.
fn refused(why: &str, id: Option<&Payload>) -> Bytes {
    messages::status(Level::Error, why, id)
}
