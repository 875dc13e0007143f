//! The last frames of a client, shortened, for a report of what went before a fault.
//!
//! **Invariant:** bounded, however much a client sends.

use std::collections::VecDeque;

/// How much of a frame is kept, in bytes, and of how many.
const LENGTH: usize = 200;
const FRAMES: usize = 6;

/// The last frames.
#[derive(Default)]
pub struct Recent(VecDeque<String>);

impl Recent {
    /// Keeps a frame, instead of the oldest.
    pub fn keep(&mut self, frame: &str) {
        if self.0.len() >= FRAMES {
            self.0.pop_front();
        }
        let start = &frame.as_bytes()[..frame.len().min(LENGTH)];
        let mut shown = String::from_utf8_lossy(start).into_owned();
        if frame.len() > LENGTH {
            shown += &format!("... ({} bytes)", frame.len());
        }
        self.0.push_back(shown);
    }

    /// The frames that are kept, oldest first.
    pub fn frames(&self) -> Vec<String> {
        self.0.iter().cloned().collect()
    }
}
