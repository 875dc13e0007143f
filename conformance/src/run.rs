//! What all connections of a run share: its limits, the services that have answered, and the latest frames.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// The longest wait for an answer to one call.
pub const PATIENCE: Duration = Duration::from_secs(3);
/// The longest wait for a service that was silent [`SILENCES`] times.
const NO_PATIENCE: Duration = Duration::from_millis(100);
/// The number of calls without an answer after which a service is not waited for.
const SILENCES: u32 = 3;
/// Frames kept for the report on a rule, and the characters of each.
const FRAMES: usize = 40;
const FRAME: usize = 400;

/// The sender of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The suite.
    Client,
    /// The server.
    Server,
}

/// A frame: its sender, its text, and its topic if it is a message.
pub type Frame = (Side, String, String);

/// A run. All its connections have it.
#[derive(Debug)]
pub struct Run {
    /// The longest wait for an answer to one call.
    pub patience: Duration,
    /// A name of this run, which its messages have.
    pub name: String,
    ending: Arc<AtomicBool>,
    notes: Mutex<Notes>,
}

#[derive(Debug, Default)]
struct Notes {
    silences: BTreeMap<String, u32>,
    accepting: BTreeSet<String>,
    refusing: BTreeSet<String>,
    /// Services that refused in the present rule.
    needed: BTreeSet<String>,
    frames: VecDeque<Frame>,
}

impl Default for Run {
    fn default() -> Self {
        Self::new(PATIENCE, &Arc::default())
    }
}

impl Run {
    /// A run that ends early once `ending` is true.
    #[must_use]
    pub fn new(patience: Duration, ending: &Arc<AtomicBool>) -> Self {
        let name = format!("conformance-{:08x}", fastrand::u32(..));
        Self { patience, name, ending: Arc::clone(ending), notes: Mutex::default() }
    }

    /// Whether the run was interrupted.
    #[must_use]
    pub fn is_ending(&self) -> bool {
        self.ending.load(Ordering::Relaxed)
    }

    fn notes(&self) -> MutexGuard<'_, Notes> {
        self.notes.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The longest wait for a service or a topic.
    #[must_use]
    pub fn patience_for(&self, name: &str) -> Duration {
        let has_ended = self.notes().silences.get(name).is_some_and(|count| *count >= SILENCES);
        if has_ended { NO_PATIENCE.min(self.patience) } else { self.patience }
    }

    /// Counts a call without an answer, or a topic without a message.
    pub fn was_silent(&self, name: &str) {
        *self.notes().silences.entry(name.to_owned()).or_default() += 1;
    }

    /// The service or topic is not silent.
    pub fn spoke(&self, name: &str) {
        self.notes().silences.remove(name);
    }

    /// Keeps that a service accepted a valid call.
    pub fn accepted(&self, service: &str) {
        self.notes().accepting.insert(service.to_owned());
    }

    /// Keeps that a service did not accept a valid call.
    pub fn refused(&self, service: &str) {
        let mut notes = self.notes();
        notes.refusing.insert(service.to_owned());
        notes.needed.insert(service.to_owned());
    }

    /// Whether a service has accepted a call.
    #[must_use]
    pub fn accepts(&self, service: &str) -> bool {
        self.notes().accepting.contains(service)
    }

    /// The services that accepted no call.
    #[must_use]
    pub fn lacking(&self) -> BTreeSet<String> {
        let notes = self.notes();
        notes.refusing.difference(&notes.accepting).cloned().collect()
    }

    /// Keeps a frame. Of a series of messages on one topic only the latest is kept.
    pub fn exchanged(&self, side: Side, text: &str, topic: &str) {
        let mut notes = self.notes();
        if !topic.is_empty() && notes.frames.back().is_some_and(|(_, _, last)| last == topic) {
            notes.frames.pop_back();
        }
        if notes.frames.len() == FRAMES {
            notes.frames.pop_front();
        }
        let text = text.trim_end();
        let mut shown: String = text.chars().take(FRAME).collect();
        if shown.len() < text.len() {
            shown.push('…');
        }
        notes.frames.push_back((side, shown, topic.to_owned()));
    }

    /// The services that refused, and the frames, since the last call.
    pub fn take(&self) -> (BTreeSet<String>, Vec<Frame>) {
        let mut notes = self.notes();
        (std::mem::take(&mut notes.needed), std::mem::take(&mut notes.frames).into())
    }
}
