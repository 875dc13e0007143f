//! Bytes and costs of frames until they have been written, and the feedback of goals.

use pendularm::protocol::limits::{MEDIUM, SHORT};
use pendularm::protocol::outbox::MAX_MESSAGE;

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
        bench.outbox.written(written);
        let found = (bench.outbox.short_bytes(), bench.outbox.response_bytes());
        assert_eq!(found, (short, all));
    }
}

#[test]
fn a_long_message_is_there_until_its_last_byte_has_been_written() {
    let mut bench = Bench::new();
    bench
        .outbox
        .push_response(vec![b'x'; MEDIUM + 1].into(), &[]);
    assert!(!bench.outbox.has_long(), "it is a response");
    bench.push("/a", vec![b'x'; MEDIUM + 1]);
    assert!(bench.outbox.has_long());
    bench.take(2, usize::MAX);
    bench.outbox.written(2 * MEDIUM + 1);
    assert!(bench.outbox.has_long());
    bench.outbox.written(1);
    assert!(!bench.outbox.has_long());
}

/// A topic may have the action's name.
#[test]
fn feedback_is_not_throttled_and_replaces_no_other_message() {
    let mut bench = Bench::new();
    bench.throttle("/a", 1000, 1);
    bench.push("/a", "1");
    bench.push("/a", "held back");
    bench.outbox.push_feedback("2".into(), bench.now);
    bench.outbox.push_feedback("3".into(), bench.now);
    bench
        .outbox
        .push_feedback(vec![b'x'; MAX_MESSAGE + 1].into(), bench.now);
    assert_eq!(bench.outbox.dropped(), 1);
    assert_eq!(bench.take_all(), ["1", "2", "3"]);
    bench.advance(1000);
    assert_eq!(bench.take_all(), ["held back"]);
}
