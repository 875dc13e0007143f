//! A client that reads half of its messages gets current ones.

use std::io::{BufRead, BufReader, Read};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::common::{Client, Runtime};
use serde_json::{Value, json};

/// Half of the rate of `/joint_states`.
const READS_A_SECOND: u32 = 30;
/// The duration of the test. Without a bound the client would be late by half of it at the end.
const TIME: Duration = Duration::from_secs(12);
/// Buffers as small as a script's. Their content counts as read, because the runtime cannot see it.
const BUFFER: usize = 4096;

/// Simulation time of a message \[ms\], if it is one of the joints' states.
fn stamp(text: &[u8]) -> Option<u64> {
    let frame: Value = serde_json::from_slice(text).ok()?;
    let stamp = frame["msg"]["header"].get("stamp")?;
    Some(stamp["sec"].as_u64()? * 1000 + stamp["nanosec"].as_u64()? / 1_000_000)
}

/// The text of the next WebSocket frame of a server.
fn frame(input: &mut impl Read) -> Vec<u8> {
    let mut bytes = |length: u64| {
        let mut bytes = vec![0; length as usize];
        input.read_exact(&mut bytes).unwrap();
        bytes
    };
    let length = match u64::from(bytes(2)[1]) {
        126 => bytes(2)
            .into_iter()
            .fold(0, |all, byte| all * 256 + u64::from(byte)),
        length => length,
    };
    bytes(length)
}

/// Reads half of the messages, and returns the longest delay of the last ones in milliseconds.
fn lateness(mut client: Client, is_web: bool, queue_length: u32, newest: &AtomicU64) -> u64 {
    client
        .send(&json!({"op": "subscribe", "topic": "/joint_states", "queue_length": queue_length}));
    let mut input = BufReader::with_capacity(BUFFER, client.stream().try_clone().unwrap());
    let (began, mut late, mut reads) = (Instant::now(), 0, 0);
    while began.elapsed() < TIME {
        let text = if is_web {
            frame(&mut input)
        } else {
            let mut line = Vec::new();
            input.read_until(b'\n', &mut line).unwrap();
            line
        };
        let Some(stamp) = stamp(&text) else { continue };
        if began.elapsed() > TIME / 2 {
            late = late.max(newest.load(Ordering::Relaxed).saturating_sub(stamp));
        }
        reads += 1;
        sleep((began + Duration::from_secs(reads) / READS_A_SECOND).duration_since(Instant::now()));
    }
    assert!(late > 0, "it has read all that there was");
    late
}

#[test]
fn a_client_that_reads_half_of_the_messages_is_a_second_late_at_most() {
    let runtime = Runtime::start();
    let (newest, is_over) = (AtomicU64::new(0), AtomicBool::new(false));
    let mut quick = runtime.connect();
    quick.subscribe("/joint_states");
    let late = std::thread::scope(|scope| {
        scope.spawn(|| {
            while !is_over.load(Ordering::Relaxed) {
                let stamp = &quick.message("/joint_states")["header"]["stamp"];
                let time = stamp["sec"].as_u64().unwrap() * 1000
                    + stamp["nanosec"].as_u64().unwrap() / 1_000_000;
                newest.store(time, Ordering::Relaxed);
            }
        });
        let kinds = [(false, 0), (false, 1), (true, 0), (true, 1)];
        let slow = kinds.map(|(is_web, queue_length)| {
            let client = if is_web {
                Client::web(runtime.address)
            } else {
                runtime.connect()
            };
            let newest = &newest;
            scope.spawn(move || lateness(client, is_web, queue_length, newest))
        });
        let late = slow.map(std::thread::ScopedJoinHandle::join);
        is_over.store(true, Ordering::Relaxed);
        late.map(Result::unwrap)
    });
    println!("TCP, TCP and queue_length 1, WebSocket, WebSocket and queue_length 1: {late:?} ms");
    // A second, plus the delay of a client's buffer and of a busy machine. Without the bound it would be three seconds.
    assert!(late.iter().all(|late| *late < 1500), "{late:?} ms");
}
