//! Checks of the documents, the source tree and the manifests against the code.

#![allow(
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    dead_code,
    unreachable_pub,
    reason = "a test that panics has failed; compared and cast numbers are exact; programs share their helpers"
)]

#[cfg(unix)]
#[path = "../support/folder.rs"]
mod folder;
mod imports;
mod limits;
#[path = "../support/papers.rs"]
mod papers;
mod readme;
mod tree;
