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

use self::access::Access;

/// Requests that are answered at once, and as many for files of the report. A browser opens six connections; the rest
/// is for other people's.
pub const MAX_REQUESTS: usize = 64;
/// Bytes of files of the report that are kept at once while they are sent: two of the longest, or the whole of one
/// report.
pub const MAX_FILES_TOTAL: u64 = 64 * 1024 * 1024;
/// Folder of the report, unless another is named.
pub const DEFAULT_REPORT: &str = "report";

/// Bytes that room for files is counted in.
pub(crate) const ROOM: u64 = 64 * 1024;

/// The files that are served over HTTP, and the rules for whom.
#[derive(Debug)]
pub struct Site {
    /// Who may ask.
    pub access: Access,
    /// Folder of the last report.
    pub report: PathBuf,
    /// Room for files, in [`ROOM`].
    pub(crate) room: Arc<Semaphore>,
}

impl Site {
    /// A site with these rules, and the report that is in that folder.
    #[must_use]
    pub fn new(access: Access, report: PathBuf) -> Self {
        Self {
            access,
            report,
            room: Arc::new(Semaphore::new(
                usize::try_from(MAX_FILES_TOTAL / ROOM).unwrap_or(1),
            )),
        }
    }
}

impl Default for Site {
    fn default() -> Self {
        Self::new(Access::default(), DEFAULT_REPORT.into())
    }
}
