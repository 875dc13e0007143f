//! Admission: the conditions under which a client is served, for every protocol.
//!
//! **Invariant:** with a token set, bytes after a first frame without the token are not read. Any number of clients
//! without the token cannot block a client with the token.

use std::time::Duration;

use bytes::BytesMut;
use tokio::io::AsyncRead;
use tokio::time::{Instant, timeout_at};

use super::transport::read_some;
use crate::actors::gateway::limits::HEAD_TIME;
use crate::actors::resources::places::Slots;
use crate::protocol::op::token::{AuthError, Token};
use crate::protocol::op::{self, Incoming};
use crate::protocol::wire::frame::FrameReader;
#[cfg(feature = "web")]
use crate::web::Site;

/// Bytes that a client may send before it has shown its token.
pub const MAX_AUTH_BYTES: usize = 16 * 1024;
/// Delay of the answer to a wrong token. In this time at most
/// [`MAX_NEWCOMERS`](crate::actors::resources::places::MAX_NEWCOMERS) wrong tokens are answered. The
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

// ---- the token over raw TCP: in the first frame ---------------------------------------------------------------------

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
            return Err(AuthError::TooMuch(MAX_AUTH_BYTES));
        }
        match timeout_at(due, read_some(stream, first)).await {
            Err(_) => return Err(AuthError::TooLate(HEAD_TIME)),
            Ok(Ok(0) | Err(_)) => return Err(AuthError::NotShown),
            Ok(Ok(_)) => {}
        }
    }
}
