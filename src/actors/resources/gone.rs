//! Whether a client has left, and the wait for it.

use std::sync::Arc;

use tokio::sync::Semaphore;

use super::unread::{Ends, closed, is_closed};

/// A client that leaves once; clones share it.
#[derive(Debug, Clone)]
pub struct Gone {
    left: Arc<Semaphore>,
    ends: Ends,
}

/// A client without a known socket.
impl Default for Gone {
    fn default() -> Self {
        Self::of(Ends::default())
    }
}

impl Gone {
    /// The client with these ends, which has not left.
    #[must_use]
    pub fn of(ends: Ends) -> Self {
        let left = Arc::new(Semaphore::new(0));
        Self { left, ends }
    }

    /// The client has left.
    pub fn set(&self) {
        self.left.close();
    }

    /// Whether it has left.
    #[must_use]
    pub fn is_set(&self) -> bool {
        self.left.is_closed()
    }

    /// The same, and asks the system whether it has closed its socket, which takes some microseconds. While its
    /// request waits, nothing is read from the client or written to it, so nothing else shows it.
    #[must_use]
    pub fn look(&self) -> bool {
        if !self.is_set() && is_closed(self.ends) {
            self.set();
        }
        self.is_set()
    }

    /// Waits until an op has taken effect that may wait for memory, since nothing is read meanwhile. If the client has
    /// closed its socket, the op is told, and its effect is not waited for.
    pub async fn unless_closed(self, effect: impl Future<Output = ()>) {
        tokio::select! {
            biased;
            () = effect => {}
            () = closed(self.ends) => self.set(),
        }
    }

    /// Ends when it has left.
    pub async fn wait(&self) {
        // There are no permits, so only the closing ends it.
        let _ = self.left.acquire().await;
    }
}
