//! The outbox against a slow model that keeps everything in lists and searches them.
//!
//! Asserted: both give the same frames in the same order and count the same; topic messages that wait have at most 4 MiB,
//! and of too many the oldest go; no response is ever lost; throttled topics keep their distance, the newest of what they
//! hold back, and their place in the order.
//!
//! Input: what is done to it.

#![no_main]

use std::sync::Arc;
use std::time::{Duration, Instant};

use arbitrary::Arbitrary;
use bytes::Bytes;
use libfuzzer_sys::fuzz_target;
use pendularm::protocol::outbox::{FRAME_BYTES, MAX_TOPIC_BYTES, Outbox, PLACE_BYTES};
use pendularm_fuzz::limits::{DOING, hold};

const TOPICS: [&str; 4] = ["/a", "/b", "/c", "/d"];

#[derive(Debug, Clone, Copy, Arbitrary)]
enum Step {
    /// A message of that many sixteenths of all there is room for, and some more; none is empty.
    Push {
        topic: u8,
        sixteenths: u8,
        more: u8,
    },
    Respond {
        bytes: u16,
        supersedes: u8,
    },
    Throttle {
        topic: u8,
        interval_ms: u16,
        queue_length: u8,
    },
    Forget {
        topic: u8,
    },
    Take {
        frames: u8,
        bytes: u16,
    },
    Write {
        bytes: u32,
    },
    Pass {
        milliseconds: u16,
    },
    /// Only so much of topic messages is kept, their places included.
    Keep {
        bytes: u32,
    },
}

fuzz_target!(|steps: Vec<Step>| hold(0, DOING, || examine(&steps)));

fn examine(steps: &[Step]) {
    let zeros = Bytes::from_static(&[0; MAX_TOPIC_BYTES + 1]);
    let topics = TOPICS.map(Arc::<str>::from);
    let mut outbox = Outbox::new();
    let mut model = Model::default();
    let mut now = Instant::now();
    for &step in steps {
        match step {
            Step::Push {
                topic,
                sixteenths,
                more,
            } => {
                let topic = usize::from(topic) % TOPICS.len();
                let length =
                    usize::from(sixteenths % 17) * (MAX_TOPIC_BYTES / 16) + usize::from(more) + 1;
                let frame = zeros.slice(..length.min(zeros.len()));
                outbox.push(&topics[topic], frame.clone(), now);
                model.push(topic, frame.len(), now);
            }
            Step::Respond { bytes, supersedes } => {
                let of = |topic: &usize| supersedes >> topic & 1 == 1;
                let chosen: Vec<usize> = (0..TOPICS.len()).filter(of).collect();
                let names: Vec<&str> = chosen.iter().map(|topic| TOPICS[*topic]).collect();
                outbox.push_response(zeros.slice(..usize::from(bytes)), &names);
                model.respond(bytes.into(), &chosen);
            }
            Step::Throttle {
                topic,
                interval_ms,
                queue_length,
            } => {
                let topic = usize::from(topic) % TOPICS.len();
                let interval = Duration::from_millis(interval_ms.into());
                let length = usize::from(queue_length);
                outbox.set_throttle(&topics[topic], Some((interval, length)));
                model.throttle(topic, interval, length.max(1));
            }
            Step::Forget { topic } => {
                let topic = usize::from(topic) % TOPICS.len();
                outbox.forget(TOPICS[topic]);
                model.throttles[topic] = None;
                model.held.retain(|one| one.topic != Some(topic));
            }
            Step::Take { frames, bytes } => {
                let mut batch = Vec::new();
                outbox.take_frames(now, frames.into(), bytes.into(), &mut batch);
                let expected = model.take(now, usize::from(frames).max(1), bytes.into());
                let lengths: Vec<usize> = batch.iter().map(Bytes::len).collect();
                assert_eq!(lengths, expected);
            }
            Step::Write { bytes } => {
                let bytes = usize::try_from(bytes).unwrap_or(usize::MAX) % (2 * MAX_TOPIC_BYTES);
                outbox.written(bytes);
                model.write(bytes);
            }
            Step::Pass { milliseconds } => now += Duration::from_millis(milliseconds.into()),
            Step::Keep { bytes } => {
                let bytes = usize::try_from(bytes).unwrap_or(usize::MAX) % (MAX_TOPIC_BYTES + 10);
                outbox.keep_topics(bytes);
                model.drop_while(|model| {
                    model.topic_bytes() + model.messages().count() * (PLACE_BYTES + FRAME_BYTES)
                        > bytes
                });
            }
        }
        compare(&mut outbox, &model);
    }
}

fn compare(outbox: &mut Outbox, model: &Model) {
    assert!(outbox.topic_bytes() <= MAX_TOPIC_BYTES);
    assert_eq!(outbox.topic_bytes(), model.topic_bytes());
    assert_eq!(outbox.response_bytes(), model.response_bytes());
    assert_eq!(outbox.dropped(), model.dropped);
    assert_eq!(outbox.is_empty(), model.queue.is_empty());
    assert_eq!(
        outbox.next_release(),
        model.next_release().map(|(due, _)| due)
    );
}

/// A frame that waits. Those without a topic are responses.
#[derive(Debug, Clone, Copy)]
struct Waiting {
    number: u64,
    topic: Option<usize>,
    length: usize,
}

#[derive(Debug, Clone, Copy)]
struct Throttle {
    interval: Duration,
    queue_length: usize,
    last: Option<Instant>,
}

