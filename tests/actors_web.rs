//! The web door where time matters: heads that do not come, peers that show no sign of life, clients that do not read.
//!
//! **Invariant:** virtual time and in-memory pipes only; a time that is asserted is exact to the timers' grain.

#![cfg(feature = "web")]
#![allow(
    clippy::expect_used,
    clippy::indexing_slicing,
    clippy::needless_pass_by_value,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a helper of a test fails by panicking, as a test does; it reads best called with a value"
)]

mod virtual_time;

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use futures_util::{SinkExt, StreamExt};
use pendularm::actors::budget::{Budget, Totals};
use pendularm::actors::connection::gate::Gate;
use pendularm::actors::connection::unfinished::FRAME_TIME;
use pendularm::actors::connection::{Connection, STALL_LIMIT};
use pendularm::actors::registry::{FinishAll, Nodes, Publish};
use pendularm::protocol::catalog::{Service, Topic};
use pendularm::protocol::token::Token;
use pendularm::web::access::Access;
use pendularm::web::{Door, MAX_FILES_TOTAL, MAX_REQUESTS};
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream, duplex};
use tokio::time::{Instant, sleep, timeout};
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use tokio_tungstenite::{WebSocketStream, client_async};
use virtual_time::{Gateway, Held, Node, WIDE, assert_elapsed, run, settle};

const HEAD: &str = "GET / HTTP/1.1\r\nHost: 127.0.0.1:9095\r\n";
/// From the first bytes to the end of the head, and to the token.
const HEAD_TIME: Duration = Duration::from_secs(5);
const PING_INTERVAL: Duration = Duration::from_secs(15);
const PONG_TIME: Duration = Duration::from_secs(30);

/// The client's end of a new connection.
fn connect(gateway: &Gateway, room: usize) -> DuplexStream {
    connect_through(gateway, &Arc::default(), room)
}

/// The same through a gate that is shared with others.
fn connect_through(gateway: &Gateway, gate: &Arc<Gate>, room: usize) -> DuplexStream {
    let (ours, theirs) = duplex(room);
    let (registry, gauges) = (gateway.registry.clone(), Arc::clone(&gateway.gauges));
    let local = SocketAddr::from(([127, 0, 0, 1], 9095));
    Connection::start_behind(Arc::clone(gate), local, theirs, registry, gauges);
    ours
}

async fn open(gateway: &Gateway, room: usize) -> WebSocketStream<DuplexStream> {
    let stream = connect(gateway, room);
    let (socket, _) = client_async("ws://127.0.0.1:9095/", stream)
        .await
        .expect("a handshake");
    socket
}

async fn send(socket: &mut WebSocketStream<DuplexStream>, frame: Value) {
    socket
        .send(Message::text(frame.to_string()))
        .await
        .expect("an open socket");
}

/// All that comes up to the end of the stream.
async fn rest(stream: &mut DuplexStream) -> String {
    let mut text = String::new();
    stream
        .read_to_string(&mut text)
        .await
        .expect("an orderly end");
    text
}

/// The next message other than a ping, which is answered.
async fn receive(socket: &mut WebSocketStream<DuplexStream>) -> Message {
    loop {
        match socket.next().await.expect("a message").expect("in order") {
            Message::Ping(_) => socket.flush().await.expect("an open socket"),
            message => return message,
        }
    }
}

#[test]
fn a_head_that_does_not_come_is_given_up_after_five_seconds() {
    run(async {
        let gateway = Gateway::bare().await;
        let mut stream = connect(&gateway, WIDE);
        stream.write_all(HEAD.as_bytes()).await.unwrap();
        let began = Instant::now();
        // A header line every second is no head either.
        let dripping = async {
            for _ in 0..4 {
                sleep(Duration::from_secs(1)).await;
                stream.write_all(b"X: y\r\n").await.unwrap();
            }
            rest(&mut stream).await
        };
        let answer = dripping.await;
        assert!(answer.starts_with("HTTP/1.1 408 "), "{answer}");
        assert_elapsed(began, HEAD_TIME);
        drop(stream);
        settle().await;
        assert_eq!(gateway.gauges.connections(), 0);
    });
}

