//! A client that reads half of its messages gets current ones if the number of its unread bytes is known.

use std::cell::Cell;
use std::rc::Rc;
use std::sync::Arc;

use super::*;
use crate::virtual_time::Watched;
use pendularm::actors::gateway::connection::{self, Ends};
use tokio::io::{AsyncReadExt, duplex};
use tokio::time::Instant;

/// Thirty seconds of 60 messages a second for a client that takes `a_second` of them, and reads `chunk` bytes at a
/// time. Returns its longest delay, the number of its messages, and that of the queries of its unread bytes.
async fn lateness(queue_length: u64, a_second: u32, chunk: usize) -> (Duration, usize, u32) {
    let gateway = Gateway::bare().await;
    let (unread, queries) = (Rc::new(Cell::new(0)), Rc::new(Cell::new(0)));
    let (mut client, theirs) = duplex(WIDE);
    let mut theirs = Watched::new(theirs);
    let count = Rc::clone(&unread);
    theirs.on_write = Box::new(move |bytes| count.set(count.get() + bytes.len()));
    let (registry, gauges) = (gateway.registry.clone(), Arc::clone(&gateway.gauges));
    let (source, asked) = (Rc::clone(&unread), Rc::clone(&queries));
    connection::start(
        Some(Box::new(move || {
            asked.set(asked.get() + 1);
            Some(source.get())
        })),
        Arc::default(),
        Ends::default(),
        theirs,
        registry,
        gauges,
    );
    let subscribe =
        format!("{{\"op\":\"subscribe\",\"topic\":\"/t\",\"queue_length\":{queue_length}}}\n");
    tokio::io::AsyncWriteExt::write_all(&mut client, subscribe.as_bytes())
        .await
        .unwrap();
    settle().await;
    let began = Instant::now();
    let mut publisher = gateway.connect(WIDE);
    let advertise = json!({"op": "advertise", "topic": "/t"});
    publisher.send(&advertise).await;
    let publishing = actix::spawn(async move {
        for n in 1..30 * 60 {
            sleep_until(began + Duration::from_secs(1) * n / 60).await;
            let msg = json!({"at": began.elapsed().as_secs_f64(), "fill": "x".repeat(400)});
            publisher
                .send(&json!({"op": "publish", "topic": "/t", "msg": msg}))
                .await;
        }
    });
    let (mut bytes, mut late, mut count) = (Vec::new(), Duration::ZERO, 0);
    while began.elapsed() < Duration::from_secs(30) {
        let Some(end) = bytes.iter().position(|&byte| byte == b'\n') else {
            let mut buffer = vec![0; chunk];
            let reading = client.read(&mut buffer);
            let Ok(read) = tokio::time::timeout(Duration::from_secs(1), reading).await else {
                break;
            };
            let read = read.unwrap();
            unread.set(unread.get() - read);
            bytes.extend(&buffer[..read]);
            continue;
        };
        let line: Vec<u8> = bytes.drain(..=end).collect();
        let frame: serde_json::Value = serde_json::from_slice(&line).unwrap();
        if let Some(at) = frame["msg"]["at"].as_f64() {
            late = late.max(began.elapsed().saturating_sub(Duration::from_secs_f64(at)));
            count += 1;
            sleep(Duration::from_secs(1) / a_second).await;
        }
    }
    publishing.abort();
    (late, count, queries.get())
}

#[test]
fn a_client_that_takes_half_of_the_messages_is_about_a_second_late_at_most() {
    in_virtual_time(async {
        for (queue_length, a_second, chunk, most) in [
            (0, 30, 100, 1500),
            (1, 30, 100, 1500),
            (5, 50, 8192, 1500),
            (0, 30, 4096, 3000),
            (1, 30, 4096, 3000),
        ] {
            let (late, count, queries) = lateness(queue_length, a_second, chunk).await;
            let case = format!("{queue_length} {a_second} {chunk}: {late:?}, {count}, {queries}");
            assert!(queries <= 30 * 20, "one in 50 ms: {case}");
            assert!(late < Duration::from_millis(most), "{case}");
            assert!(
                count > 22 * a_second as usize,
                "it has enough to do: {case}"
            );
        }
    });
}

#[test]
fn a_client_that_reads_everything_loses_nothing_and_has_no_delay() {
    in_virtual_time(async {
        let (late, count, queries) = lateness(1, 100_000, 8192).await;
        assert_eq!(count, 30 * 60 - 1);
        assert!(queries <= 100, "one in 300 ms: {queries}");
        assert!(late < Duration::from_millis(3), "{late:?}");
    });
}
