//! Any pushes and takes: frames leave in order, and only the oldest messages are dropped, as few as the limit requires.

use std::time::Duration;

use bytes::Bytes;
use pendularm::protocol::limits::MEDIUM;
use pendularm::protocol::outbox::{MAX_MESSAGE, MAX_TOPIC_BYTES, MESSAGE_BYTES};
use proptest::prelude::*;

use super::{Bench, throttle};

#[derive(Debug, Clone)]
enum Action {
    /// A message of this many bytes, on a topic that holds its messages back, or on another.
    Push(bool, usize),
    Respond(usize),
    Take(usize, usize),
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Response,
    Queued,
    Held,
}

fn action() -> impl Strategy<Value = Action> {
    let size = prop_oneof![
        1_usize..100,
        20_000..MEDIUM,
        Just(MEDIUM),
        Just(MEDIUM + 1),
        Just(MAX_MESSAGE),
        Just(MAX_MESSAGE + 1)
    ];
    prop_oneof![
        6 => (any::<bool>(), size).prop_map(|(is_held, size)| Action::Push(is_held, size)),
        2 => (1_usize..1000).prop_map(Action::Respond),
        2 => (1_usize..8, prop_oneof![0_usize..500, Just(usize::MAX)])
            .prop_map(|(frames, bytes)| Action::Take(frames, bytes)),
    ]
}

/// Counted bytes of the messages, and the same with the cost of each.
fn counted(waiting: &[(Bytes, Kind)]) -> (usize, usize) {
    let topics = waiting.iter().filter(|(_, kind)| *kind != Kind::Response);
    let lengths = topics.map(|(frame, _)| frame.len().min(MEDIUM));
    lengths.fold((0, 0), |(bytes, cost), length| {
        (bytes + length, cost + length + MESSAGE_BYTES)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    /// Frames are slices of one buffer with different starts, so that they differ without being copied.
    #[test]
    fn frames_leave_in_order_and_the_oldest_messages_are_dropped_for_room(
        actions in proptest::collection::vec(action(), 0..120),
    ) {
        let buffer = Bytes::from(vec![0_u8; MAX_MESSAGE + 1 + actions.len()]);
        let place = |frame: &Bytes| (frame.as_ptr(), frame.len());
        let mut bench = Bench::new();
        let long = throttle(Duration::from_secs(10), usize::MAX);
        bench.outbox.configure(&"/held".into(), Some(long));
        bench.push("/held", "first");
        bench.take_all();
        let (mut waiting, mut dropped) = (Vec::new(), 0);
        for (index, action) in actions.into_iter().enumerate() {
            match action {
                Action::Push(_, size) if size > MAX_MESSAGE => {
                    bench.push("/a", buffer.slice(index..index + size));
                    dropped += 1;
                }
                Action::Push(is_held, size) => {
                    let frame = buffer.slice(index..index + size);
                    bench.push(if is_held { "/held" } else { "/a" }, frame.clone());
                    waiting.push((frame, if is_held { Kind::Held } else { Kind::Queued }));
                    while counted(&waiting).1 > MAX_TOPIC_BYTES {
                        let oldest = waiting.iter().position(|(_, kind)| *kind != Kind::Response);
                        waiting.remove(oldest.unwrap());
                        dropped += 1;
                    }
                }
                Action::Respond(size) => {
                    let frame = buffer.slice(index..index + size);
                    bench.outbox.push_response(frame.clone(), &[]);
                    waiting.push((frame, Kind::Response));
                }
                Action::Take(most, bytes) => {
                    let taken = bench.take(most, bytes);
                    let (mut count, mut total) = (0, 0);
                    let next = waiting.extract_if(.., |(frame, kind)| {
                        let fits = count == 0 || (count < most && total + frame.len() <= bytes);
                        let is_taken = *kind != Kind::Held && fits;
                        total += if *kind == Kind::Held { 0 } else { frame.len() };
                        count += usize::from(*kind != Kind::Held);
                        is_taken
                    });
                    let next: Vec<_> = next.map(|(frame, _)| place(&frame)).collect();
                    prop_assert_eq!(taken.iter().map(place).collect::<Vec<_>>(), next);
                }
            }
            prop_assert_eq!(bench.outbox.topic_bytes(), counted(&waiting).0);
            prop_assert_eq!(bench.outbox.dropped(), dropped);
        }
    }
}
