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
use crate::protocol::wire::frame::FrameReader;

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

/// The op of a client's first frame, if it shows the token.
pub(crate) fn authenticate(token: &Token, op: Op) -> Result<Op, AuthError> {
    match &op {
        Op::Auth {
            token: Some(shown), ..
        } if token.matches(shown) => Ok(op),
        Op::Auth { token: Some(_), .. } => Err(AuthError::Wrong),
        _ => Err(AuthError::NotShown),
    }
}

/// Whether a first frame is that of a command of this program.
pub(crate) const fn is_command(op: &Op) -> bool {
    matches!(op, Op::Auth { is_command, .. } if *is_command)
}

/// Reads until `due` up to a first frame. All that was read stays in `first`.
pub(crate) async fn first_op<S: AsyncRead + Unpin>(
    stream: &mut S,
    first: &mut BytesMut,
    due: Instant,
) -> Result<Op, AuthError> {
    let mut frames = FrameReader::new();
    let mut seen = 0;
    loop {
        frames.push(first.get(seen..).unwrap_or_default());
        seen = first.len();
        if let Some(frame) = frames.next() {
            let frame = frame.map_err(|_| AuthError::NotShown)?;
            return op::read(&frame.text).op.map_err(|_| AuthError::NotShown);
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
