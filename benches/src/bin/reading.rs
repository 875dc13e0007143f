//! How fast what clients send is read, whatever they send: every reading function on every input that is meant to be
//! slow.
//!
//! `reading [WORD]`: only the rows whose function or input has that word.
//!
//! The gateway's thread reads frames of up to 64 KiB, other threads longer ones; at the bar, 200 MB/s, 64 KiB are a
//! third of a millisecond. Arguments and trajectories of ours are read once more, for what counts of them: in the
//! nastiest, a million zeros, at 130 MB/s, half a millisecond.

use std::hint::black_box;
use std::time::{Duration, Instant};

use pendularm::protocol::catalog::Service;
use pendularm::protocol::op::fields::{Bound, Fields};
use pendularm::protocol::op::{self, Op};
use pendularm::protocol::wire::frame::{FrameReader, RawFrame};
use pendularm::protocol::wire::{fragments, json};

/// The least speed of reading, in MB/s.
const BAR: f64 = 200.0;
/// Bytes of an input.
const SIZE: usize = 1024 * 1024;
/// Each is read so often, and for so long at least; the fastest counts.
const ROUNDS: usize = 3;
const TIME: Duration = Duration::from_millis(20);

/// `unit` again and again between `start` and `end`, with commas in between, up to [`SIZE`].
fn repeated(start: &str, unit: &str, end: &str) -> String {
    let count = (SIZE - start.len() - end.len()) / (unit.len() + 1);
    let mut text = String::with_capacity(SIZE);
    text.push_str(start);
    for index in 0..count {
        if index > 0 {
            text.push(',');
        }
        text.push_str(unit);
    }
    text.push_str(end);
    text
}

/// JSON values that are slow for one or the other reader.
fn values() -> Vec<(&'static str, String)> {
    let deep = "[".repeat(100) + &"]".repeat(100);
    let string = |unit: &str| format!("\"{}\"", unit.repeat((SIZE - 2) / unit.len()));
    vec![
        ("text", string("x")),
        ("backslashes", string("\\\\")),
        ("quotes in text", string("\\\"")),
        ("escaped characters", string("\\u00e9")),
        ("two-byte characters", string("\u{e9}")),
        ("four-byte characters", string("\u{1f9be}")),
        (
            "slow decimals",
            repeated("[", "10000000000000001268e281", "]"),
        ),
        (
            "long decimals",
            repeated("[", &format!("0.{}", "9".repeat(700)), "]"),
        ),
        ("one number", "7".repeat(SIZE)),
        ("zeros", repeated("[", "0", "]")),
        ("exponents", repeated("[", "1e9", "]")),
        ("overflows", repeated("[", "1e999", "]")),
        ("empty strings", repeated("[", "\"\"", "]")),
        ("empty arrays", repeated("[", "[]", "]")),
        ("empty keys", repeated("{", "\"\":0", "}")),
        ("short keys", repeated("{", "\"op_\":0", "}")),
        ("escaped keys", repeated("{", "\"\\u006f\":0", "}")),
        ("deep nesting", repeated("[", &deep, "]")),
        ("words", repeated("[", "null", "]")),
        ("spaces", format!("[{}]", " ".repeat(SIZE - 2))),
        ("carriage returns", format!("[{}]", "\r".repeat(SIZE - 2))),
    ]
}

/// Processor time of this thread, where the system tells it: other work of the machine then counts for less.
fn now(began: Instant) -> Duration {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|text| text.split(' ').next()?.parse().ok());
    nanoseconds.map_or_else(|| began.elapsed(), Duration::from_nanos)
}

/// MB/s of `work` on `bytes` bytes.
fn speed<T>(bytes: usize, mut work: impl FnMut() -> T) -> f64 {
    let began = Instant::now();
    let mut best = Duration::MAX;
    for _ in 0..ROUNDS {
        let (start, mut times) = (now(began), 0);
        let mut taken = Duration::ZERO;
        while taken < TIME {
            black_box(work());
            times += 1;
            taken = now(began).saturating_sub(start);
        }
        best = best.min(taken / times);
    }
    bytes as f64 / best.as_secs_f64() / 1e6
}

fn framed(frame: &str) -> RawFrame {
    let mut reader = FrameReader::new();
    reader.push(frame.as_bytes());
    reader.next_raw().expect("a whole frame").expect("a frame")
}

struct Table {
    /// A row must have this in its name.
    word: String,
    missed: usize,
}

