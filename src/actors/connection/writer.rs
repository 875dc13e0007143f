//! The writing task of a connection: drains the outbox, several frames at a time. Topic messages that a socket takes at once
//! have gone by then (see [`due`](super::due)).
//!
//! **Invariant:** a write that the client does not take holds up nothing but this connection, and not for ever.

use actix::prelude::*;
use bytes::{Buf, Bytes};
use tokio::time::{Instant, sleep_until, timeout_at};

use super::transport::Outbound;
use super::{LINGER, STALL_LIMIT, Shared};
use crate::actors::registry::Registry;

/// Frames in one write.
pub(super) const BATCH_FRAMES: usize = 64;
/// Bytes offered in one write: after that much the other connections have a turn.
pub(super) const BATCH_BYTES: usize = 256 * 1024;
/// Frames beyond this are given back to the system on another thread: for the 60 MB of a million steps that takes
/// milliseconds, which the other connections would have to wait.
const LARGE_FRAME: usize = 4 * 1024 * 1024;

/// Writes until the connection has finished, its client is gone, or its client has stalled for too long.
/// True if all that was owed has been written.
pub(super) async fn run<O: Outbound>(
    mut output: O,
    shared: &Shared,
    registry: &Addr<Registry>,
) -> bool {
    let mut batch = Vec::new();
    loop {
        let now = Instant::now().into_std();
        // Clients that end no line take what one read gives them for one frame.
        let frames = if shared.unbatched.get() {
            1
        } else {
            BATCH_FRAMES
        };
        if let Some(rest) = shared.begun.take() {
            batch.push(rest);
        } else {
            let mut outbox = shared.outbox.borrow_mut();
            outbox.take_batch(now, frames, BATCH_BYTES, &mut batch);
        }
        shared.writing.set(!batch.is_empty());
        if !batch.is_empty() {
            if !write_batch(&mut output, &mut batch, shared, registry).await {
                return false;
            }
        } else if shared.finishing.get() && !shared.is_computing() {
            return timeout_at(Instant::now() + LINGER, output.end())
                .await
                .is_ok();
        } else if !tend(&mut output, shared).await {
            return false;
        } else {
            wait(shared).await;
        }
    }
}

/// Lets the transport say what it has to; false if the client is gone or stalled.
async fn tend<O: Outbound>(output: &mut O, shared: &Shared) -> bool {
    tokio::select! {
        biased;
        tended = output.tend() => tended.is_some(),
        () = stalled(shared, Instant::now()) => false,
    }
}

/// Waits until there is something to write.
async fn wait(shared: &Shared) {
    let release = shared.outbox.borrow_mut().next_release();
    match release {
        None => shared.outgoing.notified().await,
        Some(release) => {
            let _ = timeout_at(Instant::from_std(release), shared.outgoing.notified()).await;
        }
    }
}

/// Writes the whole batch; false if the client is gone or stalled.
async fn write_batch<O: Outbound>(
    output: &mut O,
    batch: &mut Vec<Bytes>,
    shared: &Shared,
    registry: &Addr<Registry>,
) -> bool {
    let large = batch.iter().any(|frame| frame.len() > LARGE_FRAME);
    let mut first = 0;
    while first < batch.len() {
        let written = tokio::select! {
            biased;
            written = output.write(batch.get(first..).unwrap_or_default()) => written,
            () = stalled(shared, Instant::now()) => return false,
        };
        let Some(mut left) = written else {
            return false;
        };
        shared.written(left, registry);
        let fair = left >= BATCH_BYTES / 2;
        while left > 0 {
            let Some(frame) = batch.get_mut(first) else {
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
    if large {
        let written = std::mem::take(batch);
        tokio::task::spawn_blocking(move || drop(written));
    } else {
        batch.clear();
    }
    true
}

/// Ends when the client has taken nothing since `last_byte` for too long: while responses wait, or because the
/// connection is finishing.
async fn stalled(shared: &Shared, last_byte: Instant) {
    loop {
        let waiting_since = shared.responses_since.get();
        let limit = match waiting_since {
            Some(since) => Some(since.max(last_byte) + STALL_LIMIT),
            None => shared.finishing.get().then(|| last_byte + LINGER),
        };
        match limit {
            None => shared.outgoing.notified().await,
            Some(limit) => tokio::select! {
                () = sleep_until(limit) => return,
                () = shared.outgoing.notified() => {}
            },
        }
    }
}
