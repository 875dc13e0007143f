//! Writing to one client: drains the outbox, several frames at a time. Nothing else writes to the socket of a client
//! that is served.
//!
//! [`run`] is part of the connection's actor. It is polled after each message that the actor has handled, so the
//! contents of the outbox are offered to the socket in the same turn. A client that has taken nothing wakes it by
//! taking something.
//!
//! **Invariant:** a write that the client does not take holds up nothing but this connection, and not for ever.

use bytes::{Buf, Bytes};
use tokio::time::{Instant, sleep_until, timeout, timeout_at};

use crate::actors::gateway::connection::shared::Shared;
use crate::actors::gateway::connection::transport::Outbound;
use crate::actors::gateway::limits::{LINGER, WRITE_BYTES};

/// Writes until the connection has finished, its client is gone, or its client has stalled for too long.
/// Returns whether all that was queued has been written.
pub(super) async fn run<O: Outbound>(mut output: O, shared: &Shared) -> bool {
    let mut frames = Vec::new();
    loop {
        shared.outgoing.take(&mut frames, shared.is_finishing());
        if !frames.is_empty() {
            if !write_frames(&mut output, &mut frames, shared).await {
                return false;
            }
        } else if shared.is_done() {
            return timeout(LINGER, output.end()).await.is_ok();
        } else if !send_due_ping(&mut output, shared).await || shared.outgoing.is_stuck() {
            return false;
        } else {
            wait(shared).await;
        }
    }
}

/// Lets the transport say what it has to; false if the client is gone or stalled.
async fn send_due_ping<O: Outbound>(output: &mut O, shared: &Shared) -> bool {
    tokio::select! {
        biased;
        tended = output.send_due_ping() => tended.is_some(),
        () = stalled(shared) => false,
    }
}

/// Waits until there is something to write, or until nothing more will come. Both are looked at here, since the news
/// may have come while the transport was being written.
async fn wait(shared: &Shared) {
    let outgoing = &shared.outgoing;
    let news = outgoing.news(|| outgoing.has_something() || shared.is_done());
    match outgoing.next_release() {
        None => news.await,
        Some(release) => {
            let _ = timeout_at(release, news).await;
        }
    }
}

/// Writes all of the frames; false if the client is gone or stalled.
async fn write_frames<O: Outbound>(
    output: &mut O,
    frames: &mut Vec<Bytes>,
    shared: &Shared,
) -> bool {
    let mut first = 0;
    while first < frames.len() {
        let written = tokio::select! {
            biased;
            written = output.write(frames.get(first..).unwrap_or_default()) => written,
            () = stalled(shared) => return false,
        };
        let Some(mut left) = written else {
            return false;
        };
        shared.written(left);
        let fair = left >= WRITE_BYTES / 2;
        while left > 0 {
            let Some(frame) = frames.get_mut(first) else {
                break;
            };
            let step = left.min(frame.len());
            frame.advance(step);
            left -= step;
            if frame.is_empty() {
                first += 1;
            }
        }
        if fair {
            tokio::task::yield_now().await;
        }
    }
    frames.clear();
    true
}

/// Ends when the client has taken nothing from now on for too long: while responses wait, or because the connection is
/// finishing.
async fn stalled(shared: &Shared) {
    let last_byte = Instant::now();
    let patience = || shared.outgoing.patience(last_byte, shared.is_finishing());
    loop {
        let limit = patience();
        let changed = shared.outgoing.news(|| patience() != limit);
        match limit {
            None => changed.await,
            Some(limit) => tokio::select! {
                biased;
                () = sleep_until(limit) => {
                    // The client may have taken some of what is being written.
                    if patience() == Some(limit) {
                        return;
                    }
                }
                () = changed => {}
            },
        }
    }
}
