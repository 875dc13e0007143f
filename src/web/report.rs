//! The last report: files of one folder, by plain names.
//!
//! **Invariant:** what is served lies in the folder, also where a link in it points elsewhere, and is of a kind that is
//! listed.

use std::io::Read;
use std::path::{Path, PathBuf};

/// Path under which it is served.
pub const PREFIX: &str = "/report/";
/// The kinds of files that are shown of a folder.
const INDEX: &str = "index.html";
/// Deepest file below the folder, in names.
const MAX_DEPTH: usize = 8;
/// Largest file: a report with all its figures has a few MiB.
pub const MAX_FILE: u64 = 32 * 1024 * 1024;

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

/// A file that was read.
#[derive(Debug)]
pub struct File {
    /// Its media type.
    pub kind: &'static str,
    /// Its bytes.
    pub bytes: Vec<u8>,
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

    /// The file in `folder`, and its length; `None` if there is none to be had, or it is longer than [`MAX_FILE`].
    fn find(&self, folder: &Path) -> Option<(PathBuf, u64)> {
        let folder = folder.canonicalize().ok()?;
        let path = folder.join(&self.path).canonicalize().ok()?;
        if !path.starts_with(&folder) {
            return None;
        }
        // Asked first: opening what is no file, a pipe say, could wait for ever.
        let about = path.metadata().ok()?;
        let fits = about.is_file() && about.len() <= MAX_FILE;
        fits.then_some((path, about.len()))
    }

    /// The length of the file in `folder`, as [`FileName::read`] would read it now.
    #[must_use]
    pub fn length(&self, folder: &Path) -> Option<u64> {
        self.find(folder).map(|(_, length)| length)
    }

    /// Reads the file from `folder`; `None` if there is none to be had. It may block for as long as the disk takes.
    #[must_use]
    pub fn read(&self, folder: &Path) -> Option<File> {
        let (path, _) = self.find(folder)?;
        let mut bytes = Vec::new();
        let file = std::fs::File::open(path).ok()?;
        file.take(MAX_FILE + 1).read_to_end(&mut bytes).ok()?;
        let fits = u64::try_from(bytes.len()).is_ok_and(|length| length <= MAX_FILE);
        let kind = self.kind;
        fits.then_some(File { kind, bytes })
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
    fn a_file_may_be_so_long_and_no_longer() {
        let folder = std::env::temp_dir().join(format!("pendularm-report-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let file = std::fs::File::create(folder.join("a.csv")).unwrap();
        let name = FileName::parse("a.csv").unwrap();
        for (length, is_read) in [(MAX_FILE, true), (MAX_FILE + 1, false)] {
            // Nothing is written: such a file has a length and no content on the disk.
            file.set_len(length).unwrap();
            assert_eq!(name.read(&folder).is_some(), is_read, "{length}");
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
