//! Authentication over raw TCP: the first frame shows the token, or the client is not admitted.
//!
//! **Invariant:** nothing behind a first frame that does not show the token is looked at.

use bytes::BytesMut;
use tokio::io::AsyncRead;
use tokio::time::{Instant, timeout_at};

use super::MAX_AUTH_BYTES;
use crate::actors::gateway::connection::plain::read_some;
use crate::actors::gateway::limits::HEAD_TIME;
use crate::protocol::op::token::Token;
use crate::protocol::op::{self, Op};
use crate::protocol::wire::frame::{Frame, FrameReader};

/// Why a client that has to show a token is not admitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(crate) enum AuthError {
    #[error("this runtime asks for its token first: {{\"op\":\"auth\",\"token\":...}}")]
    NotShown,
    #[error("token: not this runtime's")]
    Wrong,
    #[error("this runtime asks for its token first, and waited for {} s", HEAD_TIME.as_secs())]
    TooLate,
    #[error("this runtime asks for its token first, in at most {MAX_AUTH_BYTES} bytes")]
    TooMuch,
    #[error("this runtime asks for its token first, and too many others have yet to show it")]
    Crowded,
}

/// Reads until `due` up to a first frame that shows the token, and returns whether it is that of a command of this
/// program. All that was read stays in `first`.
pub(crate) async fn authenticate<S: AsyncRead + Unpin>(
    token: &Token,
    stream: &mut S,
    first: &mut BytesMut,
    due: Instant,
) -> Result<bool, AuthError> {
    let frame = first_frame(stream, first, due).await?;
    match op::read(&frame.text).op {
        Ok(Op::Auth {
            token: Some(shown),
            is_command,
        }) if token.matches(&shown) => Ok(is_command),
        Ok(Op::Auth { token: Some(_), .. }) => Err(AuthError::Wrong),
        _ => Err(AuthError::NotShown),
    }
}

/// Reads until `due` up to a first frame, and returns whether it is that of a command of this program. All that was
/// read stays in `first`.
pub(crate) async fn opens_as_command<S: AsyncRead + Unpin>(
    stream: &mut S,
    first: &mut BytesMut,
    due: Instant,
) -> bool {
    let frame = first_frame(stream, first, due).await;
    let op = frame.map(|frame| op::read(&frame.text).op);
    matches!(op, Ok(Ok(Op::Auth { is_command, .. })) if is_command)
}

async fn first_frame<S: AsyncRead + Unpin>(
    stream: &mut S,
    first: &mut BytesMut,
    due: Instant,
) -> Result<Frame, AuthError> {
    let mut frames = FrameReader::new();
    let mut seen = 0;
    loop {
        frames.push(first.get(seen..).unwrap_or_default());
        seen = first.len();
        if let Some(frame) = frames.next() {
            return frame.map_err(|_| AuthError::NotShown);
        }
        if seen > MAX_AUTH_BYTES {
            return Err(AuthError::TooMuch);
        }
        match timeout_at(due, read_some(stream, first)).await {
            Err(_) => return Err(AuthError::TooLate),
            Ok(Ok(0) | Err(_)) => return Err(AuthError::NotShown),
            Ok(Ok(_)) => {}
        }
    }
}
