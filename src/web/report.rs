//! The last report: files of one folder, by plain names. They are read piece by piece: however long one is, it
//! takes a piece's memory, and it is open only while a piece is read.
//!
//! **Invariant:** what is served lies in the folder, also where a link in it points elsewhere, and is of a kind that is
//! listed.

use std::fs::{self, Metadata};
use std::io::{self, Read, Seek, SeekFrom};
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

/// A file that is being read: as it was when it was found, or not at all.
#[derive(Debug)]
pub struct File {
    path: PathBuf,
    found: Metadata,
    /// Bytes of it that have been read.
    read: u64,
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

    /// The file in `folder`, to be read; `None` if there is none to be had. It may block for as long as the disk takes.
    ///
    /// # Errors
    ///
    /// The system's, where the file can't be opened: too many are open, or it is not ours to read.
    pub fn find(&self, folder: &Path) -> io::Result<Option<File>> {
        let Some((path, found)) = self.look(folder) else {
            return Ok(None);
        };
        fs::File::open(&path)?;
        Ok(Some(File {
            path,
            found,
            read: 0,
        }))
    }

    /// Where the file is, and what it is: `None` unless it is a file in `folder`.
    fn look(&self, folder: &Path) -> Option<(PathBuf, Metadata)> {
        let folder = folder.canonicalize().ok()?;
        let path = folder.join(&self.path).canonicalize().ok()?;
        let found = path.metadata().ok()?;
        (path.starts_with(&folder) && found.is_file()).then_some((path, found))
    }
}

impl File {
    /// Its length \[bytes\].
    #[must_use]
    pub fn length(&self) -> u64 {
        self.found.len()
    }

    /// The next piece, of at most so many bytes: none at the end. It may block as [`FileName::find`] does.
    ///
    /// # Errors
    ///
    /// The system's, where the file can't be read; and where it is no longer the one that was found.
    pub fn next_piece(&mut self, most: usize) -> io::Result<Vec<u8>> {
        // Asked first: opening what is no file, a pipe say, could wait for ever.
        let now = self.path.metadata()?;
        let is_same = now.len() == self.length() && now.modified()? == self.found.modified()?;
        if !now.is_file() || !is_same {
            return Err(io::Error::other(
                "the file has changed since its first piece",
            ));
        }
        let mut file = fs::File::open(&self.path)?;
        file.seek(SeekFrom::Start(self.read))?;
        let mut piece = Vec::with_capacity(most);
        file.take(most as u64).read_to_end(&mut piece)?;
        self.read += piece.len() as u64;
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
    fn a_file_is_read_in_pieces_as_long_as_it_stays_the_same() {
        let folder = std::env::temp_dir().join(format!("pendularm-report-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let path = folder.join("a.csv");
        let name = FileName::parse("a.csv").unwrap();
        assert!(name.find(&folder).unwrap().is_none());
        let begun = || {
            fs::write(&path, "123456789").unwrap();
            let mut file = name.find(&folder).unwrap().unwrap();
            assert_eq!(file.length(), 9);
            assert_eq!(file.next_piece(4).unwrap(), b"1234");
            file
        };
        let mut file = begun();
        assert_eq!(file.next_piece(4).unwrap(), b"5678");
        assert_eq!(file.next_piece(4).unwrap(), b"9");
        assert_eq!(file.next_piece(4).unwrap(), b"");
        let mut longer = begun();
        fs::write(&path, "1234567890").unwrap();
        longer.next_piece(4).unwrap_err();
        let mut newer = begun();
        fs::write(&path, "abcdefghi").unwrap();
        let later = newer.found.modified().unwrap() + std::time::Duration::from_secs(1);
        let opened = fs::File::options().write(true).open(&path).unwrap();
        opened.set_modified(later).unwrap();
        newer.next_piece(4).unwrap_err();
        let mut gone = begun();
        fs::remove_file(&path).unwrap();
        gone.next_piece(4).unwrap_err();
        let mut folder_now = begun();
        fs::remove_file(&path).unwrap();
        fs::create_dir(&path).unwrap();
        folder_now.next_piece(4).unwrap_err();
        fs::remove_dir_all(&folder).unwrap();
    }
}
