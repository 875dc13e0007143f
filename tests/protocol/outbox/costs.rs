//! Bytes and costs of frames until they have been written.

use pendularm::protocol::catalog::Topic;
use pendularm::protocol::limits::{MEDIUM, SHORT};
use pendularm::protocol::outbox::MAX_TOPIC_BYTES;

use super::Bench;

/// Messages that take a permit are not among them.
#[test]
fn short_responses_count_by_themselves() {
    let mut bench = Bench::new();
    bench.respond("four", &[]);
    bench
        .outbox
        .push_response(vec![b'x'; SHORT + 1].into(), &[]);
    assert_eq!(bench.outbox.short_bytes(), 4);
    assert_eq!(bench.outbox.response_bytes(), SHORT + 5);
    bench.take(2, usize::MAX);
    for (written, short, all) in [(3, 1, SHORT + 2), (10, 0, SHORT - 8)] {
        bench.outbox.note_written(written);
        let found = (bench.outbox.short_bytes(), bench.outbox.response_bytes());
        assert_eq!(found, (short, all));
    }
}

#[test]
fn a_long_message_is_not_held_back_for_longer_than_20_s() {
    // The first message is not held back.
    let long = MEDIUM + 1;
    for (interval, length, count) in [(20_000, long, 2), (20_001, long, 1), (20_001, MEDIUM, 2)] {
        let mut bench = Bench::new();
        bench.throttle("/a", interval, 1);
        bench.push("/a", "first");
        bench.push("/a", vec![b'x'; length]);
        assert_eq!(bench.outbox.topic_count(), count);
    }
}

#[test]
fn a_flood_drops_no_end_of_a_goal() {
    let mut bench = Bench::new();
    let message = vec![b'x'; 1000];
    for _ in 0..4 {
        bench.push(Topic::IkResult.name(), "end");
        (0..1000).for_each(|_| bench.push("/a", message.clone()));
    }
    let ends = bench.take(usize::MAX, usize::MAX);
    assert_eq!(ends.iter().filter(|frame| *frame == "end").count(), 4);
    assert_eq!(bench.outbox.dropped() as usize, 4004 - ends.len());
    // They are bounded too.
    (0..10_000).for_each(|_| bench.push(Topic::IkResult.name(), message.clone()));
    assert!(bench.outbox.topic_bytes() < MAX_TOPIC_BYTES);
}
