//! How long a frame may take from its first byte to its last.
//!
//! **Invariant:** its caller gives the time. Time counts only while the client is waited for: a client that is
//! not read for a while loses none.

use std::time::Duration;

use crate::actors::gateway::limits::FRAME_TIME;
use crate::protocol::limits::MAX_FRAME;

/// The frame that a client has begun.
#[derive(Debug, Default)]
pub(super) struct Unfinished {
    waited: Duration,
    received: usize,
}

impl Unfinished {
    /// A frame has ended: the next one has its own time.
    pub(super) fn begin_anew(&mut self) {
        self.waited = Duration::ZERO;
        self.received = 0;
    }

    /// Notes how long the client was waited for, and how many bytes it sent.
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
        let mut unfinished = Unfinished::default();
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
}