#[derive(Default)]
struct Model {
    produced: u64,
    /// Frames that leave next, in order.
    queue: Vec<Waiting>,
    /// Messages that throttles hold back, oldest first.
    held: Vec<Waiting>,
    throttles: [Option<Throttle>; TOPICS.len()],
    /// The frame that is being written: its bytes left, and whether it is a response.
    in_flight: Vec<(usize, bool)>,
    dropped: u64,
}

impl Model {
    fn messages(&self) -> impl Iterator<Item = &Waiting> {
        let waiting = self.queue.iter().chain(&self.held);
        waiting.filter(|one| one.topic.is_some())
    }

    fn topic_bytes(&self) -> usize {
        self.messages().map(|one| one.length).sum()
    }

    /// The oldest messages go.
    fn drop_while(&mut self, too_many: impl Fn(&Self) -> bool) {
        while too_many(self) {
            let oldest = self.messages().map(|one| one.number).min();
            let oldest = oldest.expect("what takes up room");
            self.queue.retain(|one| one.number != oldest);
            self.held.retain(|one| one.number != oldest);
            self.dropped += 1;
        }
    }

    fn response_bytes(&self) -> usize {
        let queued = self
            .queue
            .iter()
            .filter(|one| one.topic.is_none())
            .map(|one| one.length);
        let written = self
            .in_flight
            .iter()
            .filter(|(_, is_response)| *is_response)
            .map(|(left, _)| *left);
        queued.chain(written).sum()
    }

    fn enqueue(&mut self, topic: Option<usize>, length: usize) {
        self.produced += 1;
        let number = self.produced;
        self.queue.push(Waiting {
            number,
            topic,
            length,
        });
    }

    fn push(&mut self, topic: usize, length: usize, now: Instant) {
        self.release(now);
        if length > MAX_TOPIC_BYTES {
            self.dropped += 1;
            return;
        }
        let holds_some = self.held.iter().any(|one| one.topic == Some(topic));
        match &mut self.throttles[topic] {
            Some(throttle)
                if holds_some
                    || throttle
                        .last
                        .is_some_and(|last| last + throttle.interval > now) =>
            {
                let most = throttle.queue_length;
                self.produced += 1;
                let number = self.produced;
                self.held.push(Waiting {
                    number,
                    topic: Some(topic),
                    length,
                });
                self.keep_newest(topic, most);
            }
            throttle => {
                if let Some(throttle) = throttle {
                    throttle.last = Some(now);
                }
                self.enqueue(Some(topic), length);
            }
        }
        self.drop_while(|model| model.topic_bytes() > MAX_TOPIC_BYTES);
    }

    /// Drops the oldest messages that are held back of a topic, until so many remain.
    fn keep_newest(&mut self, topic: usize, most: usize) {
        let mut excess = self
            .held
            .iter()
            .filter(|one| one.topic == Some(topic))
            .count()
            .saturating_sub(most);
        self.held.retain(|one| {
            let goes = one.topic == Some(topic) && excess > 0;
            excess -= usize::from(goes);
            !goes
        });
    }

    fn respond(&mut self, length: usize, supersedes: &[usize]) {
        self.held
            .retain(|one| one.topic.is_none_or(|topic| !supersedes.contains(&topic)));
        self.enqueue(None, length);
    }

    fn throttle(&mut self, topic: usize, interval: Duration, queue_length: usize) {
        if interval.is_zero() {
            self.throttles[topic] = None;
            let is_free = |one: &Waiting| one.topic == Some(topic);
            let freed: Vec<Waiting> = self.held.iter().copied().filter(is_free).collect();
            self.held.retain(|one| !is_free(one));
            for one in freed {
                self.enqueue(one.topic, one.length);
            }
            return;
        }
        let last = self.throttles[topic].and_then(|throttle| throttle.last);
        self.throttles[topic] = Some(Throttle {
            interval,
            queue_length,
            last,
        });
        self.keep_newest(topic, queue_length);
    }

    /// When and of which topic the next message is let go.
    fn next_release(&self) -> Option<(Instant, usize)> {
        let due = self.held.iter().filter_map(|one| {
            let topic = one.topic?;
            let throttle = self.throttles[topic]?;
            Some((throttle.last? + throttle.interval, topic))
        });
        due.min()
    }

    fn release(&mut self, now: Instant) {
        while let Some((due, topic)) = self.next_release()
            && due <= now
        {
            let first = self.held.iter().position(|one| one.topic == Some(topic));
            let freed = self.held.remove(first.expect("it is due"));
            if let Some(throttle) = &mut self.throttles[topic] {
                throttle.last = Some(now);
            }
            self.enqueue(freed.topic, freed.length);
        }
    }

    fn take(&mut self, now: Instant, frames: usize, most: usize) -> Vec<usize> {
        self.release(now);
        let mut taken = Vec::new();
        let mut bytes = 0;
        while taken.len() < frames && !self.queue.is_empty() {
            let next = self.queue[0];
            bytes += next.length;
            if !taken.is_empty() && bytes > most {
                break;
            }
            self.queue.remove(0);
            self.in_flight.push((next.length, next.topic.is_none()));
            taken.push(next.length);
        }
        taken
    }

    fn write(&mut self, mut bytes: usize) {
        for (left, _) in &mut self.in_flight {
            let done = bytes.min(*left);
            *left -= done;
            bytes -= done;
        }
        self.in_flight.retain(|(left, _)| *left > 0);
    }
}
