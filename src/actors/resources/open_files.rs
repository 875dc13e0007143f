//! The limit of open files, and the number of connections that it allows.
//!
//! Every client is an open file. A process usually may have 1,024 of them, and may raise that limit. If it may not,
//! fewer clients are served. A refused client needs a file too, to receive the reason.
//!
//! **Invariant:** the served clients never use all files that may be open.

/// Files for everything but served clients: standard streams, polls, wakers, signals, listening sockets, a file of a
/// report, and clients that are being refused.
const OTHER_FILES: usize = 32;
/// Additional files, so that many clients can be refused at once.
const REFUSED_AT_ONCE: usize = 480;

/// How many connections there can be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Capacity {
    /// Clients that are served.
    pub clients: usize,
    /// Connections without a token yet, or without a free place. They are counted separately.
    pub newcomers: usize,
}

/// Raises the limit of open files as far as the `wanted` connections need and the system allows. Returns the number of
/// possible connections, and logs a warning if the limit reduces the clients.
#[must_use]
pub fn make_capacity(wanted: Capacity, asks_token: bool) -> Capacity {
    let needed = wanted.clients + wanted.newcomers + OTHER_FILES + REFUSED_AT_ONCE;
    // The limit is never lowered.
    let files = raise_limit(needed).unwrap_or_else(|error| {
        tracing::warn!(%error, "the limit of open files is unknown");
        usize::MAX
    });
    let capacity = capacity_with(files, wanted, asks_token);
    let clients = capacity.clients;
    if clients < wanted.clients {
        tracing::warn!(
            files,
            clients,
            "the limit of open files is low, so fewer clients are served"
        );
    }
    capacity
}

/// Raises the limit to `needed` or the largest allowed value. Returns the new limit.
#[cfg(unix)]
fn raise_limit(needed: usize) -> std::io::Result<usize> {
    let files = rlimit::increase_nofile_limit(needed as u64)?;
    Ok(usize::try_from(files).unwrap_or(usize::MAX))
}

/// Windows has no limit of sockets for a process.
#[cfg(windows)]
fn raise_limit(_: usize) -> std::io::Result<usize> {
    Ok(usize::MAX)
}

/// Returns the places that `files` open files allow, for at least one client. If a token is required and files are few,
/// newcomers get half of the files.
fn capacity_with(files: usize, wanted: Capacity, asks_token: bool) -> Capacity {
    let files = files.saturating_sub(OTHER_FILES);
    let newcomers = if asks_token {
        (files / 2).clamp(1, wanted.newcomers.max(1))
    } else {
        wanted.newcomers
    };
    let kept_for_them = if asks_token { newcomers } else { 0 };
    Capacity {
        clients: files
            .saturating_sub(kept_for_them)
            .clamp(1, wanted.clients.max(1)),
        newcomers,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actors::resources::places::MAX_NEWCOMERS;

    #[test]
    fn there_are_files_for_every_client_that_is_served_and_for_unauthenticated_ones() {
        /// More than the usual limit of 1,024 files allows.
        const WANTED: usize = 2000;
        const USUAL: usize = 1024 - OTHER_FILES;
        let wanted = Capacity {
            clients: WANTED,
            newcomers: MAX_NEWCOMERS,
        };
        for (files, asks_token, clients, newcomers) in [
            (usize::MAX, false, WANTED, MAX_NEWCOMERS),
            (WANTED + OTHER_FILES, false, WANTED, MAX_NEWCOMERS),
            (1024, false, USUAL, MAX_NEWCOMERS),
            (40, false, 8, MAX_NEWCOMERS),
            (3, false, 1, MAX_NEWCOMERS),
            (usize::MAX, true, WANTED, MAX_NEWCOMERS),
            (1024, true, USUAL - MAX_NEWCOMERS, MAX_NEWCOMERS),
            (64, true, 16, 16),
            (3, true, 1, 1),
        ] {
            let capacity = Capacity { clients, newcomers };
            assert_eq!(capacity_with(files, wanted, asks_token), capacity);
        }
    }
}
