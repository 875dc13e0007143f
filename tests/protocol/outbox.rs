//! The outbox of one connection: what waits, what is dropped, what is held back.
//!
//! **Invariant:** time is told, never waited for.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;
use pendularm::protocol::limits::MAX_FRAME;
use pendularm::protocol::outbox::{FRAME_BYTES, MAX_TOPIC_BYTES, Outbox, PLACE_BYTES};
use proptest::prelude::*;

const MIB: usize = 1024 * 1024;

/// An outbox under test, with a clock of its own.
struct Bench {
    outbox: Outbox,
    now: Instant,
}

impl Bench {
    fn new() -> Self {
        Self {
            outbox: Outbox::new(),
            now: Instant::now(),
        }
    }

    fn push(&mut self, topic: &str, frame: impl Into<Bytes>) {
        self.outbox.push(&Arc::from(topic), frame.into(), self.now);
    }

    fn respond(&mut self, frame: &'static str, supersedes: &[&str]) {
        self.outbox.push_response(Bytes::from(frame), supersedes);
    }

    fn throttle(&mut self, topic: &str, ms: u64, queue_length: usize) {
        let throttle = (Duration::from_millis(ms), queue_length);
        self.outbox.set_throttle(&Arc::from(topic), Some(throttle));
    }

    fn advance(&mut self, ms: u64) {
        self.now += Duration::from_millis(ms);
    }

    fn take(&mut self, max_frames: usize, max_bytes: usize) -> Vec<Bytes> {
        let mut batch = Vec::new();
        self.outbox
            .take_frames(self.now, max_frames, max_bytes, &mut batch);
        batch
    }

    fn take_all(&mut self) -> Vec<String> {
        let text = |frame: &Bytes| String::from_utf8(frame.to_vec()).unwrap();
        self.take(usize::MAX, usize::MAX).iter().map(text).collect()
    }
}

#[test]
fn frames_leave_in_the_order_in_which_they_were_produced() {
    let mut bench = Bench::new();
    bench.push("/a", "1");
    bench.respond("2", &[]);
    bench.push("/b", "3");
    bench.push("/a", "4");
    bench.respond("5", &[]);
    assert!(!bench.outbox.is_empty());
    assert_eq!(bench.take_all(), ["1", "2", "3", "4", "5"]);
    assert!(bench.outbox.is_empty());
    assert!(bench.take_all().is_empty());
}

/// A topic may have the action's name.
#[test]
fn feedback_is_past_all_throttles_and_drops_nothing_if_it_cannot_fit() {
    let mut bench = Bench::new();
    bench.throttle("/a", 1000, 1);
    bench.push("/a", "1");
    bench.push("/a", "held back");
    bench.outbox.push_feedback("2".into());
    bench.outbox.push_feedback("3".into());
    bench
        .outbox
        .push_feedback(vec![b'x'; MAX_TOPIC_BYTES + 1].into());
    assert_eq!(bench.outbox.dropped(), 1);
    assert_eq!(bench.take_all(), ["1", "2", "3"]);
    bench.advance(1000);
    assert_eq!(bench.take_all(), ["held back"]);
}

#[test]
fn a_batch_is_limited_in_frames_and_bytes_but_never_empty() {
    let mut bench = Bench::new();
    for frame in ["aaa", "bbb", "ccc", "ddd", "eee"] {
        bench.push("/a", frame);
    }
    assert_eq!(bench.take(2, usize::MAX), ["aaa", "bbb"]);
    assert_eq!(bench.take(9, 7), ["ccc", "ddd"]);
    assert_eq!(bench.take(0, 0), ["eee"]);
}

#[test]
fn the_oldest_topic_messages_go_first_when_the_queue_is_full() {
    let mut bench = Bench::new();
    let message = |tag: u8| Bytes::from(vec![tag; MIB]);
    for tag in 1..=6 {
        bench.push("/a", message(tag));
        bench.respond("answer", &[]);
    }
    assert_eq!(bench.outbox.dropped(), 2);
    let left: Vec<u8> = bench
        .take(usize::MAX, usize::MAX)
        .iter()
        .map(|frame| frame[0])
        .collect();
    assert_eq!(left, [b'a', b'a', 3, b'a', 4, b'a', 5, b'a', 6, b'a']);
}

#[test]
fn responses_are_never_dropped() {
    let mut bench = Bench::new();
    let answer = Bytes::from(vec![b'r'; MIB]);
    for _ in 0..100 {
        bench.outbox.push_response(answer.clone(), &[]);
    }
    bench.push("/a", vec![b'm'; 4 * MIB]);
    assert_eq!(bench.outbox.dropped(), 0);
    assert_eq!(bench.take(usize::MAX, usize::MAX).len(), 101);
}

