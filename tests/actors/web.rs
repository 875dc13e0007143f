//! HTTP and WebSocket where time matters: heads that do not come, peers that show no sign of life, clients that do not read.
//!
//! **Invariant:** virtual time and in-memory pipes only; a time that is asserted is exact to the timers' grain.

#![cfg(feature = "web")]
use std::cell::Cell;
use std::net::SocketAddr;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, Held, Node, WIDE, assert_elapsed, settle};
use bytes::Bytes;
use pendularm::actors::gateway::connection::Connection;
use pendularm::actors::gateway::connection::admission::{Admission, MAX_HEADS};
use pendularm::actors::gateway::limits::{FRAME_TIME, STALL_LIMIT};
use pendularm::actors::gateway::messages::{FinishAll, Publish};
use pendularm::actors::gateway::registry::Nodes;
use pendularm::actors::resources::budget::Memory;
use pendularm::protocol::catalog::{Service, Topic};
use pendularm::web::access::Access;
use pendularm::web::{MAX_FILES_TOTAL, MAX_REQUESTS, Site};
use pendularm_client::Error;
use pendularm_client::codec::Event;
use pendularm_client::pipe::Client;
use pendularm_client::websocket::{LAST, append, opcode};
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream, duplex};
use tokio::time::{Instant, sleep, timeout};

const HEAD: &str = "GET / HTTP/1.1\r\nHost: 127.0.0.1:9095\r\n";
/// From the first bytes to the end of the head, and to the token.
const HEAD_TIME: Duration = Duration::from_secs(5);
const PING_INTERVAL: Duration = Duration::from_secs(15);
const PONG_TIME: Duration = Duration::from_secs(30);

/// The client's end of a new connection.
fn connect(gateway: &Gateway, room: usize) -> DuplexStream {
    connect_through(gateway, &Arc::default(), room)
}

/// The same, on conditions that are shared with others.
fn connect_through(gateway: &Gateway, admission: &Arc<Admission>, room: usize) -> DuplexStream {
    let (ours, theirs) = duplex(room);
    let (registry, gauges) = (gateway.registry.clone(), Arc::clone(&gateway.gauges));
    let local = SocketAddr::from(([127, 0, 0, 1], 9095));
    Connection::start_with(Arc::clone(admission), local, theirs, registry, gauges);
    ours
}

async fn open(gateway: &Gateway, room: usize) -> Client<DuplexStream> {
    let stream = connect(gateway, room);
    Client::web_on(stream, Duration::from_secs(3600), "127.0.0.1:9095", "/").await
}