#[test]
fn a_request_that_is_not_even_begun_may_take_for_ever_and_one_that_is_may_not() {
    run(async {
        let gateway = Gateway::bare().await;
        let mut silent = connect(&gateway, WIDE);
        let mut begun = connect(&gateway, WIDE);
        begun.write_all(b"GE").await.unwrap();
        let began = Instant::now();
        let answer = rest(&mut begun).await;
        assert!(answer.contains("\"level\":\"error\""), "{answer}");
        assert_elapsed(began, HEAD_TIME);
        // What can only become JSON, or BSON, has more time: a frame's.
        let mut open = connect(&gateway, WIDE);
        open.write_all(b"{").await.unwrap();
        let began = Instant::now();
        let answer = rest(&mut open).await;
        assert!(answer.contains("\"level\":\"error\""), "{answer}");
        assert_elapsed(began, FRAME_TIME);
        sleep(Duration::from_secs(24 * 3600)).await;
        silent.write_all(b"{}\n").await.unwrap();
        let mut byte = [0];
        silent.read_exact(&mut byte).await.unwrap();
        assert_eq!(byte, *b"{");
    });
}

/// Two of the longest files are on their way to clients that don't take them: there is no room for a third, until one of them is gone.
#[test]
fn files_of_a_report_that_are_being_sent_have_a_total() {
    run(async {
        let gateway = Gateway::bare().await;
        let folder = std::env::temp_dir().join(format!("pendularm-files-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        // It has a length, and no content on the disk.
        let file = std::fs::File::create(folder.join("a.csv")).unwrap();
        file.set_len(MAX_FILES_TOTAL / 2 - 100_000).unwrap();
        let door = Door::new(Access::default(), folder.clone());
        let gate = Arc::new(Gate { token: None, door });
        let request = HEAD.replace("GET /", "GET /report/a.csv") + "\r\n";
        let mut deaf = Vec::new();
        for _ in 0..2 {
            let mut stream = connect_through(&gateway, &gate, 1024);
            stream.write_all(request.as_bytes()).await.unwrap();
            assert_eq!(stream.read_u8().await.unwrap(), b'H');
            deaf.push(stream);
        }
        let mut late = connect_through(&gateway, &gate, WIDE);
        late.write_all(request.as_bytes()).await.unwrap();
        let answer = rest(&mut late).await;
        assert!(answer.starts_with("HTTP/1.1 503 "), "{answer}");
        deaf.pop();
        settle().await;
        let mut next = connect_through(&gateway, &gate, 1024);
        next.write_all(request.as_bytes()).await.unwrap();
        let mut status = [0; 12];
        next.read_exact(&mut status).await.unwrap();
        assert_eq!(&status, b"HTTP/1.1 200");
        std::fs::remove_dir_all(&folder).unwrap();
    });
}

#[test]
fn of_too_many_requests_at_once_the_last_is_told_so() {
    run(async {
        let gateway = Gateway::bare().await;
        let gate = Arc::default();
        let mut waiting = Vec::new();
        for _ in 0..MAX_REQUESTS {
            let mut stream = connect_through(&gateway, &gate, WIDE);
            stream.write_all(HEAD.as_bytes()).await.unwrap();
            waiting.push(stream);
        }
        settle().await;
        let mut stream = connect_through(&gateway, &gate, WIDE);
        stream.write_all(HEAD.as_bytes()).await.unwrap();
        let answer = rest(&mut stream).await;
        assert!(answer.starts_with("HTTP/1.1 503 "), "{answer}");
        drop(stream);
        // Those that speak JSON are not concerned.
        let mut stream = connect_through(&gateway, &gate, WIDE);
        stream
            .write_all(b"{\"op\":\"subscribe\",\"topic\":\"/a\"}\n")
            .await
            .unwrap();
        stream.read_u8().await.unwrap();
        for stream in &mut waiting {
            stream.write_all(b"\r\n").await.unwrap();
            assert!(rest(stream).await.starts_with("HTTP/1.1 200 "));
        }
    });
}

#[test]
fn a_browser_that_takes_no_byte_of_its_answer_is_given_up() {
    run(async {
        let gateway = Gateway::bare().await;
        // The answer is longer than the pipe.
        let mut stream = connect(&gateway, 64);
        stream
            .write_all(format!("{HEAD}\r\n").as_bytes())
            .await
            .unwrap();
        settle().await;
        assert_eq!(gateway.gauges.connections(), 1);
        sleep(Duration::from_secs(11)).await;
        assert_eq!(gateway.gauges.connections(), 0);
    });
}

#[test]
fn a_peer_that_answers_pings_stays_and_is_pinged_every_fifteen_seconds() {
    run(async {
        let gateway = Gateway::bare().await;
        let mut socket = open(&gateway, WIDE).await;
        let began = Instant::now();
        for ping in 1..=240 {
            let message = socket.next().await.unwrap().unwrap();
            assert!(message.is_ping(), "{message:?}");
            socket.flush().await.unwrap();
            assert_elapsed(began, ping * PING_INTERVAL);
        }
        assert_eq!(gateway.gauges.connections(), 1);
    });
}

#[test]
fn a_peer_without_a_sign_of_life_is_closed_thirty_seconds_after_it_was_asked() {
    run(async {
        let gateway = Gateway::bare().await;
        let socket = open(&gateway, WIDE).await;
        settle().await;
        sleep(PING_INTERVAL + PONG_TIME - Duration::from_secs(1)).await;
        assert_eq!(gateway.gauges.connections(), 1);
        // The close frame is not answered either; it is waited for, and no longer than that.
        sleep(Duration::from_secs(1) + Duration::from_secs(5)).await;
        settle().await;
        assert_eq!(gateway.gauges.connections(), 0);
        drop(socket);
    });
}

/// Over a slow line a message can take longer than a pong may: its bytes are as good a sign of life.
#[test]
fn a_peer_in_the_middle_of_a_long_message_is_alive() {
    run(async {
        let gateway = Gateway::bare().await;
        let socket = open(&gateway, WIDE).await;
        let mut stream = socket.into_inner();
        let frame = json!({"op": "subscribe", "topic": "/chat/over/a/slow/line"}).to_string();
        let length = u8::try_from(frame.len()).unwrap();
        let began = Instant::now();
        let mut bytes = vec![0x81, 0x80 | length, 0, 0, 0, 0];
        bytes.extend_from_slice(frame.as_bytes());
        for byte in bytes {
            stream.write_all(&[byte]).await.unwrap();
            sleep(Duration::from_secs(1)).await;
        }
        assert!(
            began.elapsed() > PING_INTERVAL + PONG_TIME,
            "else it proves nothing"
        );
        assert_eq!(gateway.gauges.connections(), 1);
    });
}

/// A node that answers after ten minutes: meanwhile the connection reads nothing, so it sees no pong.
#[test]
fn while_the_client_is_not_read_it_need_not_show_life() {
    run(async {
        let held = Held::default();
        let mut nodes = Nodes::default();
        Node::holding(&held).attach(&mut nodes, &[Service::Pause], &[]);
        let gateway = Gateway::with(nodes).await;
        let mut socket = open(&gateway, WIDE).await;
        send(
            &mut socket,
            json!({"op": "call_service", "service": "/arm_sim/pause", "id": 1}),
        )
        .await;
        for _ in 0..60 {
            sleep(Duration::from_secs(10)).await;
            socket.flush().await.unwrap();
        }
        assert_eq!(held.count(), 1);
        held.answer();
        let answer = receive(&mut socket).await.into_text().unwrap();
        assert!(answer.contains("\"id\":1"));
        // From here on it is asked again, and answers.
        let quiet = timeout(Duration::from_secs(600), receive(&mut socket)).await;
        assert!(quiet.is_err());
        assert_eq!(gateway.gauges.connections(), 1);
    });
}

#[test]
fn a_client_that_takes_no_byte_while_responses_wait_is_disconnected() {
    run(async {
        let gateway = Gateway::bare().await;
        let mut socket = open(&gateway, 1024).await;
        send(&mut socket, json!({"op": "set_level", "level": "info"})).await;
        // Some 1.2 kB of statuses: more than the pipe holds.
        for _ in 0..20 {
            send(&mut socket, json!({"op": "subscribe", "topic": "/chat"})).await;
        }
        settle().await;
        sleep(STALL_LIMIT - Duration::from_secs(1)).await;
        assert_eq!(gateway.gauges.connections(), 1);
        sleep(Duration::from_secs(2)).await;
        assert_eq!(gateway.gauges.connections(), 0);
        drop(socket);
    });
}

#[test]
fn a_slow_client_loses_the_oldest_messages_and_no_response() {
    run(async {
        let gateway = Gateway::bare().await;
        let mut socket = open(&gateway, 1024).await;
        send(
            &mut socket,
            json!({"op": "subscribe", "topic": "/joint_states"}),
        )
        .await;
        settle().await;
        let line = format!(
            "{{\"op\":\"publish\",\"pad\":\"{}\"}}\n",
            "x".repeat(100_000)
        );
        for _ in 0..100 {
            gateway.registry.do_send(Publish {
                topic: Topic::JointStates,
                frame: line.clone().into(),
                msg: None,
            });
        }
        settle().await;
        let dropped = gateway.gauges.messages_dropped();
        assert!(
            (50..=60).contains(&dropped),
            "{dropped} of 10 MB do not fit into 4 MiB"
        );
        let unknown = json!({"op": "call_service", "service": "/nobody", "id": "last"});
        send(&mut socket, unknown).await;
        let mut messages = 0;
        loop {
            let text = receive(&mut socket).await.into_text().unwrap();
            if text.contains("last") {
                break;
            }
            assert_eq!(text.len() + 1, line.len());
            messages += 1;
        }
        assert_eq!(messages + dropped, 100);
    });
}

/// The head of a masked frame with the mask 0: so its payload goes as it is.
fn frame_head(opcode: u8, length: usize) -> Vec<u8> {
    let mut head = vec![opcode];
    if let Ok(short @ 0..126) = u8::try_from(length) {
        head.push(0x80 | short);
    } else {
        head.push(0x80 | 127);
        head.extend_from_slice(&u64::try_from(length).unwrap().to_be_bytes());
    }
    head.extend_from_slice(&[0; 4]);
    head
}

/// What the peer is told in the close frame: code and reason, behind whatever else comes.
async fn farewell(stream: &mut DuplexStream) -> (u16, String) {
    let mut bytes = Vec::new();
    stream
        .read_to_end(&mut bytes)
        .await
        .expect("an orderly end");
    let close = bytes
        .iter()
        .rposition(|byte| *byte == 0x88)
        .expect("a close frame");
    let code = u16::from_be_bytes([bytes[close + 2], bytes[close + 3]]);
    (
        code,
        String::from_utf8_lossy(&bytes[close + 4..]).into_owned(),
    )
}

/// Byte by byte within a frame; and in parts of a message, between which the peer answers every ping.
#[test]
fn a_message_that_does_not_end_is_given_up_after_a_minute() {
    run(async {
        for pongs in [false, true] {
            let gateway = Gateway::bare().await;
            let mut stream = open(&gateway, WIDE).await.into_inner();
            let (opcode, length) = if pongs {
                (0x01, 1000)
            } else {
                (0x81, 1_000_000)
            };
            let began = Instant::now();
            stream.write_all(&frame_head(opcode, length)).await.unwrap();
            stream.write_all(&[b' '; 1000]).await.unwrap();
            for _ in 0..FRAME_TIME.as_secs() - 1 {
                sleep(Duration::from_secs(1)).await;
                let bytes = if pongs {
                    frame_head(0x8a, 0)
                } else {
                    vec![b' ']
                };
                stream.write_all(&bytes).await.unwrap();
            }
            let (code, why) = farewell(&mut stream).await;
            assert_eq!(
                (code, why.contains("within a minute")),
                (1008, true),
                "{why}"
            );
            // It is noticed with the next ping at the latest.
            let time = began.elapsed();
            assert!(
                time >= FRAME_TIME && time <= FRAME_TIME + PING_INTERVAL,
                "{time:?}"
            );
            drop(stream);
            settle().await;
            assert_eq!(gateway.gauges.connections(), 0);
        }
    });
}

#[test]
fn a_message_for_which_there_is_no_room_closes_its_connection_with_a_reason() {
    run(async {
        let input = Budget::of(1024 * 1024);
        let totals = Totals {
            input: input.clone(),
            ..Totals::default()
        };
        let gateway = Gateway::within(totals, Nodes::default()).await;
        let mut modest = open(&gateway, WIDE).await;
        let mut stream = open(&gateway, WIDE).await.into_inner();
        stream
            .write_all(&frame_head(0x81, 3_000_000))
            .await
            .unwrap();
        stream.write_all(&vec![b' '; 1_000_000]).await.unwrap();
        let (code, why) = farewell(&mut stream).await;
        assert_eq!(
            (code, why.contains("try again later")),
            (1013, true),
            "{why}"
        );
        drop(stream);
        settle().await;
        assert_eq!(input.used(), 0);
        send(
            &mut modest,
            json!({"op": "call_service", "service": "/nobody", "id": 1}),
        )
        .await;
        assert!(receive(&mut modest).await.is_text());
    });
}

#[test]
fn at_the_runtimes_end_the_client_gets_what_it_is_owed_and_a_close_frame() {
    run(async {
        let gateway = Gateway::bare().await;
        let mut socket = open(&gateway, WIDE).await;
        let unknown = json!({"op": "call_service", "service": "/nobody", "id": 1});
        send(&mut socket, unknown).await;
        settle().await;
        gateway.registry.send(FinishAll).await.unwrap();
        assert!(receive(&mut socket).await.is_text());
        let Message::Close(Some(frame)) = receive(&mut socket).await else {
            panic!("no close frame");
        };
        assert_eq!(frame.code, CloseCode::Away);
        assert!(socket.next().await.is_none());
        drop(socket);
        settle().await;
        assert_eq!(gateway.gauges.connections(), 0);
    });
}

#[test]
fn a_client_that_does_not_answer_the_close_frame_is_waited_for_no_longer_than_five_seconds() {
    run(async {
        let gateway = Gateway::bare().await;
        let socket = open(&gateway, WIDE).await;
        settle().await;
        gateway.registry.send(FinishAll).await.unwrap();
        sleep(Duration::from_secs(4)).await;
        assert_eq!(gateway.gauges.connections(), 1);
        sleep(Duration::from_secs(2)).await;
        assert_eq!(gateway.gauges.connections(), 0);
        drop(socket);
    });
}

#[test]
fn a_token_that_is_not_shown_is_waited_for_five_seconds() {
    run(async {
        let gateway = Gateway::bare().await;
        let gate = Arc::new(Gate {
            token: Some(Token::new("secret").unwrap()),
            ..Gate::default()
        });
        let mut late = connect_through(&gateway, &gate, WIDE);
        late.write_all(b"{\"op\":\"auth\"").await.unwrap();
        let began = Instant::now();
        let answer = rest(&mut late).await;
        assert!(answer.contains("waited for 5 s"), "{answer}");
        assert_elapsed(began, HEAD_TIME);

        let mut client = connect_through(&gateway, &gate, WIDE);
        client
            .write_all(b"{\"op\":\"auth\",\"token\":\"secret\"}\n")
            .await
            .unwrap();
        sleep(Duration::from_secs(3600)).await;
        client.write_all(b"{\"op\":\"nonsense\"}\n").await.unwrap();
        let mut byte = [0];
        client.read_exact(&mut byte).await.unwrap();
    });
}
