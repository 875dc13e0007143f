//! The site: HTTP and the WebSocket upgrade, on the port that also speaks raw JSON.
//!
//! | file | what |
//! | --- | --- |
//! | [`head`] | the head of a request |
//! | [`authority`], [`access`] | who may ask: `Host`, `Origin`, the token |
//! | [`page`], [`report`] | what there is to see |
//! | [`upgrade`] | the WebSocket handshake |
//! | [`response`] | answers, with the headers that keep a browser strict |
//! | [`serve`] | the requests of one connection, and their answers |
//! | [`stream`] | the connection's stream, with its deadlines |
//!
//! It may use `protocol` and `tokio`'s streams; it knows no actor and no physics. The connection over an upgraded
//! stream is the same as over a plain one.
//!
//! **Invariant:** a connection that has begun with a request is never read as JSON, unless it becomes a WebSocket.

pub mod access;
pub mod authority;
pub mod head;
pub mod page;
pub mod report;
pub mod response;
pub mod serve;
pub mod stream;
pub mod upgrade;

use std::path::PathBuf;

use self::access::Access;
use self::report::Disk;

/// Folder of the report, unless another is named.
pub const DEFAULT_REPORT: &str = "report";

/// The files that are served over HTTP, and the rules for whom.
#[derive(Debug, Default)]
pub struct Site {
    /// The rules of admission.
    pub access: Access,
    /// Folder of the last report.
    pub report: PathBuf,
    /// Origins whose pages may show the page and the report in a frame, separated by spaces.
    frames: String,
    disk: Disk,
}

impl Site {
    /// A site with these rules, and the report that is in that folder.
    #[must_use]
    pub fn new(access: Access, report: PathBuf) -> Self {
        Self {
            access,
            report,
            ..Self::default()
        }
    }

    /// The same site, which pages of these origins may show in a frame.
    #[must_use]
    pub fn framed_by(self, origins: &[Box<str>]) -> Self {
        let frames = origins.join(" ");
        Self { frames, ..self }
    }
}
