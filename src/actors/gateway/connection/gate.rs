//! The gate: every client passes it before it is let in, whichever protocol it speaks.
//!
//! **Invariant:** with a token set, nothing is done for a client that has not shown it, and those that have not,
//! however many and however silent, keep nobody out who has.

use super::guesses::Guesses;
pub use super::guesses::{FREE_GUESSES, GUESS_INTERVAL, MAX_ADDRESSES};
use super::places::Places;
use crate::protocol::op::token::Token;
#[cfg(feature = "web")]
use crate::web::{Door, MAX_REQUESTS};

/// Bytes that a client may send before it has shown its token.
pub const MAX_LOCKED: usize = 16 * 1024;
/// Connections that have not shown the token yet. They are counted apart from the clients, and the oldest makes room
/// for the next: whoever shows the token at once is never the oldest of so many.
pub const MAX_UNAUTHENTICATED: usize = 128;

/// Requests whose heads are not complete: the oldest makes room for the next, and a browser sends a head at once.
#[cfg(feature = "web")]
pub const MAX_HEADS: usize = 128;

/// The conditions under which a listener lets clients in.
#[derive(Debug, Default)]
pub struct Gate {
    /// Every client has to show this, if it is set.
    pub token: Option<Token>,
    /// Says which clients are served over HTTP, and with which files.
    #[cfg(feature = "web")]
    pub door: Door,
    /// Who is on the way in.
    pub admission: Admission,
}

/// The clients that are on their way in, and the addresses that have tried.
#[derive(Debug)]
pub struct Admission {
    /// Places of clients that have to show the token and have not.
    pub(super) unauthenticated: Places,
    pub(super) guesses: Guesses,
    /// Places of requests whose heads are not complete, where there is no token to be shown.
    #[cfg(feature = "web")]
    pub(super) heads: Places,
    /// Places of responses to requests.
    #[cfg(feature = "web")]
    pub(super) answers: Places,
    /// Places of responses that are files of the report, apart: a client that takes one slowly keeps nobody from the
    /// page.
    #[cfg(feature = "web")]
    pub(super) files: Places,
}

impl Admission {
    /// With so many places for those that have not shown the token yet.
    #[must_use]
    pub fn of(unauthenticated: usize) -> Self {
        Self {
            unauthenticated: Places::new(unauthenticated),
            guesses: Guesses::default(),
            #[cfg(feature = "web")]
            heads: Places::new(MAX_HEADS),
            #[cfg(feature = "web")]
            answers: Places::new(MAX_REQUESTS),
            #[cfg(feature = "web")]
            files: Places::new(MAX_REQUESTS),
        }
    }
}

impl Default for Admission {
    fn default() -> Self {
        Self::of(MAX_UNAUTHENTICATED)
    }
}
