//! The token over raw TCP: the first frame shows it, or the client is not let in.
//!
//! **Invariant:** nothing behind a first frame that does not show the token is looked at.

use tokio::io::AsyncRead;
use tokio::time::{Instant, timeout_at};

use super::gate::MAX_LOCKED;
use super::transport::read_some;
use super::unfinished::First;
use crate::actors::gateway::limits::HEAD_TIME;
use crate::protocol::op::token::Token;
use crate::protocol::op::{self, Op};
use crate::protocol::wire::frame::{Frame, FrameError, FrameReader};

/// Why a client that has to show a token is not let in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(super) enum LockedOut {
    #[error("this runtime asks for its token first: {{\"op\":\"auth\",\"token\":...}}")]
    NotShown,
    #[error("token: not this runtime's")]
    Wrong,
    #[error("this runtime asks for its token first, and waited for {} s", HEAD_TIME.as_secs())]
    TooLate,
    #[error("this runtime asks for its token first, in at most {MAX_LOCKED} bytes")]
    TooMuch,
    #[error("this runtime asks for its token first, and too many others have yet to show it")]
    Crowded,
}

/// Reads until `due` up to a first frame that shows the token; `first` has been read already, and is empty then. What
/// came behind the frame is in the reader.
pub(super) async fn unlock<S: AsyncRead + Unpin>(
    token: &Token,
    stream: &mut S,
    first: &mut First,
    due: Instant,
) -> Result<FrameReader, LockedOut> {
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
        if received > MAX_LOCKED {
            return Err(LockedOut::TooMuch);
        }
        match timeout_at(due, read_some(stream, &mut first.bytes)).await {
            Err(_) => return Err(LockedOut::TooLate),
            Ok(Ok(0) | Err(_)) => return Err(LockedOut::NotShown),
            Ok(Ok(_)) => {}
        }
    }
}

/// Whether a client's first frame lets it in.
fn shows(token: &Token, frame: Result<&Frame, &FrameError>) -> Result<(), LockedOut> {
    let Ok(frame) = frame else {
        return Err(LockedOut::NotShown);
    };
    match op::read(&frame.text).op {
        Ok(Op::Auth { token: shown }) if token.matches(&shown) => Ok(()),
        Ok(Op::Auth { .. }) => Err(LockedOut::Wrong),
        _ => Err(LockedOut::NotShown),
    }
}
