//! Admission: the conditions under which a client is served, whichever protocol it speaks.
//!
//! **Invariant:** with a token set, nothing is done for a client that has not shown it. Such clients, however many and
//! however silent, keep nobody out who has shown it.

pub(super) mod authentication;
pub mod slots;

use std::time::Duration;

use self::slots::Slots;
use crate::protocol::op::token::Token;
#[cfg(feature = "web")]
use crate::web::Site;

/// Bytes that a client may send before it has shown its token.
pub const MAX_AUTH_BYTES: usize = 16 * 1024;
/// Connections that have not shown the token yet. They are counted apart from the clients, and the oldest is closed
/// for the next. A client that shows the token at once is never the oldest of them.
pub const MAX_UNAUTHENTICATED: usize = 128;

/// How long the answer to a wrong token takes. No more of them are answered in that time than there may be clients that
/// have not shown the token. The [length](crate::protocol::op::token::MIN_TOKEN) of a token makes guessing hopeless.
pub const WRONG_TOKEN_TIME: Duration = Duration::from_millis(500);

/// The conditions under which a listener admits clients.
#[derive(Debug, Default)]
pub struct Admission {
    /// Every client has to show this, if it is set.
    pub token: Option<Token>,
    /// Says which clients are served over HTTP, and with which files.
    #[cfg(feature = "web")]
    pub site: Site,
    /// Slots of clients that have to show the token and have not.
    pub unauthenticated: Slots,
    /// Slots of clients that may have a kept place, while they have not shown it or none is free: the oldest is refused
    /// for the next.
    pub waiting: Slots,
}

/// [`MAX_UNAUTHENTICATED`] slots.
impl Default for Slots {
    fn default() -> Self {
        Self::new(MAX_UNAUTHENTICATED)
    }
}
