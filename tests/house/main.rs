//! Checks of the documents, the source tree and the manifests against the code.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    clippy::expect_used,
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::needless_pass_by_value,
    clippy::panic,
    clippy::print_stdout,
    clippy::unwrap_used,
    dead_code,
    unreachable_pub,
    reason = "a test that panics has failed, and may say what it saw; numbers that are compared, written or cast exactly are exact; \
              helpers are handed values that were made for them, and binaries that share them need not use every part"
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
mod words;
