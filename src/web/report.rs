//! The last report: files of one folder, by plain names. They are read piece by piece: however long one is, it
//! takes a piece's memory.
//!
//! **Invariant:** what is served lies in the folder, also where a link in it points elsewhere, and is of a kind that is
//! listed.

use std::io::{self, Read, Take};
use std::path::{Path, PathBuf};

/// Path under which it is served.
pub const PREFIX: &str = "/report/";
/// The kinds of files that are shown of a folder.
const INDEX: &str = "index.html";
/// Deepest file below the folder, in names.
const MAX_DEPTH: usize = 8;

/// The policy of the report, which may show its own inline styles and figures. It runs no script and makes no request.
pub const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src 'self' data:; base-uri 'none'; \
     form-action 'none'; frame-ancestors 'none'";

/// Kinds of files by their names' end.
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

/// A file of the report, by its path on the web.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileName {
    path: PathBuf,
    /// Its media type.
    pub kind: &'static str,
}

/// A file that is being read.
#[derive(Debug)]
pub struct File {
    /// Its length when it was opened \[bytes\].
    pub length: u64,
    /// The bytes of that length that have not been read.
    rest: Take<std::fs::File>,
}

/// Whether there is a report in the folder: one look at the disk.
#[must_use]
pub fn exists(folder: &Path) -> bool {
    folder.join(INDEX).is_file()
}

impl FileName {
    /// The file that `rest`, what follows [`PREFIX`], names: letters, digits, `-`, `_` and `.` between slashes, no name
    /// beginning with a dot, a known ending. A folder's is its index.
    #[must_use]
    pub fn parse(rest: &str) -> Option<Self> {
        let rest = super::head::decode(rest)?;
        let whole = if rest.is_empty() || rest.ends_with('/') {
            format!("{rest}{INDEX}")
        } else {
            rest.into_owned()
        };
        let plain = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'_' | b'.');
        let mut path = PathBuf::new();
        for (depth, name) in whole.split('/').enumerate() {
            let is_plain = !name.is_empty() && !name.starts_with('.') && name.bytes().all(plain);
            if depth >= MAX_DEPTH || !is_plain {
                return None;
            }
            path.push(name);
        }
        let ending = path.extension()?.to_str()?;
        let (_, kind) = KINDS.iter().find(|(one, _)| *one == ending)?;
        Some(Self { path, kind })
    }

    /// The file in `folder`; `None` if there is none to be had.
    fn find(&self, folder: &Path) -> Option<PathBuf> {
        let folder = folder.canonicalize().ok()?;
        let path = folder.join(&self.path).canonicalize().ok()?;
        if !path.starts_with(&folder) {
            return None;
        }
        // Asked first: opening what is no file, a pipe say, could wait for ever.
        path.metadata().ok()?.is_file().then_some(path)
    }

    /// Opens the file in `folder`; `None` if there is none to be had. It may block for as long as the disk takes.
    ///
    /// # Errors
    ///
    /// The system's, where the file can't be opened: too many are open, or it is not ours to read.
    pub fn open(&self, folder: &Path) -> io::Result<Option<File>> {
        let Some(path) = self.find(folder) else {
            return Ok(None);
        };
        let file = std::fs::File::open(path)?;
        let length = file.metadata()?.len();
        let rest = file.take(length);
        Ok(Some(File { length, rest }))
    }
}

impl File {
    /// The next piece, of at most so many bytes: none at the end, which comes early if the file has become shorter. It
    /// may block as [`FileName::open`] does.
    ///
    /// # Errors
    ///
    /// The system's, where the file can't be read.
    pub fn next_piece(&mut self, most: usize) -> io::Result<Vec<u8>> {
        let mut piece = Vec::with_capacity(most);
        let most = u64::try_from(most).unwrap_or(u64::MAX);
        self.rest.by_ref().take(most).read_to_end(&mut piece)?;
        Ok(piece)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_names_of_known_kinds_are_taken() {
        for (rest, path, kind) in [
            ("", "index.html", "text/html"),
            ("a/", "a/index.html", "text/html"),
            ("error.svg", "error.svg", "image/svg+xml"),
            ("data/a-1_b.2.csv", "data/a-1_b.2.csv", "text/csv"),
            ("%61.svg", "a.svg", "image/svg+xml"),
        ] {
            let name = FileName::parse(rest).unwrap();
            assert_eq!(name.path, Path::new(path));
            assert!(name.kind.starts_with(kind));
        }
    }

    #[test]
    fn everything_else_is_not() {
        for rest in [
            "..",
            "../a.svg",
            "a/../b.svg",
            "%2e%2e/a.svg",
            "..%2fa.svg",
            "a//b.svg",
            "/a.svg",
            ".hidden.svg",
            "a\\b.svg",
            "a",
            "a.exe",
            "a.svg%00",
            "a.SVG",
            "a b.svg",
            ".",
            "a/.git/config.json",
            "c:/a.svg",
            "a.js",
            "1/2/3/4/5/6/7/8/9.svg",
        ] {
            assert_eq!(FileName::parse(rest), None, "{rest}");
        }
    }

    #[test]
    fn a_file_is_read_in_pieces_as_long_as_it_was_when_it_was_opened() {
        let folder = std::env::temp_dir().join(format!("pendularm-report-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("a.csv");
        let name = FileName::parse("a.csv").unwrap();
        assert!(name.open(&folder).unwrap().is_none());
        for (later, pieces) in [
            ("1234567890", ["1234", "5678", "9", ""]),
            ("12345", ["1234", "5", "", ""]),
        ] {
            std::fs::write(&path, "123456789").unwrap();
            let mut file = name.open(&folder).unwrap().unwrap();
            std::fs::write(&path, later).unwrap();
            assert_eq!(file.length, 9);
            let read = pieces.map(|_| String::from_utf8(file.next_piece(4).unwrap()).unwrap());
            assert_eq!(read, pieces);
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
