//! What is asked of every client before it is let in, whichever protocol it speaks.
//!
//! **Invariant:** with a token set, nothing is done for a client that has not shown it.

use std::time::Duration;

use crate::protocol::token::Token;
#[cfg(feature = "web")]
use crate::web::Door;

/// How long a request may take from its first bytes to the end of its head, and how long a client may take to show its
/// token: as much as a slow line needs, too little to hold a place for.
pub const HEAD_TIME: Duration = Duration::from_secs(5);
/// Bytes that a client may send before it has shown its token.
pub const MAX_LOCKED: usize = 16 * 1024;

/// What a listener hands to each of its connections.
#[derive(Debug, Default)]
pub struct Gate {
    /// What every client has to show, if anything.
    pub token: Option<Token>,
    /// What is served over HTTP, and to whom.
    #[cfg(feature = "web")]
    pub door: Door,
}
