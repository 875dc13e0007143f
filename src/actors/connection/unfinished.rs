//! What a client has begun to send and not completed: how much of it is kept, and for how long.
//!
//! Told the time; knows no clock. Time counts only while the client is waited for: one that is not read for a while loses nothing.
//!
//! **Invariant:** what is kept of unfinished frames counts in the total of input, beyond a little that every client has.

use std::time::Duration;

use crate::actors::budget::{Budget, Claim, Share};
use crate::protocol::frame::MAX_FRAME;

/// How long a frame may take from its first byte to its last; one that is longer than a frame may be, and is skipped, as long again for every
/// such length. Longer than the slowest line needs that anybody would steer an arm by.
pub const FRAME_TIME: Duration = Duration::from_secs(60);
/// Bytes of an unfinished frame that every client has beside the total: no frame that a student sends is longer.
pub const FREE_INPUT: usize = 64 * 1024;

/// The account of one client.
#[derive(Debug)]
pub(super) struct Unfinished {
    share: Share,
    waited: Duration,
    received: usize,
}

impl Unfinished {
    pub(super) fn new(input: &Budget) -> Self {
        Self {
            share: input.note(0),
            waited: Duration::ZERO,
            received: 0,
        }
    }

    /// So many bytes are kept now; false, and as before, if there is no room. They are copied once complete, so they count twice.
    pub(super) fn keep(&mut self, bytes: usize) -> bool {
        let counted = 2 * bytes.saturating_sub(FREE_INPUT);
        self.share.resize(counted, Claim::Last)
    }

    /// A frame has ended: the next one has its own time.
    pub(super) fn begin_anew(&mut self) {
        self.waited = Duration::ZERO;
        self.received = 0;
    }

    /// The client was waited for so long, and sent so many bytes.
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

    #[test]
    fn a_frame_has_its_time_and_a_longer_one_as_much_again() {
        let mut unfinished = Unfinished::new(&Budget::of(0));
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
    fn what_every_client_has_is_not_counted() {
        let total = Budget::of(100);
        let mut unfinished = Unfinished::new(&total);
        assert!(unfinished.keep(FREE_INPUT) && total.used() == 0);
        assert!(unfinished.keep(FREE_INPUT + 50) && total.used() == 100);
        assert!(!unfinished.keep(FREE_INPUT + 51) && total.used() == 100);
        drop(unfinished);
        assert_eq!(total.used(), 0);
    }
}