impl Table {
    fn row<T>(&mut self, function: &str, input: &str, bytes: usize, work: impl FnMut() -> T) {
        if !function.contains(&self.word) && !input.contains(&self.word) {
            return;
        }
        let speed = speed(bytes, work);
        let missed = speed < BAR;
        self.missed += usize::from(missed);
        let mark = if missed { "  MISSED" } else { "" };
        println!("{function:34} {input:24} {speed:9.0} MB/s{mark}");
    }

    fn frame(&mut self, input: &str, frame: &str) {
        let chunks = || {
            let mut reader = FrameReader::new();
            let mut found = 0;
            for chunk in frame.as_bytes().chunks(64 * 1024) {
                reader.push(chunk);
                found += reader.next_raw().into_iter().count();
            }
            found
        };
        self.row("frame: where it ends", input, frame.len(), chunks);
        let whole = |frame: &str| framed(frame).decode();
        self.row("frame: ends, and is UTF-8", input, frame.len(), || {
            whole(frame)
        });
        self.row("op, with all that is passed on", input, frame.len(), || {
            op::read(frame)
        });
    }
}

fn main() {
    let mut table = Table {
        word: std::env::args().nth(1).unwrap_or_default(),
        missed: 0,
    };
    for (input, value) in values() {
        table.row("what is passed on, made strict", input, value.len(), || {
            json::strict(&value).len()
        });
        for (place, frame) in [
            (
                "id",
                format!("{{\"op\":\"publish\",\"topic\":\"/t\",\"msg\":{{}},\"id\":{value}}}"),
            ),
            (
                "msg",
                format!("{{\"op\":\"publish\",\"topic\":\"/t\",\"msg\":{{\"a\":{value}}}}}"),
            ),
            (
                "args",
                format!("{{\"op\":\"call_service\",\"service\":\"/t\",\"args\":[{value}]}}"),
            ),
        ] {
            table.frame(&format!("{input}, {place}"), &frame);
        }
        // A node of ours reads a field of long arguments, and one that they do not have.
        for name in ["lengths", "other"] {
            let frame = format!(
                "{{\"op\":\"call_service\",\"service\":\"/arm_sim/set_params\",\"args\":{{\"{name}\":{value}}}}}"
            );
            let call = || match op::read(&frame).op {
                Ok(Op::CallService(call)) => {
                    let mut fields = Fields::read(&call.args, Service::SetParams).expect("fields");
                    fields.numbers("lengths", 2, Bound::Positive).is_some()
                }
                _ => false,
            };
            table.row(&format!("set_params, {name}"), input, frame.len(), call);
        }
        let frame = format!(
            "{{\"op\":\"publish\",\"topic\":\"/joint_trajectory\",\"msg\":{{\"points\":{value}}}}}"
        );
        table.row("trajectory, what counts of it", input, frame.len(), || {
            op::read(&frame)
        });
        let frame = bytes::Bytes::from(format!(
            "{{\"op\":\"publish\",\"topic\":\"/t\",\"msg\":{value}}}\n"
        ));
        let split = || {
            fragments::split(&frame, 64, "pendularm:1", usize::MAX).map_or(0, |lines| lines.len())
        };
        table.row("fragments of 64 bytes, written", input, frame.len(), split);
    }
    // Members of the frame itself.
    for (input, unit) in [
        ("empty keys", "\"\":0"),
        ("short keys", "\"op_\":0"),
        ("our keys", "\"topic\":0"),
    ] {
        let frame = repeated("{", unit, "}");
        table.frame(&format!("{input}, frame"), &frame);
    }
    let names = repeated("{\"a\":[", "NaN", "]}");
    table.frame("names of no numbers", &names);
    let line = |msg: &str| format!("{{\"op\":\"publish\",\"topic\":\"/t\",\"msg\":{{{msg}}}}}\n");
    for (input, msg) in [
        ("empty messages", String::new()),
        (
            "zeros",
            repeated("\"a\":[", "0", "]").split_at(50_000).0.to_owned() + "]",
        ),
        ("text", format!("\"a\":\"{}\"", "x".repeat(50_000))),
    ] {
        let line = line(&msg);
        let lines = line.repeat(SIZE / line.len());
        let read = || {
            let mut reader = FrameReader::new();
            reader.push(lines.as_bytes());
            std::iter::from_fn(|| reader.series()).count()
        };
        table.row("series", input, lines.len(), read);
    }
    println!("{} below the bar of {BAR} MB/s", table.missed);
}