#[test]
fn a_message_of_the_greatest_length_fits_and_a_longer_one_is_dropped_alone() {
    let mut bench = Bench::new();
    bench.push("/a", vec![0; MAX_TOPIC_BYTES - 1]);
    bench.push("/a", "1");
    assert_eq!(bench.outbox.topic_bytes(), MAX_TOPIC_BYTES);
    bench.push("/a", vec![0; MAX_TOPIC_BYTES + 1]);
    assert_eq!(
        (bench.outbox.dropped(), bench.outbox.topic_bytes()),
        (1, MAX_TOPIC_BYTES)
    );
    bench.push("/a", vec![0; MAX_TOPIC_BYTES]);
    assert_eq!(
        (bench.outbox.dropped(), bench.outbox.topic_bytes()),
        (3, MAX_TOPIC_BYTES)
    );
}

#[test]
fn the_longest_message_that_a_client_may_send_fits_with_its_newline() {
    let mut bench = Bench::new();
    bench.push("/a", vec![0; MAX_FRAME + 1]);
    assert_eq!(bench.outbox.dropped(), 0);
    assert_eq!(bench.take(1, usize::MAX).len(), 1);
}

#[test]
fn an_outbox_is_empty_when_neither_a_message_nor_a_response_can_be_taken() {
    let mut bench = Bench::new();
    assert!(bench.outbox.is_empty());
    bench.push("/a", "1");
    assert!(!bench.outbox.is_empty());
    bench.take_all();
    bench.respond("r", &[]);
    assert!(!bench.outbox.is_empty());
    bench.take_all();
    assert!(bench.outbox.is_empty());
}

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
fn a_throttled_topic_keeps_its_distance_and_the_newest_message() {
    let mut bench = Bench::new();
    bench.throttle("/a", 100, 1);
    bench.push("/a", "1");
    assert_eq!(bench.take_all(), ["1"]);
    for frame in ["2", "3", "4"] {
        bench.advance(10);
        bench.push("/a", frame);
    }
    assert!(bench.outbox.is_empty());
    assert_eq!(
        bench.outbox.next_release(),
        Some(bench.now + Duration::from_millis(70))
    );
    bench.advance(69);
    assert!(bench.take_all().is_empty());
    bench.advance(1);
    assert_eq!(bench.take_all(), ["4"]);
    assert_eq!(bench.outbox.next_release(), None);
    assert_eq!(
        bench.outbox.dropped(),
        0,
        "what throttling replaces is not lost"
    );
}

#[test]
fn a_longer_queue_holds_back_that_many_and_lets_them_go_one_by_one() {
    let mut bench = Bench::new();
    bench.throttle("/a", 100, 2);
    for frame in ["1", "2", "3", "4"] {
        bench.push("/a", frame);
    }
    assert_eq!(bench.take_all(), ["1"]);
    bench.advance(100);
    assert_eq!(bench.take_all(), ["3"]);
    bench.advance(50);
    bench.push("/a", "5");
    bench.advance(50);
    assert_eq!(bench.take_all(), ["4"]);
    bench.advance(1000);
    assert_eq!(bench.take_all(), ["5"], "no burst after a long time");
}

#[test]
fn a_held_back_message_takes_its_place_when_its_time_comes() {
    let mut bench = Bench::new();
    bench.throttle("/a", 100, 1);
    bench.push("/a", "a1");
    bench.push("/a", "a2");
    bench.push("/b", "b1");
    bench.advance(100);
    bench.push("/b", "b2");
    assert_eq!(bench.take_all(), ["a1", "b1", "a2", "b2"]);
}

#[test]
fn topics_are_throttled_apart() {
    let mut bench = Bench::new();
    bench.throttle("/a", 100, 1);
    bench.throttle("/b", 30, 1);
    for frame in ["1", "2"] {
        bench.push("/a", frame);
        bench.push("/b", frame);
        bench.push("/c", frame);
    }
    assert_eq!(bench.take_all(), ["1", "1", "1", "2"]);
    assert_eq!(
        bench.outbox.next_release(),
        Some(bench.now + Duration::from_millis(30))
    );
    bench.advance(30);
    assert_eq!(bench.take_all(), ["2"]);
    assert_eq!(
        bench.outbox.next_release(),
        Some(bench.now + Duration::from_millis(70))
    );
}

