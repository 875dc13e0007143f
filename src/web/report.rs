//! The last report: files of one folder, with simple names.
//!
//! **Invariant:** a served file is in the folder, and links that lead out of it are not followed. Its type is in the
//! table. At most [`FILES`] files are in memory, each of at most [`MAX_FILE`] bytes.

use std::fs;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use super::head::decode;

/// Path under which it is served.
pub const PREFIX: &str = "/report/";
/// The file served for a folder.
pub(super) const INDEX: &str = "index.html";
/// Most names in a path below the folder.
const MAX_DEPTH: usize = 8;

/// The policy of the report, which may use its own inline styles and figures, but no script and no request.
pub const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src 'self' data:; base-uri 'none'; \
     form-action 'none'; frame-ancestors 'none'";

/// Media types by file extension.
const KINDS: [(&str, &str); 8] = [
    ("html", "text/html; charset=utf-8"),
    ("css", "text/css; charset=utf-8"),
    ("svg", "image/svg+xml"),
    ("png", "image/png"),
    ("csv", "text/csv; charset=utf-8"),
    ("json", "application/json"),
    ("md", "text/plain; charset=utf-8"),
    ("txt", "text/plain; charset=utf-8"),
];

/// Most files that are read or sent at once.
pub const FILES: usize = 4;
/// Longest file that is sent \[bytes\]. The longest file of a full report has 1.5 MB.
pub const MAX_FILE: u64 = 4 * 1024 * 1024;

/// A file of the report, by its URL path.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileName {
    path: PathBuf,
    /// Its media type.
    pub kind: &'static str,
}

/// The media type of a file, by its name.
pub(super) fn media_type(name: &str) -> Option<&'static str> {
    let (_, ending) = name.rsplit_once('.')?;
    let (_, kind) = KINDS.iter().find(|(one, _)| *one == ending)?;
    Some(kind)
}

impl FileName {
    /// The file at `rest`, the path after [`PREFIX`]: letters, digits, `-`, `_` and `.` between slashes, no name that
    /// begins with a dot, and a known extension. The path of a folder gives its index.
    #[must_use]
    pub fn parse(rest: &str) -> Option<Self> {
        let mut whole = decode(rest)?;
        if whole.is_empty() || whole.ends_with('/') {
            whole += INDEX;
        }
        let plain = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'_' | b'.');
        let mut path = PathBuf::new();
        for (depth, name) in whole.split('/').enumerate() {
            let is_plain = !name.is_empty() && !name.starts_with('.') && name.bytes().all(plain);
            if depth >= MAX_DEPTH || !is_plain {
                return None;
            }
            path.push(name);
        }
        let kind = media_type(&whole)?;
        Some(Self { path, kind })
    }

    /// Reads the file in `folder`; `None` if `folder` has no such file. It may block on the disk.
    ///
    /// # Errors
    ///
    /// The system's error, or that the file is too long.
    pub fn read(&self, folder: &Path) -> io::Result<Option<Vec<u8>>> {
        let find = || {
            let folder = folder.canonicalize().ok()?;
            let path = folder.join(&self.path).canonicalize().ok()?;
            // Opening a pipe or a device could block.
            (path.starts_with(&folder) && path.is_file()).then_some(path)
        };
        let Some(path) = find() else {
            return Ok(None);
        };
        let mut bytes = Vec::new();
        let file = fs::File::open(path)?;
        file.take(MAX_FILE + 1).read_to_end(&mut bytes)?;
        if bytes.len() as u64 > MAX_FILE {
            return Err(io::Error::other(format!(
                "it is longer than {MAX_FILE} bytes"
            )));
        }
        Ok(Some(bytes))
    }
}
