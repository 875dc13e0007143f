//! The site: HTTP and the WebSocket upgrade, on the port that also speaks raw JSON.
//!
//! | file | what |
//! | --- | --- |
//! | [`head`] | the head of a request |
//! | [`access`] | admission: `Host`, `Origin`, the token |
//! | [`page`], [`report`] | the served files |
//! | [`upgrade`] | the WebSocket handshake |
//! | [`response`] | answers, with the headers that keep a browser strict |
//! | [`serve`] | the requests of one connection, and their answers |
//! | [`stream`] | the connection's stream, with its deadlines |
//!
//! It uses `protocol` and `tokio`'s streams, but no actor and no physics. A connection over an upgraded stream
//! works like one over a plain stream.
//!
//! **Invariant:** a connection that has begun with a request is never read as JSON, unless it becomes a WebSocket.

pub mod access;
pub mod head;
pub mod page;
pub mod report;
pub mod response;
pub mod serve;
pub mod stream;
pub mod upgrade;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::spawn_blocking;

use self::access::Access;

/// Folder of the report, unless another is named.
pub const DEFAULT_REPORT: &str = "report";

/// The files served over HTTP, and the rules of admission.
#[derive(Debug)]
pub struct Site {
    /// The rules of admission.
    pub access: Access,
    /// Folder of the last report. Empty if there is none.
    pub report: PathBuf,
    /// Origins whose pages may show the page and the report in a frame, separated by spaces.
    frames: String,
    /// The permit stays with the file.
    files: Arc<Semaphore>,
}

impl Default for Site {
    fn default() -> Self {
        Self::new(Access::default(), PathBuf::new(), &[])
    }
}

impl Site {
    /// A site with these rules and the report in that folder. Pages of the origins `frames` may show it in a frame.
    #[must_use]
    pub fn new(access: Access, report: PathBuf, frames: &[Box<str>]) -> Self {
        Self {
            access,
            report,
            frames: frames.join(" "),
            files: Arc::new(Semaphore::new(report::FILES)),
        }
    }

    /// Reads the report's folder on another thread, once there is a permit. `None` after a panic, or if the
    /// runtime is ending.
    async fn look<T: Send + 'static>(
        &self,
        look: impl FnOnce(&Path) -> T + Send + 'static,
    ) -> Option<(T, OwnedSemaphorePermit)> {
        let permit = Arc::clone(&self.files).acquire_owned().await.ok()?;
        self.look_with(permit, look).await
    }

    /// The same, but `None` if no permit is free now.
    async fn look_now<T: Send + 'static>(
        &self,
        look: impl FnOnce(&Path) -> T + Send + 'static,
    ) -> Option<(T, OwnedSemaphorePermit)> {
        let permit = Arc::clone(&self.files).try_acquire_owned().ok()?;
        self.look_with(permit, look).await
    }

    async fn look_with<T: Send + 'static>(
        &self,
        permit: OwnedSemaphorePermit,
        look: impl FnOnce(&Path) -> T + Send + 'static,
    ) -> Option<(T, OwnedSemaphorePermit)> {
        let folder = self.report.clone();
        if folder.as_os_str().is_empty() {
            // There is no file to wait for, and a simulation has only one thread.
            return Some((look(&folder), permit));
        }
        spawn_blocking(move || (look(&folder), permit)).await.ok()
    }
}