#[test]
fn a_new_throttle_counts_from_the_last_delivery_and_lifting_it_lets_all_go() {
    let mut bench = Bench::new();
    bench.throttle("/a", 1000, 3);
    for frame in ["1", "2", "3", "4"] {
        bench.push("/a", frame);
    }
    assert_eq!(bench.take_all(), ["1"]);
    bench.advance(50);
    bench.throttle("/a", 50, 2);
    assert_eq!(
        bench.take_all(),
        ["3"],
        "the smaller queue keeps the newest"
    );
    bench.push("/a", "5");
    bench.outbox.set_throttle(&Arc::from("/a"), None);
    assert_eq!(bench.take_all(), ["4", "5"]);
    bench.throttle("/a", 0, 1);
    bench.push("/a", "6");
    bench.push("/a", "7");
    assert_eq!(
        bench.take_all(),
        ["6", "7"],
        "no time at all is no throttle"
    );
}

#[test]
fn unsubscribing_discards_what_is_held_back_and_leaves_what_is_queued() {
    let mut bench = Bench::new();
    bench.throttle("/a", 100, 2);
    for frame in ["1", "2", "3"] {
        bench.push("/a", frame);
    }
    bench.respond("r", &[]);
    bench.outbox.forget("/a");
    assert_eq!(bench.outbox.next_release(), None);
    assert_eq!(bench.outbox.topic_bytes(), 1);
    bench.advance(1000);
    assert_eq!(bench.take_all(), ["1", "r"]);
}

#[test]
fn a_response_discards_the_held_back_state_from_before_it() {
    let mut bench = Bench::new();
    bench.throttle("/a", 100, 2);
    bench.throttle("/b", 100, 2);
    for frame in ["1", "2"] {
        bench.push("/a", frame);
        bench.push("/b", frame);
    }
    bench.respond("paused", &["/a"]);
    assert_eq!(bench.take_all(), ["1", "1", "paused"]);
    bench.push("/a", "3");
    bench.advance(100);
    assert_eq!(
        bench.take_all(),
        ["3", "2"],
        "the distance is kept all the same"
    );
}

#[test]
fn held_back_messages_count_for_the_limit_and_go_when_they_are_the_oldest() {
    let mut bench = Bench::new();
    bench.throttle("/a", 1000, 100);
    let message = |tag: u8| Bytes::from(vec![tag; MIB]);
    bench.push("/a", message(0));
    assert_eq!(bench.take(1, usize::MAX).len(), 1);
    bench.push("/b", message(1));
    bench.push("/a", message(2));
    bench.push("/a", message(3));
    bench.push("/b", message(4));
    assert_eq!(bench.outbox.topic_bytes(), 4 * MIB);
    bench.push("/b", message(5));
    bench.push("/b", message(6));
    assert_eq!(bench.outbox.dropped(), 2);
    let tags = |batch: Vec<Bytes>| -> Vec<u8> { batch.iter().map(|frame| frame[0]).collect() };
    assert_eq!(tags(bench.take(usize::MAX, usize::MAX)), [4, 5, 6]);
    bench.advance(1000);
    assert_eq!(tags(bench.take(usize::MAX, usize::MAX)), [3]);
}

/// The duties of an outbox, written down as slowly as they read: one list, searched from the front each time.
#[derive(Default)]
struct Model {
    /// Queued and held back, in the order of their numbers.
    waiting: Vec<Waiting>,
    throttles: BTreeMap<usize, (Duration, usize, Option<Instant>)>,
    /// The length of each, what is left of it, and whether it is a response.
    in_flight: Vec<(usize, usize, bool)>,
    dropped: u64,
}

#[derive(Clone, PartialEq)]
struct Waiting {
    frame: Bytes,
    kind: Kind,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Response,
    Queued,
    Held(usize),
}

impl Model {
    fn held(&self, topic: usize) -> Vec<usize> {
        let held = |index: &usize| self.waiting[*index].kind == Kind::Held(topic);
        (0..self.waiting.len()).filter(held).collect()
    }

    fn due(&self) -> Option<(Instant, usize)> {
        let due = self
            .throttles
            .iter()
            .filter(|(topic, _)| !self.held(**topic).is_empty());
        due.map(|(topic, (interval, _, last))| (last.unwrap() + *interval, *topic))
            .min()
    }

    fn release(&mut self, now: Instant) {
        while let Some((_, topic)) = self.due().filter(|(due, _)| *due <= now) {
            let mut released = self.waiting.remove(self.held(topic)[0]);
            released.kind = Kind::Queued;
            self.waiting.push(released);
            self.throttles.get_mut(&topic).unwrap().2 = Some(now);
        }
    }

