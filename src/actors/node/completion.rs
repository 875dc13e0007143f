//! The completion of an op: the connection reads the client's next frame after it.

use std::sync::Arc;

use actix::prelude::*;
use tokio::sync::oneshot;

/// The completion of an op. From the registry, once it has routed the op.
#[derive(MessageResponse, Default)]
#[must_use]
pub struct Completion(Option<oneshot::Receiver<()>>);

/// Held by all that are still at work on an op: a node that has a call, a goal or a message, and the encoding of a
/// long message. The op is complete once the last clone is dropped.
#[derive(Clone)]
pub struct Working(
    #[expect(dead_code, reason = "dropping it is the signal")] Arc<oneshot::Sender<()>>,
);

impl Completion {
    /// The op has already taken effect.
    pub fn at_once() -> Self {
        Self::default()
    }

    /// The op is complete when the first value and all its clones are dropped.
    pub fn pending() -> (Working, Self) {
        let (working, complete) = oneshot::channel();
        (Working(Arc::new(working)), Self(Some(complete)))
    }

    /// Whether the op had taken effect when the registry answered.
    #[must_use]
    pub const fn is_at_once(&self) -> bool {
        self.0.is_none()
    }

    /// Waits until the op is complete.
    pub async fn wait(self) {
        if let Some(complete) = self.0 {
            // Nothing is ever sent.
            let _ = complete.await;
        }
    }
}
