//! Random sequences of operations of an outbox, compared with a slow model.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;
use pendularm::protocol::limits::MEDIUM;
use pendularm::protocol::outbox::{MAX_MESSAGE, MAX_TOPIC_BYTES, MESSAGE_BYTES, Throttle};
use proptest::prelude::*;

use super::Bench;

/// A slow model of an outbox: one list, searched from the front each time.
#[derive(Default)]
struct Model {
    /// Queued and held back, in the order of their numbers.
    waiting: Vec<Waiting>,
    throttles: BTreeMap<usize, (Duration, usize, Option<Instant>)>,
    /// The rest of each, and whether it is a response.
    in_flight: Vec<(usize, bool)>,
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
        if frame.len() > MAX_MESSAGE {
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
        while self.topic_cost() > MAX_TOPIC_BYTES {
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
        // An interval of zero is no throttle.
        if let Some((interval, queue_length)) = throttle.filter(|(time, _)| !time.is_zero()) {
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
            self.in_flight
                .push((taken.frame.len(), taken.kind == Kind::Response));
            batch.push(taken.frame);
        }
        batch
    }

    fn written(&mut self, mut bytes: usize) {
        for (left, _) in &mut self.in_flight {
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
        let lengths = topics.map(|waiting| waiting.frame.len());
        lengths.map(|length| length.min(MEDIUM)).sum()
    }

    fn topic_cost(&self) -> usize {
        let topics = self
            .waiting
            .iter()
            .filter(|waiting| waiting.kind != Kind::Response);
        self.topic_bytes() + topics.count() * MESSAGE_BYTES
    }

    fn response_bytes(&self) -> usize {
        let responses = self
            .waiting
            .iter()
            .filter(|waiting| waiting.kind == Kind::Response);
        let in_flight = self
            .in_flight
            .iter()
            .filter(|(_, is_response)| *is_response);
        responses.map(|waiting| waiting.frame.len()).sum::<usize>()
            + in_flight.map(|(left, _)| left).sum::<usize>()
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
        20_000..MEDIUM,
        Just(MEDIUM),
        Just(MEDIUM + 1),
        Just(MAX_MESSAGE),
        Just(MAX_MESSAGE + 1)
    ];
    let throttle =
        (0_u64..20, 1_usize..5).prop_map(|(ms, length)| (Duration::from_millis(ms), length));
    prop_oneof![
        10 => (topic(), size).prop_map(|(topic, size)| Action::Push(topic, size)),
        2 => (1_usize..1000, proptest::collection::vec(topic(), 0..2))
            .prop_map(|(size, supersedes)| Action::Respond(size, supersedes)),
        2 => (topic(), proptest::option::weighted(0.8, throttle))
            .prop_map(|(topic, throttle)| Action::SetThrottle(topic, throttle)),
        1 => topic().prop_map(Action::Forget),
        4 => (0_u64..9).prop_map(Action::Advance),
        2 => (1_usize..8, prop_oneof![0_usize..500, Just(usize::MAX)])
            .prop_map(|(frames, bytes)| Action::Take(frames, bytes)),
        1 => (0_usize..3000).prop_map(Action::Written),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Frames are slices of one buffer with different starts, so that they differ without being copied.
    #[test]
    fn the_outbox_agrees_with_the_rules_written_slowly(
        actions in proptest::collection::vec(action(), 0..120),
    ) {
        let buffer = Bytes::from(vec![0_u8; MAX_MESSAGE + 1 + actions.len()]);
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
                    let asked = throttle
                        .map_or(Throttle::NONE, |(interval, most)| super::throttle(interval, most));
                    bench.outbox.configure(&topics[topic], Some(asked));
                    model.set_throttle(topic, throttle);
                }
                Action::Forget(topic) => {
                    bench.outbox.configure(&topics[topic], None);
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
            prop_assert_eq!(bench.outbox.dropped(), model.dropped);
            prop_assert_eq!(bench.outbox.next_release(), model.due().map(|(due, _)| due));
        }
    }
}