    fn push(&mut self, topic: usize, frame: Bytes, now: Instant) {
        self.release(now);
        if frame.len() > MAX_TOPIC_BYTES {
            self.dropped += 1;
            return;
        }
        let idle = self.held(topic).is_empty();
        let kind = match self.throttles.get_mut(&topic) {
            Some((interval, _, last))
                if idle && last.is_none_or(|last| last + *interval <= now) =>
            {
                *last = Some(now);
                Kind::Queued
            }
            Some(_) => Kind::Held(topic),
            None => Kind::Queued,
        };
        self.waiting.push(Waiting { frame, kind });
        self.trim(topic);
        while self.topic_bytes() > MAX_TOPIC_BYTES {
            let oldest = self
                .waiting
                .iter()
                .position(|waiting| waiting.kind != Kind::Response);
            self.waiting.remove(oldest.unwrap());
            self.dropped += 1;
        }
    }

    /// Keeps no more held back than the topic's throttle allows.
    fn trim(&mut self, topic: usize) {
        let allowed = self
            .throttles
            .get(&topic)
            .map_or(usize::MAX, |throttle| throttle.1);
        while self.held(topic).len() > allowed {
            self.waiting.remove(self.held(topic)[0]);
        }
    }

    fn discard(&mut self, topic: usize) {
        self.waiting
            .retain(|waiting| waiting.kind != Kind::Held(topic));
    }

    fn set_throttle(&mut self, topic: usize, throttle: Option<(Duration, usize)>) {
        if let Some((interval, queue_length)) = throttle {
            let last = self.throttles.get(&topic).and_then(|throttle| throttle.2);
            self.throttles.insert(topic, (interval, queue_length, last));
            self.trim(topic);
            return;
        }
        self.throttles.remove(&topic);
        let freed: Vec<Waiting> = self
            .held(topic)
            .into_iter()
            .map(|index| self.waiting[index].clone())
            .collect();
        self.discard(topic);
        self.waiting.extend(freed.into_iter().map(|freed| Waiting {
            kind: Kind::Queued,
            ..freed
        }));
    }

    fn take(&mut self, now: Instant, max_frames: usize, max_bytes: usize) -> Vec<Bytes> {
        self.release(now);
        let mut batch: Vec<Bytes> = Vec::new();
        let ready = |waiting: &Waiting| !matches!(waiting.kind, Kind::Held(_));
        while let Some(next) = self.waiting.iter().position(ready) {
            let bytes: usize = batch.iter().map(Bytes::len).sum();
            let fits = bytes + self.waiting[next].frame.len() <= max_bytes;
            if !batch.is_empty() && (!fits || batch.len() >= max_frames) {
                break;
            }
            let taken = self.waiting.remove(next);
            self.in_flight.push((
                taken.frame.len(),
                taken.frame.len(),
                taken.kind == Kind::Response,
            ));
            batch.push(taken.frame);
        }
        batch
    }

    fn written(&mut self, mut bytes: usize) {
        for (_, left, _) in &mut self.in_flight {
            let done = bytes.min(*left);
            *left -= done;
            bytes -= done;
        }
    }

    fn topic_bytes(&self) -> usize {
        let topics = self
            .waiting
            .iter()
            .filter(|waiting| waiting.kind != Kind::Response);
        topics.map(|waiting| waiting.frame.len()).sum()
    }

    fn response_bytes(&self) -> usize {
        let responses = self
            .waiting
            .iter()
            .filter(|waiting| waiting.kind == Kind::Response);
        let in_flight = self
            .in_flight
            .iter()
            .filter(|(_, _, is_response)| *is_response);
        responses.map(|waiting| waiting.frame.len()).sum::<usize>()
            + in_flight.map(|(_, left, _)| left).sum::<usize>()
    }

    fn writing_cost(&self) -> usize {
        let topics = self.in_flight.iter();
        let topics = topics.filter(|(_, left, is_response)| *left > 0 && !is_response);
        topics.map(|(length, _, _)| length + FRAME_BYTES).sum()
    }
}

#[derive(Debug, Clone)]
enum Action {
    Push(usize, usize),
    Respond(usize, Vec<usize>),
    SetThrottle(usize, Option<(Duration, usize)>),
    Forget(usize),
    Advance(u64),
    Take(usize, usize),
    Written(usize),
}

const TOPICS: [&str; 3] = ["/a", "/b", "/c"];

