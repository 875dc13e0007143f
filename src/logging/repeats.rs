//! Repeated events, reported once a second.
//!
//! A client can cause an event with every frame. The first event of a kind is reported at once. Further ones within a
//! second are reported together, with their number, after the second. A kind is a place in the source.
//!
//! **Invariant:** no kind is reported more than once a second, every event is counted, and there is at most one entry
//! for each place in the source.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use tracing::callsite::Identifier;
use tracing::{Event, Metadata};
use tracing_subscriber::fmt::format::{DefaultFields, FormatFields, Writer};

/// Time between two reports of a kind.
pub const PERIOD: Duration = Duration::from_secs(1);

/// The kinds reported within the last second, with the end of the second and the events since.
#[derive(Default)]
pub struct Repeats(Mutex<HashMap<Identifier, (Instant, Option<Repeated>)>>);

/// Events of one kind.
pub struct Repeated {
    /// Their place in the source.
    pub metadata: &'static Metadata<'static>,
    /// The text of the first one.
    pub text: String,
    /// Their number.
    pub events: u64,
}

impl Repeats {
    /// Counts an event. Returns the report that is due with it. A report with one event reports this event.
    pub fn count(&self, event: &Event<'_>, now: Instant) -> Option<Repeated> {
        let metadata = event.metadata();
        let mut kinds = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let (until, held) = kinds.entry(metadata.callsite()).or_insert((now, None));
        let repeated = held.get_or_insert_with(|| Repeated {
            metadata,
            text: text(event),
            events: 0,
        });
        repeated.events += 1;
        take(until, held, now)
    }

    /// The reports that are due at `now`. Kinds without events are removed.
    pub fn due(&self, now: Instant) -> Vec<Repeated> {
        let mut kinds = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let due = kinds.values_mut();
        let due = due.filter_map(|(until, held)| take(until, held, now));
        let due = due.collect();
        kinds.retain(|_, (until, _)| *until > now);
        due
    }
}

/// Takes the held events, if their second is over, and begins the next second.
fn take(until: &mut Instant, held: &mut Option<Repeated>, now: Instant) -> Option<Repeated> {
    let repeated = held.take_if(|_| now >= *until)?;
    *until = now + PERIOD;
    Some(repeated)
}

/// An event as one line: the message, then the fields.
fn text(event: &Event<'_>) -> String {
    let mut text = String::new();
    // Writing to a `String` cannot fail.
    let _ = DefaultFields::new().format_fields(Writer::new(&mut text), event);
    text
}
