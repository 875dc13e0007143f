//! Repeated events of the log: at most one report a second, and none left out.

use std::time::{Duration, Instant};

use pendularm::logging::repeats::Repeats;
use tracing::callsite::Callsite;
use tracing::metadata::Kind;
use tracing::{Event, Level, Metadata, subscriber::Interest};

struct Place;

impl Callsite for Place {
    fn set_interest(&self, _: Interest) {}

    fn metadata(&self) -> &Metadata<'static> {
        &DIVERGED
    }
}

static DIVERGED: Metadata<'static> = tracing::metadata! {
    name: "event", target: "pendularm", level: Level::WARN, fields: &[], callsite: &Place, kind: Kind::EVENT
};

#[test]
fn a_kind_is_reported_once_a_second_with_a_number_that_leaves_out_none() {
    let (repeats, began) = (Repeats::default(), Instant::now());
    let at = |ms: u64| began + Duration::from_millis(ms);
    let values = DIVERGED.fields().value_set(&[]);
    let count = |ms| {
        let event = Event::new(&DIVERGED, &values);
        repeats.count(&event, at(ms)).map(|one| one.events)
    };
    let due = |ms| -> Vec<u64> { repeats.due(at(ms)).iter().map(|one| one.events).collect() };
    assert_eq!(count(0), Some(1));
    for _ in 1..1000 {
        assert_eq!(count(500), None);
    }
    assert_eq!((due(999), due(1000)), (vec![], vec![999]));
    // The next second has begun. Its only event is reported at its end.
    assert_eq!((count(1500), due(2000)), (None, vec![1]));
    // The next event reports those before it, if nobody has looked.
    assert_eq!((count(2100), count(3001)), (None, Some(2)));
    // After a second of silence an event is reported at once.
    assert_eq!((due(5000), count(5000)), (vec![], Some(1)));
}