fn action() -> impl Strategy<Value = Action> {
    let topic = || 0..TOPICS.len();
    let size = prop_oneof![
        1_usize..100,
        MIB..2 * MIB,
        Just(MAX_TOPIC_BYTES),
        Just(MAX_TOPIC_BYTES + 1)
    ];
    let throttle =
        (1_u64..50, 1_usize..5).prop_map(|(ms, length)| (Duration::from_millis(ms), length));
    prop_oneof![
        10 => (topic(), size).prop_map(|(topic, size)| Action::Push(topic, size)),
        2 => (1_usize..1000, proptest::collection::vec(topic(), 0..2))
            .prop_map(|(size, supersedes)| Action::Respond(size, supersedes)),
        2 => (topic(), proptest::option::weighted(0.8, throttle))
            .prop_map(|(topic, throttle)| Action::SetThrottle(topic, throttle)),
        1 => topic().prop_map(Action::Forget),
        4 => (0_u64..40).prop_map(Action::Advance),
        2 => (1_usize..8, prop_oneof![0_usize..500, Just(usize::MAX)])
            .prop_map(|(frames, bytes)| Action::Take(frames, bytes)),
        1 => (0_usize..3000).prop_map(Action::Written),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Frames are slices of one buffer, each of its own start, so that they can be told apart without being copied.
    #[test]
    fn the_outbox_agrees_with_the_rules_written_slowly(
        actions in proptest::collection::vec(action(), 0..120),
    ) {
        let buffer = Bytes::from(vec![0_u8; MAX_TOPIC_BYTES + 1 + actions.len()]);
        let topics = TOPICS.map(Arc::<str>::from);
        let (mut bench, mut model) = (Bench::new(), Model::default());
        let place = |batch: &[Bytes]| -> Vec<(usize, usize)> {
            let start = |frame: &Bytes| frame.as_ptr() as usize - buffer.as_ptr() as usize;
            batch.iter().map(|frame| (start(frame), frame.len())).collect()
        };
        for (index, action) in actions.into_iter().enumerate() {
            let now = bench.now;
            match action {
                Action::Push(topic, size) => {
                    let frame = buffer.slice(index..index + size);
                    bench.outbox.push(&topics[topic], frame.clone(), now);
                    model.push(topic, frame, now);
                }
                Action::Respond(size, supersedes) => {
                    let frame = buffer.slice(index..index + size);
                    let names: Vec<&str> = supersedes.iter().map(|&topic| TOPICS[topic]).collect();
                    bench.outbox.push_response(frame.clone(), &names);
                    supersedes.into_iter().for_each(|topic| model.discard(topic));
                    model.waiting.push(Waiting { frame, kind: Kind::Response });
                }
                Action::SetThrottle(topic, throttle) => {
                    bench.outbox.set_throttle(&topics[topic], throttle);
                    model.set_throttle(topic, throttle);
                }
                Action::Forget(topic) => {
                    bench.outbox.forget(TOPICS[topic]);
                    model.discard(topic);
                    model.throttles.remove(&topic);
                }
                Action::Advance(ms) => bench.advance(ms),
                Action::Take(frames, bytes) => {
                    let batch = bench.take(frames, bytes);
                    prop_assert_eq!(place(&batch), place(&model.take(now, frames, bytes)));
                }
                Action::Written(bytes) => {
                    bench.outbox.written(bytes);
                    model.written(bytes);
                }
            }
            prop_assert_eq!(bench.outbox.topic_bytes(), model.topic_bytes());
            prop_assert!(bench.outbox.topic_bytes() <= MAX_TOPIC_BYTES);
            prop_assert_eq!(bench.outbox.response_bytes(), model.response_bytes());
            prop_assert_eq!(bench.outbox.writing_cost(), model.writing_cost());
            prop_assert_eq!(bench.outbox.dropped(), model.dropped);
            prop_assert_eq!(bench.outbox.next_release(), model.due().map(|(due, _)| due));
        }
    }
}

#[test]
fn the_oldest_messages_go_until_those_that_are_left_fit_with_their_places() {
    let mut bench = Bench::new();
    bench.throttle("/held", 1000, 10);
    for topic in ["/t", "/held", "/held", "/t", "/t"] {
        bench.push(topic, vec![b'x'; 1000]);
    }
    bench.respond("response", &[]);
    // As it is charged: the message whole, and its place.
    let each = 1000 + FRAME_BYTES + PLACE_BYTES;
    let mut kept = |bytes| {
        bench.outbox.keep_topics(bytes);
        let outbox = &bench.outbox;
        assert_eq!(outbox.topic_bytes(), 1000 * outbox.topic_count());
        (outbox.topic_count(), outbox.dropped())
    };
    assert_eq!(kept(5 * each), (5, 0));
    assert_eq!(kept(5 * each - 1), (4, 1));
    assert_eq!(kept(2 * each), (2, 3));
    assert_eq!(kept(0), (0, 5));
    assert_eq!(bench.take_all(), ["response"], "which never goes");
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
