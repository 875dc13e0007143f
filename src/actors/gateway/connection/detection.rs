//! Detects the protocol of a client. Its first bytes decide whether it is refused, served over HTTP, or exchanges frames.
//!
//! **Invariant:** no input is parsed as JSON before the protocol is detected. The bytes read for the detection are not
//! lost.

use std::time::Duration;

use bytes::{Bytes, BytesMut};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::time::{Instant, sleep_until, timeout, timeout_at};

use super::admission::{ClientSession, MAX_AUTH_BYTES, Opened};
#[cfg(feature = "web")]
use super::http;
use super::transport::{ClientStream, Transport, read_some};
use crate::actors::gateway::limits::{FRAME_TIME, HEAD_TIME, OPENING_TIME, READ_BYTES};
use crate::actors::resources::places::Refused;
use crate::protocol::messages::{self, Level};
use crate::protocol::op::token::{AuthError, authenticate};
use crate::protocol::op::{self, Incoming};
#[cfg(feature = "web")]
use crate::protocol::wire::frame::Foreign;
use crate::protocol::wire::frame::{FrameReader, Opening, opening};
use crate::protocol::wire::json::Payload;

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

/// Runs the session. Returns the client if it exchanges frames, or if it is refused in a frame.
pub(super) async fn open<S: ClientStream>(
    session: ClientSession,
    mut stream: S,
) -> Option<Opened<S>> {
    let mut first = BytesMut::with_capacity(READ_BYTES);
    let asks_token = session.admission.token.is_some();
    let mut place = if asks_token {
        // A client without the token makes no request to the registry.
        Err(Refused::NoToken)
    } else {
        session.connect(false).await
    };
    let how = match place {
        Ok(_) => detect(&session, &mut stream, &mut first, None).await,
        Err(Refused::Closed) => Detected::Frames,
        Err(why) => {
            let mut slot = session.admission.newcomers.take();
            let time = if asks_token { HEAD_TIME } else { OPENING_TIME };
            // `biased`: a client that sends the token is admitted, even if it is evicted at the same time.
            let how = tokio::select! {
                biased;
                how = qualify(&session, &mut stream, &mut first, Instant::now() + time) => how,
                _ = &mut slot => {
                    refuse_evicted(&session, &mut stream, why).await;
                    return None;
                }
            };
            place = match how {
                #[cfg(feature = "web")]
                Detected::Http(due) => {
                    return http::serve(&session, stream, first, due, Err((slot, why))).await;
                }
                Detected::Command => session.wait_for_place(&mut slot).await,
                Detected::Frames => session.connect(false).await,
                Detected::Refused(_) => place,
            };
            how
        }
    };
    let place = match (how, place) {
        (Detected::Refused(why), _) => Err(why),
        #[cfg(feature = "web")]
        (Detected::Http(due), Ok(place)) => {
            return http::serve(&session, stream, first, due, Ok(place)).await;
        }
        (_, place) => place.map_err(|why| refused(&session.turn_away(why), None)),
    };
    Some(Opened {
        place,
        transport: Transport::plain(stream),
        first,
    })
}

/// Waits until `due` for the first frame of a client without a place. It must send the token, if one is required.
async fn qualify<S: AsyncRead + Unpin>(
    session: &ClientSession,
    stream: &mut S,
    first: &mut BytesMut,
    due: Instant,
) -> Detected {
    let how = detect(session, stream, first, Some(due)).await;
    if !matches!(how, Detected::Frames) {
        return how;
    }
    let frame = first_frame(stream, first, due).await;
    if let Some(token) = &session.admission.token {
        let shown = frame.as_ref().map_err(|why| *why);
        if let Err(why) = shown.and_then(|frame| authenticate(token, frame)) {
            if why == AuthError::Wrong {
                session.delay_wrong_token().await;
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

/// Reads until the first bytes identify the client's protocol. A client that ends before that counts as JSON. A
/// client with a place may stay silent. Without a place, its deadline is `due`. A client that has sent its first
/// bytes must complete them in time.
async fn detect<S: AsyncRead + Unpin>(
    session: &ClientSession,
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
                    Some(_) if session.admission.token.is_some() => {
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

/// Reads a first frame until `due`. All bytes read stay in `first`. Returns its op and its `id`, or why there is no frame.
async fn first_frame<S: AsyncRead + Unpin>(
    stream: &mut S,
    first: &mut BytesMut,
    due: Instant,
) -> Result<Incoming, AuthError> {
    let mut frames = FrameReader::new();
    let mut seen = 0;
    loop {
        frames.push(first.get(seen..).unwrap_or_default());
        seen = first.len();
        if let Some(frame) = frames.next() {
            let frame = frame.map_err(|_| AuthError::NotShown)?;
            return Ok(op::read(&frame.text));
        }
        if seen > MAX_AUTH_BYTES {
            return Err(AuthError::TooMuch(MAX_AUTH_BYTES));
        }
        match timeout_at(due, read_some(stream, first)).await {
            Err(_) => return Err(AuthError::TooLate(HEAD_TIME)),
            Ok(Ok(0) | Err(_)) => return Err(AuthError::NotShown),
            Ok(Ok(_)) => {}
        }
    }
}

/// Closes an evicted client that has sent no whole first frame and no request. Sends the reason if the socket accepts
/// it without delay.
async fn refuse_evicted<S: AsyncWrite + Unpin>(
    session: &ClientSession,
    stream: &mut S,
    why: Refused,
) {
    let message = refused(&session.turn_away(why), None);
    let tell = async {
        stream.write_all(&message).await?;
        stream.shutdown().await
    };
    let _ = timeout(Duration::ZERO, tell).await;
}

/// The status of a client that is refused. `id` is that of its frame.
fn refused(why: &str, id: Option<&Payload>) -> Bytes {
    messages::status(Level::Error, why, id)
}
