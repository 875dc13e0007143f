//! Throttled topics, step by step.
//!
//! `a1` is a message on `/a`, and `r1` a response, each with this text; `r1-a` outdates the messages of `/a`. `~a100/2` is an interval of
//! 100 ms that holds back 2 messages, and `!a` an unsubscription. `+50` lets 50 ms pass, `=a1,a2` takes all frames, `?50` is the time until
//! the next release, `#4` is the number of counted bytes, and `x1` of dropped messages.

use std::time::Duration;

use bytes::Bytes;

use super::Bench;

const ROWS: [(&str, &str); 9] = [
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
        "+" => bench.advance(rest.parse().unwrap()),
        "=" => assert_eq!(bench.take_all().join(","), rest),
        "?" => {
            let due = (!rest.is_empty())
                .then(|| bench.now + Duration::from_millis(rest.parse().unwrap()));
            assert_eq!(bench.outbox.next_release(), due);
        }
        "#" => assert_eq!(bench.outbox.topic_bytes().to_string(), rest),
        "x" => assert_eq!(bench.outbox.dropped().to_string(), rest),
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