async fn send(socket: &mut Client<DuplexStream>, frame: Value) {
    socket.send(&frame).await;
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
async fn receive(socket: &mut Client<DuplexStream>) -> Event {
    loop {
        match socket.next_event().await.expect("a message") {
            Event::Ping(_) => {}
            message => return message,
        }
    }
}

/// The same, which must be a text.
async fn receive_text(socket: &mut Client<DuplexStream>) -> String {
    match receive(socket).await {
        Event::Text(text) => text,
        other => panic!("{other:?} instead of a text"),
    }
}

/// The buffer that a long message is read into stays with the connection, so it stays charged.
#[test]
fn the_longest_message_of_a_websocket_counts_while_it_is_open() {
    const LONG: usize = 3 << 20;
    in_virtual_time(async {
        let memory = Memory::default();
        let gateway = Gateway::within(memory.clone(), Nodes::default()).await;
        let mut socket = open(&gateway, WIDE).await;
        settle().await;
        let before = memory.held();
        let long = json!({"op": "publish", "topic": "/nobody", "msg": {"data": "x".repeat(LONG)}});
        send(&mut socket, long).await;
        send(&mut socket, json!({"op": "set_level", "level": "none"})).await;
        settle().await;
        let held = memory.held() - before;
        assert!((LONG..2 * LONG).contains(&held), "{held}");
        drop(socket);
        sleep(Duration::from_secs(60)).await;
        assert_eq!(memory.held(), 0);
    });
}

/// It has come up to its last byte, so that only what is done with a whole message is counted, not its coming.
#[test]
fn a_long_message_is_looked_at_in_turns() {
    const LONG: usize = 4 << 20;
    /// Bytes of a turn.
    const TURN: usize = 64 * 1024;
    in_virtual_time(async {
        let mut nodes = Nodes::default();
        let node = Node {
            on_call: Box::new(|mut call| call.caller.succeed(&json!({}))),
            ..Node::default()
        };
        node.attach(&mut nodes, &[Service::Pause], &[]);
        let gateway = Gateway::with(nodes).await;
        let light = json!({"op": "call_service", "service": "/arm_sim/pause", "id": 1});
        let call = light.to_string();
        let lines = "\n".repeat(LONG - call.len());
        let numbers = "1,\n".repeat(LONG / 3 - 3);
        for message in [
            format!("{lines}{call}"),
            format!("{call}{lines}"),
            format!("[{numbers}"),
            // No frame: that would be read by another thread, however many turns others have meanwhile.
            format!("{{\"d\":[{numbers}}}"),
        ] {
            let mut socket = open(&gateway, WIDE).await;
            let mut bytes = Vec::new();
            append(&mut bytes, LAST | opcode::TEXT, [0; 4], message.as_bytes());
            let last = bytes.pop().unwrap();
            socket.stream().write_all(&bytes).await.unwrap();
            settle().await;
            let turns = Rc::new(Cell::new(0));
            let counted = Rc::clone(&turns);
            let others = actix_rt::spawn(async move {
                loop {
                    counted.set(counted.get() + 1);
                    tokio::task::yield_now().await;
                }
            });
            socket.stream().write_all(&[last]).await.unwrap();
            if !message.contains(&call) {
                send(&mut socket, light.clone()).await;
            }
            let answer = receive_text(&mut socket).await;
            others.abort();
            assert!(answer.contains(r#""result":true"#), "{answer}");
            let turns = turns.get();
            assert!(turns >= message.len() / TURN, "{turns} turns");
        }
    });
}

#[test]
fn a_head_that_does_not_come_is_given_up_after_five_seconds() {
    in_virtual_time(async {
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
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut silent = connect(&gateway, WIDE);
        let mut begun = connect(&gateway, WIDE);
        begun.write_all(b"GE").await.unwrap();
        let began = Instant::now();
        let answer = rest(&mut begun).await;
        assert!(answer.contains("\"level\":\"error\""), "{answer}");
        assert_elapsed(began, HEAD_TIME);
        // A stream that can only become JSON, or BSON, has more time: a frame's.
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

/// Two of the longest files are on their way to clients that don't take them: the older one gives way to a third, and the page is not
/// concerned.
#[test]
fn files_of_a_report_that_are_being_sent_have_a_total() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let folder = std::env::temp_dir().join(format!("pendularm-files-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        // It has a length, and no content on the disk.
        let file = std::fs::File::create(folder.join("a.csv")).unwrap();
        file.set_len(MAX_FILES_TOTAL / 2 - 100_000).unwrap();
        let site = Site::new(Access::default(), folder.clone());
        let admission = Arc::new(Admission {
            token: None,
            site,
            ..Admission::default()
        });
        let request = HEAD.replace("GET /", "GET /report/a.csv") + "\r\n";
        let mut deaf = Vec::new();
        for _ in 0..2 {
            let mut stream = connect_through(&gateway, &admission, 1024);
            stream.write_all(request.as_bytes()).await.unwrap();
            assert_eq!(stream.read_u8().await.unwrap(), b'H');
            deaf.push(stream);
        }
        let mut page = connect_through(&gateway, &admission, WIDE);
        page.write_all(format!("{HEAD}\r\n").as_bytes())
            .await
            .unwrap();
        assert!(rest(&mut page).await.starts_with("HTTP/1.1 200 "));
        let mut late = connect_through(&gateway, &admission, WIDE);
        late.write_all(request.as_bytes()).await.unwrap();
        let length = usize::try_from(MAX_FILES_TOTAL / 2 - 100_000).unwrap();
        let answer = rest(&mut late).await;
        assert!(answer.starts_with("HTTP/1.1 200 "));
        assert!(answer.len() > length, "it came whole");
        let mut newer = deaf.pop().unwrap();
        assert!(
            rest(&mut deaf[0]).await.len() < length,
            "the oldest gave way"
        );
        assert!(rest(&mut newer).await.len() > length, "and no other");
        std::fs::remove_dir_all(&folder).unwrap();
    });
}

/// Clients that take no byte of their answers keep nobody from one, nor do those that don't get to the end of their heads.
#[test]
fn of_too_many_requests_at_once_the_oldest_makes_room() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let admission = Arc::default();
        let request = format!("{HEAD}\r\n");
        let mut begun = Vec::new();
        for _ in 0..=MAX_HEADS {
            let mut stream = connect_through(&gateway, &admission, WIDE);
            stream.write_all(HEAD.as_bytes()).await.unwrap();
            begun.push(stream);
        }
        let told = rest(&mut begun.remove(0)).await;
        assert!(told.starts_with("HTTP/1.1 408 "), "{told}");
        // The page is longer than the pipe.
        let mut deaf = Vec::new();
        for _ in 0..MAX_REQUESTS {
            let mut stream = connect_through(&gateway, &admission, 512);
            stream.write_all(request.as_bytes()).await.unwrap();
            deaf.push(stream);
        }
        settle().await;
        let mut stream = connect_through(&gateway, &admission, WIDE);
        stream.write_all(request.as_bytes()).await.unwrap();
        let page = rest(&mut stream).await;
        assert!(page.starts_with("HTTP/1.1 200 "), "{page}");
        drop(stream);
        // One of them has made room, the oldest; the others get all of it as soon as they read.
        for (number, mut stream) in deaf.into_iter().enumerate() {
            let whole = rest(&mut stream).await == page;
            assert_eq!(whole, number > 0, "{number}");
        }
        for mut stream in begun {
            stream.write_all(b"\r\n").await.unwrap();
            assert_eq!(rest(&mut stream).await, page);
        }
    });
}

#[test]
fn a_browser_that_takes_no_byte_of_its_answer_is_given_up() {
    in_virtual_time(async {
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
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut socket = open(&gateway, WIDE).await;
        let began = Instant::now();
        for ping in 1..=240 {
            let message = socket.next_event().await.unwrap();
            assert!(matches!(message, Event::Ping(_)), "{message:?}");
            assert_elapsed(began, ping * PING_INTERVAL);
        }
        assert_eq!(gateway.gauges.connections(), 1);
    });
}

#[test]
fn a_peer_without_a_sign_of_life_is_closed_thirty_seconds_after_it_was_asked() {
    in_virtual_time(async {
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
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let socket = open(&gateway, WIDE).await;
        let mut stream = socket.into_stream();
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
    in_virtual_time(async {
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
        sleep(Duration::from_secs(600)).await;
        assert_eq!(held.count(), 1);
        held.answer();
        let answer = receive_text(&mut socket).await;
        assert!(answer.contains("\"id\":1"));
        // From here on it is asked again, and answers.
        let quiet = timeout(Duration::from_secs(600), receive(&mut socket)).await;
        assert!(quiet.is_err());
        assert_eq!(gateway.gauges.connections(), 1);
    });
}

/// With its queue full no frame of it is performed, but its close is seen all the same.
#[test]
fn a_peer_that_closes_while_its_queue_is_full_is_gone_at_once() {
    in_virtual_time(async {
        let held = Held::default();
        let mut nodes = Nodes::default();
        Node::holding(&held).attach(&mut nodes, &[Service::IntegrationStep], &[]);
        let gateway = Gateway::with(nodes).await;
        let mut socket = open(&gateway, WIDE).await;
        let service = Service::IntegrationStep.name();
        for n in 0..30 {
            let call = json!({"op": "call_service", "service": service, "id": n});
            send(&mut socket, call).await;
        }
        settle().await;
        // It is alive all the while.
        let quiet = timeout(2 * (PING_INTERVAL + PONG_TIME), receive(&mut socket)).await;
        assert!(quiet.is_err());
        assert_eq!(gateway.gauges.connections(), 1);
        let began = Instant::now();
        socket.close(1000, "").await;
        while socket.next_event().await.is_ok() {}
        settle().await;
        assert_elapsed(began, Duration::from_millis(10));
        assert_eq!(gateway.gauges.connections(), 0);
        assert!(held.take().is_gone(), "it need not go on");
        assert_eq!(held.count(), 0, "the next one is not begun");
    });
}

#[test]
fn a_client_that_takes_no_byte_while_responses_wait_is_disconnected() {
    in_virtual_time(async {
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
fn a_client_that_takes_a_little_at_a_time_is_borne_with() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut socket = open(&gateway, 1024).await;
        let id = "x".repeat(60_000);
        let unknown = json!({"op": "call_service", "service": "/nobody", "id": id});
        send(&mut socket, unknown).await;
        // For more than twice as long as one that takes nothing is borne with, within one write of ours.
        let mut some = [0; 1024];
        for _ in 0..50 {
            sleep(Duration::from_secs(1)).await;
            socket.stream().read_exact(&mut some).await.unwrap();
        }
        assert_eq!(gateway.gauges.connections(), 1);
        sleep(STALL_LIMIT + Duration::from_secs(1)).await;
        assert_eq!(gateway.gauges.connections(), 0);
    });
}

#[test]
fn a_slow_client_loses_the_oldest_messages_and_no_response() {
    in_virtual_time(async {
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
                frame: Bytes::from(line.clone()).into(),
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
            let text = receive_text(&mut socket).await;
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

/// The close frame that the peer is sent: code and reason, behind whatever else comes.
async fn close_reason(stream: &mut DuplexStream) -> (u16, String) {
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
    in_virtual_time(async {
        for pongs in [false, true] {
            let gateway = Gateway::bare().await;
            let mut stream = open(&gateway, WIDE).await.into_stream();
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
            let (code, why) = close_reason(&mut stream).await;
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

/// Its first part has come with the last byte of the message before it.
#[test]
fn a_message_that_begins_behind_another_is_given_up_after_a_minute_too() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut stream = open(&gateway, WIDE).await.into_stream();
        let whole = br#"{"op":"advertise","topic":"/t","type":"std_msgs/msg/String"}"#;
        let bytes = [
            frame_head(0x81, whole.len()),
            whole.to_vec(),
            frame_head(0x01, 1000),
            vec![b' '; 1000],
        ];
        let began = Instant::now();
        stream.write_all(&bytes.concat()).await.unwrap();
        for _ in 0..FRAME_TIME.as_secs() - 1 {
            sleep(Duration::from_secs(1)).await;
            stream.write_all(&frame_head(0x8a, 0)).await.unwrap();
        }
        let (code, why) = close_reason(&mut stream).await;
        assert_eq!(code, 1008, "{why}");
        let time = began.elapsed();
        assert!(time <= FRAME_TIME + PING_INTERVAL, "{time:?}");
    });
}

#[test]
fn a_peer_that_holds_most_is_closed_with_a_reason() {
    in_virtual_time(async {
        let memory = Memory::of(4 * 1024 * 1024);
        let gateway = Gateway::within(memory.clone(), Nodes::default()).await;
        let mut modest = open(&gateway, WIDE).await;
        let mut hog = open(&gateway, WIDE).await;
        // Calls that nobody answers, under long ids; read as soon as they come.
        let mut provider = open(&gateway, WIDE).await;
        let advertise = json!({"op": "advertise_service", "service": "/s"});
        send(&mut provider, advertise).await;
        settle().await;
        let id = "x".repeat(100_000);
        for _ in 0..60 {
            let call = json!({"op": "call_service", "service": "/s", "id": id, "timeout": 86_400});
            let mut bytes = Vec::new();
            append(
                &mut bytes,
                LAST | opcode::TEXT,
                [0; 4],
                call.to_string().as_bytes(),
            );
            // It may have been closed already.
            let _ = hog.stream().write_all(&bytes).await;
        }
        let (code, why) = close_reason(&mut hog.into_stream()).await;
        assert_eq!(code, 1013);
        assert!(
            why.starts_with("memory: this connection held the most"),
            "{why}"
        );
        settle().await;
        assert_eq!((memory.cut_off(), gateway.gauges.connections()), (1, 2));
        let call = json!({"op": "call_service", "service": "/nobody", "id": 1});
        send(&mut modest, call).await;
        receive_text(&mut modest).await;
        drop((modest, provider));
        settle().await;
        assert_eq!(memory.held(), 0);
    });
}

/// Pings of a peer that reads no pong: what waits for it stays within a write of ours, and when it reads, the last of them has been answered.
#[test]
fn pings_whose_pongs_are_not_read_cost_next_to_nothing() {
    in_virtual_time(async {
        let memory = Memory::default();
        let gateway = Gateway::within(memory.clone(), Nodes::default()).await;
        let mut stream = open(&gateway, 64 * 1024).await.into_stream();
        let before = memory.held();
        let mut most = 0;
        for n in 0..20_000_u32 {
            let mut ping = vec![0x89, 0x80 | 125, 0, 0, 0, 0];
            ping.extend_from_slice(&n.to_be_bytes());
            ping.resize(6 + 125, b'x');
            stream.write_all(&ping).await.unwrap();
            most = most.max(memory.held() - before);
        }
        settle().await;
        // A buffer for what is read, and one of 128 KiB, which may have grown to twice that, for what is written.
        assert!((128 * 1024..1024 * 1024).contains(&most), "{most}");
        let mut last = 0;
        while last != 19_999 {
            let mut pong = [0; 127];
            stream.read_exact(&mut pong).await.unwrap();
            assert_eq!(pong[..2], [0x8a, 125], "a pong");
            last = u32::from_be_bytes([pong[2], pong[3], pong[4], pong[5]]);
        }
    });
}

#[test]
fn at_the_runtimes_end_the_client_gets_what_it_is_owed_and_a_close_frame() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut socket = open(&gateway, WIDE).await;
        let unknown = json!({"op": "call_service", "service": "/nobody", "id": 1});
        send(&mut socket, unknown).await;
        settle().await;
        gateway.registry.send(FinishAll).await.unwrap();
        receive_text(&mut socket).await;
        let Event::Close(Some(code), _) = receive(&mut socket).await else {
            panic!("no close frame");
        };
        assert_eq!(code, 1001);
        socket.close(code, "").await;
        let end = socket.next_event().await;
        assert!(matches!(end, Err(Error::Ended)), "{end:?}");
        drop(socket);
        settle().await;
        assert_eq!(gateway.gauges.connections(), 0);
    });
}

#[test]
fn a_client_that_does_not_answer_the_close_frame_is_waited_for_no_longer_than_five_seconds() {
    in_virtual_time(async {
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
fn a_message_comes_as_cbor_or_as_cdr_in_cbor_as_each_subscriber_wants_it() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut talker, mut plain) = (gateway.connect(WIDE), open(&gateway, WIDE).await);
        let mut raw = open(&gateway, WIDE).await;
        for (socket, compression) in [(&mut plain, "cbor"), (&mut raw, "cbor-raw")] {
            let subscribe = json!({"op": "subscribe", "topic": "/t", "type": "std_msgs/String", "compression": compression});
            send(socket, subscribe).await;
        }
        settle().await;
        talker
            .send(json!({"op": "advertise", "topic": "/t", "type": "std_msgs/String"}))
            .await;
        talker
            .send(json!({"op": "publish", "topic": "/t", "msg": {"data": "abc"}}))
            .await;
        let holds = |message: &Event, part: &[u8]| matches!(message, Event::Binary(bytes) if bytes.windows(part.len()).any(|one| one == part));
        // A map of one text, and a string in CDR: little-endian, its length with the zero behind it.
        let (as_cbor, as_cdr) = (b"\xa1\x64data\x63abc", b"\0\x01\0\0\x04\0\0\0abc\0");
        let (plain, raw) = (receive(&mut plain).await, receive(&mut raw).await);
        assert!(
            holds(&plain, as_cbor) && !holds(&plain, as_cdr),
            "{plain:?}"
        );
        assert!(holds(&raw, as_cdr) && !holds(&raw, as_cbor), "{raw:?}");
    });
}
