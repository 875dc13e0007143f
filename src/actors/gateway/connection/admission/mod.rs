//! Admission: the conditions under which a client is served, whichever protocol it speaks.
//!
//! **Invariant:** with a token set, nothing is done for a client that has not shown it. Such clients, however many and
//! however silent, keep nobody out who has shown it.

pub(super) mod authentication;
mod failed_attempts;
pub(super) mod slots;

use self::failed_attempts::FailedAttempts;
pub use self::failed_attempts::{ATTEMPT_INTERVAL, FREE_ATTEMPTS, MAX_ADDRESSES};
use self::slots::Slots;
use crate::protocol::op::token::Token;
#[cfg(feature = "web")]
use crate::web::Site;

/// Bytes that a client may send before it has shown its token.
pub const MAX_AUTH_BYTES: usize = 16 * 1024;
/// Connections that have not shown the token yet. They are counted apart from the clients, and the oldest is closed
/// for the next. A client that shows the token at once is never the oldest of them.
pub const MAX_UNAUTHENTICATED: usize = 128;

/// Clients that wait for a kept place, where no other place is free. The oldest is refused when there are more.
pub const MAX_WAITING: usize = 128;

/// The conditions under which a listener admits clients.
#[derive(Debug, Default)]
pub struct Admission {
    /// Every client has to show this, if it is set.
    pub token: Option<Token>,
    /// Says which clients are served over HTTP, and with which files.
    #[cfg(feature = "web")]
    pub site: Site,
    /// The clients that are not admitted yet.
    pub newcomers: Newcomers,
}

/// The clients that are not admitted yet, and the addresses whose tokens were wrong.
#[derive(Debug)]
pub struct Newcomers {
    /// Slots of clients that have to show the token and have not.
    pub(super) unauthenticated: Slots,
    pub(super) failed_attempts: FailedAttempts,
    /// Slots of clients that may have a kept place, while they have not shown it or none is free.
    pub(super) waiting: Slots,
}

impl Newcomers {
    /// Makes room for `unauthenticated` clients that have not shown the token yet.
    #[must_use]
    pub fn of(unauthenticated: usize) -> Self {
        Self {
            unauthenticated: Slots::new(unauthenticated),
            failed_attempts: FailedAttempts::default(),
            waiting: Slots::new(MAX_WAITING),
        }
    }
}

impl Default for Newcomers {
    fn default() -> Self {
        Self::of(MAX_UNAUTHENTICATED)
    }
}
