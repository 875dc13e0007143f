//! Admission: the conditions under which a client is served, for every protocol.
//!
//! **Invariant:** with a token set, bytes after a first frame without the token are not read. Any number of clients
//! without the token cannot block a client with the token.

use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use bytes::BytesMut;
use tokio::io::AsyncRead;
use tokio::sync::oneshot;
use tokio::time::{Instant, timeout_at};

use super::transport::read_some;
use crate::actors::gateway::limits::HEAD_TIME;
use crate::protocol::op::token::Token;
use crate::protocol::op::{self, Incoming, Op};
use crate::protocol::wire::frame::FrameReader;
#[cfg(feature = "web")]
use crate::web::Site;

/// Bytes that a client may send before it has shown its token.
pub const MAX_AUTH_BYTES: usize = 16 * 1024;
/// Most newcomers: connections without a token yet, or without a free place. They are counted separately from the
/// clients, and the next newcomer evicts the oldest. A newcomer that sends its token at once never becomes the
/// oldest.
pub const MAX_NEWCOMERS: usize = 128;

/// Delay of the answer to a wrong token. In this time at most [`MAX_NEWCOMERS`] wrong tokens are answered. The
/// [length](crate::protocol::op::token::MIN_TOKEN) of a token makes guessing hopeless.
pub const WRONG_TOKEN_TIME: Duration = Duration::from_millis(500);

/// The conditions under which a listener admits clients.
#[derive(Debug, Default)]
pub struct Admission {
    /// If it is set, every client must send it.
    pub token: Option<Token>,
    /// Selects the clients that are served over HTTP, and the files for them.
    #[cfg(feature = "web")]
    pub site: Site,
    /// Slots of newcomers.
    pub newcomers: Slots,
}

// ---- the slots of newcomers -----------------------------------------------------------------------------------------

/// A fixed number of slots, oldest holder first. When all are in use, a newcomer evicts the oldest holder. Honest
/// clients finish quickly, so slow ones become the oldest. Refusing the newcomer would block honest clients.
#[derive(Debug)]
pub struct Slots {
    most: usize,
    /// A sender for each holder. It is dropped when the holder is evicted.
    taken: Mutex<VecDeque<oneshot::Sender<()>>>,
}

/// A slot that is in use. It ends when its holder is evicted. Dropping it frees the slot.
pub(super) type HeldSlot = oneshot::Receiver<()>;

/// [`MAX_NEWCOMERS`] slots.
impl Default for Slots {
    fn default() -> Self {
        Self::new(MAX_NEWCOMERS)
    }
}

impl Slots {
    /// Makes `most` slots, all of them free.
    #[must_use]
    pub fn new(most: usize) -> Self {
        Self {
            most,
            taken: Mutex::default(),
        }
    }

    /// Takes a slot. Evicts the oldest holder if none is free.
    pub(super) fn take(&self) -> HeldSlot {
        let (sender, slot) = oneshot::channel();
        let mut taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        taken.retain(|holder| !holder.is_closed());
        if taken.len() >= self.most {
            taken.pop_front();
        }
        taken.push_back(sender);
        slot
    }
}

// ---- the token over raw TCP: in the first frame ---------------------------------------------------------------------

/// Why a client that must send a token is not admitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(super) enum AuthError {
    #[error("this runtime requires its token first: {{\"op\":\"auth\",\"token\":...}}")]
    NotShown,
    #[error("token: not this runtime's")]
    Wrong,
    #[error("this runtime requires its token first, and waited for {} s", HEAD_TIME.as_secs())]
    TooLate,
    #[error("this runtime requires its token first, in at most {MAX_AUTH_BYTES} bytes")]
    TooMuch,
}

/// Checks whether a client's first frame has the token.
pub(super) fn authenticate(token: &Token, frame: &Incoming) -> Result<(), AuthError> {
    match &frame.op {
        Ok(Op::Auth {
            token: Some(shown), ..
        }) if token.matches(shown) => Ok(()),
        Ok(Op::Auth { token: Some(_), .. }) => Err(AuthError::Wrong),
        _ => Err(AuthError::NotShown),
    }
}

/// Whether a first frame is from a command of this program.
pub(super) const fn is_command(frame: &Incoming) -> bool {
    matches!(frame.op, Ok(Op::Auth { is_command, .. }) if is_command)
}

/// Reads a first frame until `due`. All bytes read stay in `first`. Returns its op and its `id`, or why there is no frame.
pub(super) async fn first_frame<S: AsyncRead + Unpin>(
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
            return Err(AuthError::TooMuch);
        }
        match timeout_at(due, read_some(stream, first)).await {
            Err(_) => return Err(AuthError::TooLate),
            Ok(Ok(0) | Err(_)) => return Err(AuthError::NotShown),
            Ok(Ok(_)) => {}
        }
    }
}
