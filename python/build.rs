//! Sets a hash of the sources, by which a sweep compares the wheels of its workers.
//!
//! A rebuilt wheel has the same version, but not the same hash. The hash is the same on every system.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

const SOURCES: [&str; 5] = ["../src", "src", "package", "Cargo.toml", "Cargo.lock"];

fn main() -> io::Result<()> {
    let mut files = Vec::new();
    for source in SOURCES {
        println!("cargo:rerun-if-changed={source}");
        list(Path::new(source), &mut files)?;
    }
    files.sort();
    // FNV-1a: this distinguishes versions, and protects from nobody.
    let mut hash: u64 = 0xcbf2_9ce4_8422_2325;
    for file in files {
        for byte in fs::read(file)? {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    println!("cargo:rustc-env=PENDULARM_SOURCES={hash:016x}");
    Ok(())
}

/// Adds the sources under a path.
fn list(path: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    if path.is_dir() {
        for entry in fs::read_dir(path)? {
            list(&entry?.path(), files)?;
        }
    } else if path
        .extension()
        .is_some_and(|kind| ["rs", "py", "toml", "lock"].iter().any(|one| kind == *one))
    {
        files.push(path.to_path_buf());
    }
    Ok(())
}
