//! The site: HTTP and the WebSocket upgrade, on the port that also speaks raw JSON.
//!
//! | file | what |
//! | --- | --- |
//! | [`head`] | bytes into a request |
//! | [`authority`], [`access`] | who may ask: `Host`, `Origin`, the token |
//! | [`page`], [`report`] | what there is to see |
//! | [`upgrade`] | the WebSocket handshake |
//! | [`response`] | answers, with the headers that keep a browser strict |
//! | [`serve`] | one request from a stream, one answer to it |
//! | [`message`] | a WebSocket message into a frame |
//!
//! It may use `protocol` and `tokio`'s streams; it knows no actor and no physics. What speaks over an upgraded stream
//! is the same connection as over a plain one.
//!
//! **Invariant:** one request a connection, then it is closed: what follows a request is never read as another one.

pub mod access;
pub mod authority;
pub mod bundle;
pub mod head;
pub mod message;
pub mod page;
pub mod report;
pub mod response;
pub mod serve;
pub mod upgrade;

use std::path::PathBuf;
use std::sync::Arc;

use tokio::sync::Semaphore;
use tokio::task::spawn_blocking;

use self::access::Access;

/// Requests that are answered at once, and as many for files of the report. A browser opens six connections; the rest
/// is for other people's.
pub const MAX_REQUESTS: usize = 64;
/// Folder of the report, unless another is named.
pub const DEFAULT_REPORT: &str = "report";

/// Threads at once that look at the report's folder: a disk that takes long keeps no others.
const DISK_PLACES: usize = 2;

/// The files that are served over HTTP, and the rules for whom.
#[derive(Debug)]
pub struct Site {
    /// Who may ask.
    pub access: Access,
    /// Folder of the last report.
    pub report: PathBuf,
    /// Places for those threads.
    disk: Arc<Semaphore>,
}

impl Site {
    /// A site with these rules, and the report that is in that folder.
    #[must_use]
    pub fn new(access: Access, report: PathBuf) -> Self {
        Self {
            access,
            report,
            disk: Arc::new(Semaphore::new(DISK_PLACES)),
        }
    }

    /// Does `work`, which waits for a disk, on another thread, once there is a place for it; `None` if it panicked, or
    /// if the runtime is ending.
    pub(crate) async fn at_disk<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Option<T> {
        let place = Arc::clone(&self.disk).acquire_owned().await.ok()?;
        let work = move || {
            let done = work();
            drop(place);
            done
        };
        spawn_blocking(work).await.ok()
    }
}

impl Default for Site {
    fn default() -> Self {
        Self::new(Access::default(), DEFAULT_REPORT.into())
    }
}
