//! Bytes and costs of frames until they have been written.

use pendularm::protocol::outbox::{FRAME_BYTES, MAX_TOPIC_BYTES};

use super::Bench;

#[test]
fn responses_count_until_they_have_been_written() {
    let mut bench = Bench::new();
    bench.respond("12345678", &[]);
    bench.push("/a", "mmmm");
    bench.respond("1234", &[]);
    assert_eq!(bench.outbox.response_bytes(), 12);
    assert_eq!(bench.take(2, usize::MAX).len(), 2);
    assert_eq!(bench.outbox.response_bytes(), 12);
    bench.outbox.written(3);
    assert_eq!(bench.outbox.response_bytes(), 9);
    bench.outbox.written(7);
    assert_eq!(bench.outbox.response_bytes(), 4);
    bench.outbox.written(2);
    assert_eq!(bench.take(1, usize::MAX), ["1234"]);
    bench.outbox.written(4);
    assert_eq!(bench.outbox.response_bytes(), 0);
}

#[test]
fn a_message_costs_its_whole_length_until_its_last_byte_has_been_written() {
    let mut bench = Bench::new();
    bench.push("/a", "mmmm");
    bench.respond("1234", &[]);
    assert_eq!(bench.outbox.writing_cost(), 0);
    assert_eq!(bench.take(2, usize::MAX).len(), 2);
    for _ in 0..3 {
        bench.outbox.written(1);
        assert_eq!(bench.outbox.writing_cost(), 4 + FRAME_BYTES);
    }
    bench.outbox.written(1);
    assert_eq!(bench.outbox.writing_cost(), 0);
    bench.outbox.written(4);
    assert_eq!(bench.outbox.writing_cost(), 0);
}

#[test]
fn what_is_being_written_stays_when_all_that_waits_is_taken_out() {
    let mut bench = Bench::new();
    bench.push("/a", "mmmm");
    bench.respond("1234", &[]);
    assert_eq!(bench.take(2, usize::MAX).len(), 2);
    bench.push("/a", "nnnn");
    bench.respond("5678", &[]);
    bench.outbox.written(5);
    let waiting = bench.outbox.take_waiting();
    assert_eq!((waiting.topic_count(), waiting.topic_bytes()), (1, 4));
    assert!(bench.outbox.is_empty());
    assert_eq!(bench.outbox.response_cost(), 3 + FRAME_BYTES);
    bench.outbox.written(3);
    assert_eq!(bench.outbox.response_cost(), 0);
}

#[test]
fn responses_cost_their_bytes_and_their_places_until_they_have_been_written() {
    let mut bench = Bench::new();
    for _ in 0..3 {
        bench.respond("four", &[]);
    }
    assert_eq!(bench.outbox.response_cost(), 3 * (4 + FRAME_BYTES));
    bench.take(2, usize::MAX);
    assert_eq!(bench.outbox.response_cost(), 3 * (4 + FRAME_BYTES));
    bench.outbox.written(3);
    assert_eq!(bench.outbox.response_cost(), 9 + 3 * FRAME_BYTES);
    bench.outbox.written(2);
    assert_eq!(bench.outbox.response_cost(), 7 + 2 * FRAME_BYTES);
    bench.take(1, usize::MAX);
    bench.outbox.written(7);
    assert_eq!(bench.outbox.response_cost(), 0);
}

/// Freeing 100,000 takes milliseconds, which whoever serves everybody does not have.
#[test]
fn many_messages_that_are_given_up_are_handed_out_to_be_freed() {
    const MANY: usize = 1000;
    type Deed = fn(&mut Bench);
    let held: [(Deed, usize); 5] = [
        (|bench| bench.throttle("/t", 1_000_000, 1), MANY - 1),
        (|bench| bench.outbox.forget("/t"), MANY),
        (|bench| bench.respond("r", &["/t"]), MANY),
        (|bench| bench.outbox.keep_topics(0), MANY),
        (|bench| bench.push("/u", vec![b'x'; MAX_TOPIC_BYTES]), MANY),
    ];
    for (number, (deed, given_up)) in held.into_iter().enumerate() {
        let mut bench = Bench::new();
        bench.throttle("/t", 1_000_000, MANY);
        for _ in 0..=MANY {
            bench.push("/t", "m");
        }
        assert_eq!(bench.outbox.take_given_up(), None);
        // The first is not held back.
        assert_eq!(bench.take_all(), ["m"]);
        deed(&mut bench);
        let many = bench.outbox.take_given_up().map(|many| many.len());
        assert_eq!(many, Some(given_up), "{number}");
        assert_eq!(bench.outbox.take_given_up(), None);
    }
    let queued: [Deed; 2] = [
        |bench| bench.outbox.keep_topics(0),
        |bench| bench.push("/t", vec![b'x'; MAX_TOPIC_BYTES]),
    ];
    for deed in queued {
        let mut bench = Bench::new();
        for _ in 0..MANY {
            bench.push("/t", "m");
        }
        deed(&mut bench);
        let many = bench.outbox.take_given_up().map(|many| many.len());
        assert_eq!(many, Some(MANY));
    }
}
