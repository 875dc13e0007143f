//! Authentication over raw TCP: the first frame shows the token, or the client is not admitted.
//!
//! **Invariant:** nothing behind a first frame that does not show the token is looked at.

use tokio::io::AsyncRead;
use tokio::time::{Instant, timeout_at};

use super::MAX_AUTH_BYTES;
use crate::actors::gateway::connection::transport::read_some;
use crate::actors::gateway::connection::unfinished::First;
use crate::actors::gateway::limits::HEAD_TIME;
use crate::protocol::op::token::Token;
use crate::protocol::op::{self, Op};
use crate::protocol::wire::frame::{Frame, FrameError, FrameReader};

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

/// Reads until `due` up to a first frame that shows the token; `first` has been read already, and is empty afterwards.
/// The reader keeps what came behind the frame.
pub(crate) async fn authenticate<S: AsyncRead + Unpin>(
    token: &Token,
    stream: &mut S,
    first: &mut First,
    due: Instant,
) -> Result<FrameReader, AuthError> {
    let mut frames = FrameReader::new();
    let mut received = 0;
    loop {
        received += first.bytes.len();
        frames.push(&first.bytes);
        first.bytes.clear();
        first
            .unfinished
            .keep(first.bytes.capacity() + frames.buffered());
        if let Some(frame) = frames.next() {
            return shows(token, frame.as_ref()).map(|()| frames);
        }
        if received > MAX_AUTH_BYTES {
            return Err(AuthError::TooMuch);
        }
        match timeout_at(due, read_some(stream, &mut first.bytes)).await {
            Err(_) => return Err(AuthError::TooLate),
            Ok(Ok(0) | Err(_)) => return Err(AuthError::NotShown),
            Ok(Ok(_)) => {}
        }
    }
}

/// Whether a client's first frame shows the token.
fn shows(token: &Token, frame: Result<&Frame, &FrameError>) -> Result<(), AuthError> {
    let Ok(frame) = frame else {
        return Err(AuthError::NotShown);
    };
    match op::read(&frame.text).op {
        Ok(Op::Auth { token: shown }) if token.matches(&shown) => Ok(()),
        Ok(Op::Auth { .. }) => Err(AuthError::Wrong),
        _ => Err(AuthError::NotShown),
    }
}
