//! Throttled topics, messages that wait for a long time, and bounded queues, step by step.
//!
//! `a1` is a message on `/a`, `f1` feedback, `g1` the end of a goal and `r1` a response, each with this text; `r1-a` outdates the
//! messages of `/a`, and `f*` is longer than a message may be. `~a100/2` is an interval of 100 ms that holds back 2 messages, `qa2` a queue of 2 messages, and `!a` an
//! unsubscription. `+50` lets 50 ms pass, `=a1,a2` takes all frames, `=9:a1` at most 9 bytes, and `-a1` one frame; `w2` writes 2 bytes.
//! `(0/200` is a socket with room for 0 bytes, for which a message is fresh for 200 ms. `?50` is the time until the next release, `#4` is
//! the number of counted bytes, `%3` of waiting messages, and `x1` of dropped ones.

use std::time::Duration;

use bytes::Bytes;

use super::Bench;
use pendularm::protocol::catalog::Topic;
use pendularm::protocol::outbox::{MAX_MESSAGE, Room, Throttle};

const ROWS: [(&str, &str); 18] = [
    (
        "the newest messages are held, and one leaves per interval",
        "~a100/2 a1 a2 a3 a4 #6 =a1 #4 ?100 +99 = ?1 +1 =a3 ?100 +100 =a4 ? #0 x0",
    ),
    (
        "an interval counts from the last release, also from a late one",
        "~a100/2 a1 =a1 +100 a2 ? =a2 a3 a4 = +350 =a3 ?100 +99 = +1 =a4",
    ),
    (
        "topics are throttled apart, and the earliest is released first",
        "~a100/1 ~b30/1 a1 b1 a2 b2 =a1,b1 ?30 +30 =b2 ?70 +70 =a2",
    ),
    (
        "a message enters the order when it is released",
        "~a100/1 a1 =a1 a2 b1 r1 +100 b2 =b1,r1,a2,b2",
    ),
    (
        "a response outdates what is held of its topic",
        "~a100/2 ~b100/2 a1 b1 a2 b2 =a1,b1 r1-a #2 =r1 +100 =b2 x0",
    ),
    (
        "an unsubscription discards what is held, and the throttle",
        "~a100/2 a1 a2 =a1 !a ? #0 a3 a4 =a3,a4 ~a100/2 a5 =a5 x0",
    ),
    (
        "the end of a throttle releases what is held, behind what waits",
        "~a100/2 a1 a2 a3 =a1 b1 ~a0/1 ? =b1,a2,a3 a4 a5 =a4,a5",
    ),
    (
        "a shorter queue keeps the newest message",
        "~a100/3 a1 a2 a3 a4 =a1 ~a100/1 #2 +100 =a4 x0",
    ),
    (
        "another interval counts from the last release too",
        "~a100/1 a1 =a1 +10 ~a50/1 a2 ?40 +40 =a2",
    ),
    (
        "a message older than a second is dropped unless it is the newest of its topic",
        "a1 b1 a2 a3 r1 +999 -a1 +1 -b1 x0 +1 =a3,r1 x1 #0",
    ),
    (
        "an old message is removed as soon as its topic has a newer one",
        "a1 b1 +1001 c1 %3 a2 x1 %3 =6:b1,c1,a2",
    ),
    (
        "after an old message is dropped, half a second is too old until the queue is empty",
        "a1 a2 +1001 a3 a4 x2 -a3 a5 +501 =a5 x3 a6 a7 +501 =a6,a7 b1 +1001 a8 a9 +501 =b1,a8,a9 x3",
    ),
    (
        "the end of a goal is never too old",
        "g1 g2 a1 a2 +1001 g3 +1001 a3 x2 =g1,g2,g3,a3 x2 g4 r1 +300 g5 (0/200 =g4,r1 (9/0 =g5",
    ),
    (
        "the age of a message counts from its release by the throttle",
        "~a5000/2 a1 a2 a3 =a1 +5000 =a2 +5000 =a3 x0",
    ),
    (
        "a queue length bounds the queue of a slow client, which has been offered a message",
        "qa2 a1 a2 a3 -a1 a4 b4 a5 b5 x2 w2 =a4,b4,a5,b5 ~a100/1 a6 a7 =a6",
    ),
    (
        "a queue length counts no other topic's old message",
        "c1 b1 +1001 qa1 a1 a2 a3 -c1 a4 x3 =b1,a4",
    ),
    (
        "a full socket takes only fresh messages ahead of a response",
        "a1 b1 +300 a2 (0/200 = r1 a3 =b1,a2,r1 (1/0 =a3",
    ),
    (
        "feedback is not throttled and replaces no message of a topic with the action's name",
        "~a1000/1 a1 a2 f3 f4 f* x1 =a1,f3,f4 +1000 =a2",
    ),
];

fn play(bench: &mut Bench, step: &'static str) {
    let (what, rest) = step.split_at(1);
    let topic = |name: &str| format!("/{name}");
    match what {
        "~" => {
            let (name, values) = rest.split_at(1);
            let (ms, held_back) = values.split_once('/').unwrap();
            let [ms, held_back] = [ms, held_back].map(|value| value.parse().unwrap());
            bench.throttle(&topic(name), ms, held_back as usize);
        }
        "!" => bench.outbox.configure(&topic(rest).into(), None),
        "q" => {
            let (name, most) = rest.split_at(1);
            let queue_length = Some(most.parse().unwrap());
            let throttle = Throttle {
                queue_length,
                ..Throttle::NONE
            };
            bench.outbox.configure(&topic(name).into(), Some(throttle));
        }
        "(" => {
            let (room, ms) = rest.split_once('/').unwrap();
            let fresh = Duration::from_millis(ms.parse().unwrap());
            bench
                .outbox
                .allow(Room::Bytes(room.parse().unwrap()), fresh);
        }
        "+" => bench.advance(rest.parse().unwrap()),
        "-" => assert_eq!(bench.take(1, usize::MAX), [rest]),
        "=" => {
            let (bytes, frames) = rest.split_once(':').unwrap_or(("", rest));
            let taken = bench.take(usize::MAX, bytes.parse().unwrap_or(usize::MAX));
            assert_eq!(taken.join(&b","[..]), frames.as_bytes());
        }
        "w" => bench.outbox.note_written(rest.parse().unwrap()),
        "%" => assert_eq!(bench.outbox.topic_count().to_string(), rest),
        "?" => {
            let due = (!rest.is_empty())
                .then(|| bench.now + Duration::from_millis(rest.parse().unwrap()));
            assert_eq!(bench.outbox.next_release(), due);
        }
        "#" => assert_eq!(bench.outbox.topic_bytes().to_string(), rest),
        "x" => assert_eq!(bench.outbox.dropped().to_string(), rest),
        "f" => {
            let long = vec![b'x'; MAX_MESSAGE + 1].into();
            let frame = if rest == "*" { long } else { step.into() };
            bench.outbox.push_feedback(frame, bench.now);
        }
        "g" => bench.push(Topic::IkResult.name(), Bytes::from(step)),
        "r" => {
            let (text, outdated) = step.split_once('-').unwrap_or((step, "none"));
            bench.respond(text, &[topic(outdated).as_str()]);
        }
        name => bench.push(&topic(name), Bytes::from(step)),
    }
}

#[test]
fn every_step_of_a_throttle_is_that_of_its_row() {
    for (name, steps) in ROWS {
        let mut bench = Bench::new();
        for (at, step) in steps.split(' ').enumerate() {
            println!("{name}: step {at}, {step}");
            play(&mut bench, step);
        }
    }
}
