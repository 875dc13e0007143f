//! Open files: as many as all clients need, or as many clients as there are files for.
//!
//! Every client is an open file. A process usually may have 1,024 of them and is allowed to ask for more. Where it is not, fewer
//! clients are served: one too many must find a file to be told so with.
//!
//! **Invariant:** the clients that are served never need all files that there may be.

use super::registry::MAX_CONNECTIONS;

/// Files for everything but served clients: standard streams, polls, wakers, signals, listening sockets, a file of a report, and
/// the clients that are just being told that they are too many.
pub const OTHER_FILES: usize = 32;
/// Asked for beyond that, so that many clients can be told at once.
const REFUSED_AT_ONCE: usize = 480;

/// Raises the limit of open files as far as is needed and allowed, and gives how many clients can be served: [`MAX_CONNECTIONS`], or
/// fewer, which is logged.
#[must_use]
pub fn make_room() -> usize {
    let wanted = MAX_CONNECTIONS + OTHER_FILES + REFUSED_AT_ONCE;
    // It is never lowered.
    match rlimit::increase_nofile_limit(wanted as u64) {
        Ok(files) => {
            let files = usize::try_from(files).unwrap_or(usize::MAX);
            let clients = clients_with(files);
            if clients < MAX_CONNECTIONS {
                tracing::warn!(
                    files,
                    clients,
                    "few files may be open, so few clients are served"
                );
            }
            clients
        }
        Err(error) => {
            tracing::warn!(%error, "the limit of open files is unknown");
            MAX_CONNECTIONS
        }
    }
}

/// Clients that can be served where so many files may be open; at least one.
#[must_use]
pub fn clients_with(files: usize) -> usize {
    files.saturating_sub(OTHER_FILES).clamp(1, MAX_CONNECTIONS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_files_for_every_client_that_is_served() {
        assert_eq!(clients_with(usize::MAX), MAX_CONNECTIONS);
        assert_eq!(clients_with(MAX_CONNECTIONS + OTHER_FILES), MAX_CONNECTIONS);
        assert_eq!(clients_with(1024), 1024 - OTHER_FILES);
        assert_eq!(clients_with(40), 8);
        assert_eq!(clients_with(3), 1);
    }
}
