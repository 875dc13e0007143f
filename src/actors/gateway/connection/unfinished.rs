//! Unfinished input: how much a client has begun to send and not completed, and how long it may take.
//!
//! It is told the time, and knows no clock. Time counts only while the client is waited for: a client that is not read
//! for a while loses none.
//!
//! **Invariant:** what is kept of unfinished frames is charged to the client's account, as it is allocated.

use std::sync::Arc;
use std::time::Duration;

use bytes::BytesMut;

use crate::actors::gateway::limits::FRAME_TIME;
use crate::actors::resources::budget::{Account, Share};
use crate::protocol::limits::MAX_FRAME;

/// The unfinished input of one client.
#[derive(Debug)]
pub(super) struct Unfinished {
    share: Share,
    waited: Duration,
    received: usize,
}

/// The bytes that a client has sent before it is clear how it is to be served.
pub(super) struct First {
    pub(super) bytes: BytesMut,
    /// The share of the account that counts them.
    pub(super) unfinished: Unfinished,
}

impl First {
    /// Makes room for so many bytes; none have come yet.
    pub(super) fn with_room(bytes: usize, account: &Arc<Account>) -> Self {
        let mut unfinished = Unfinished::new(account);
        let bytes = BytesMut::with_capacity(bytes);
        unfinished.keep(bytes.capacity());
        Self { bytes, unfinished }
    }
}

impl Unfinished {
    pub(super) fn new(account: &Arc<Account>) -> Self {
        Self {
            share: account.take(0),
            waited: Duration::ZERO,
            received: 0,
        }
    }

    /// Notes that so many bytes are kept now.
    pub(super) fn keep(&mut self, bytes: usize) {
        if bytes != self.share.bytes() {
            self.share.resize(bytes);
        }
    }

    /// A frame has ended: the next one has its own time.
    pub(super) fn begin_anew(&mut self) {
        self.waited = Duration::ZERO;
        self.received = 0;
    }

    /// Notes that the client was waited for so long, and sent so many bytes.
    pub(super) fn wait(&mut self, time: Duration, received: usize) {
        self.waited += time;
        self.received += received;
    }

    /// How much longer the frame may take.
    pub(super) fn time_left(&self) -> Duration {
        let lengths = u32::try_from(self.received / MAX_FRAME).unwrap_or(u32::MAX);
        let allowed = FRAME_TIME.saturating_mul(lengths.saturating_add(1));
        allowed.saturating_sub(self.waited)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actors::resources::budget::Memory;

    #[test]
    fn a_frame_has_its_time_and_a_longer_one_as_much_again() {
        let mut unfinished = Unfinished::new(&Memory::default().open());
        unfinished.wait(Duration::from_secs(59), 59);
        assert_eq!(unfinished.time_left(), Duration::from_secs(1));
        unfinished.wait(Duration::from_secs(2), MAX_FRAME);
        assert_eq!(
            unfinished.time_left(),
            2 * FRAME_TIME - Duration::from_secs(61)
        );
        unfinished.begin_anew();
        assert_eq!(unfinished.time_left(), FRAME_TIME);
    }

    #[test]
    fn what_is_kept_is_counted_and_no_longer_than_it_is_kept() {
        let memory = Memory::default();
        let account = memory.open();
        let before = memory.held();
        let mut unfinished = Unfinished::new(&account);
        for bytes in [5000, 70_000, 0, 100] {
            unfinished.keep(bytes);
            assert_eq!(memory.held(), before + bytes);
        }
        drop(unfinished);
        assert_eq!(memory.held(), before);
    }
}
