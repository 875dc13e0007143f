//! Whether a client has left, and the wait for it.

use std::sync::Arc;

use tokio::sync::Semaphore;

/// A client that leaves once; clones share it.
#[derive(Debug, Clone)]
pub struct Gone(Arc<Semaphore>);

impl Default for Gone {
    fn default() -> Self {
        Self(Arc::new(Semaphore::new(0)))
    }
}

impl Gone {
    /// The client has left.
    pub fn set(&self) {
        self.0.close();
    }

    /// Whether it has left.
    #[must_use]
    pub fn is_set(&self) -> bool {
        self.0.is_closed()
    }

    /// Ends when it has left.
    pub async fn wait(&self) {
        // There are no permits, so only the closing ends it.
        let _ = self.0.acquire().await;
    }
}
