//! WebSocket connections that are closed: by the peer, for an unfinished message, for the memory that they hold, and
//! at the shutdown.

use super::*;
use crate::virtual_time::Held;
use pendularm::actors::gateway::messages::FinishAll;
use pendularm_client::Error;
use tokio::time::timeout;

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

/// The close frame to the peer: code and reason, after all other frames.
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

/// Byte by byte within a frame; and in parts of a message, between which the peer sends pongs.
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
            assert_elapsed(began, FRAME_TIME);
            drop(stream);
            settle().await;
            assert_eq!(gateway.gauges.connections(), 0);
        }
    });
}

/// In the first case one read brings a message, a ping, and the first bytes of a message that does not end: its minute
/// begins with the next byte. In the second case a message comes alone, in parts. After it the client may be silent.
#[test]
fn a_message_that_begins_behind_another_has_its_minute_too() {
    in_virtual_time(async {
        let message = json!({"op": "unsubscribe", "topic": "/t"}).to_string();
        let (begin, end) = message.as_bytes().split_at(5);
        let mut whole = [frame_head(0x01, begin.len()), begin.to_vec()].concat();
        whole.extend(
            [
                frame_head(0x89, 0),
                frame_head(0x80, end.len()),
                end.to_vec(),
            ]
            .concat(),
        );
        for (behind, is_late) in [
            (frame_head(0x81, 70_000), true),
            (Vec::new(), false),
            (frame_head(0x89, 0), false),
        ] {
            let gateway = Gateway::bare().await;
            let mut socket = open(&gateway, WIDE).await;
            let bytes = [whole.as_slice(), &behind].concat();
            socket.stream().write_all(&bytes).await.unwrap();
            let began = Instant::now();
            let second = Duration::from_secs(1);
            sleep(second).await;
            if is_late {
                socket.stream().write_all(b" ").await.unwrap();
            }
            let answered = async { while let Ok(Event::Pong(_)) = socket.next_event().await {} };
            let ended = timeout(2 * FRAME_TIME, answered).await;
            assert_eq!(ended.is_ok(), is_late, "{behind:?}");
            if is_late {
                assert_elapsed(began + second, FRAME_TIME);
            }
        }
    });
}

/// Its first part has come with the last byte of the message before it.
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
        let quiet = timeout(Duration::from_secs(90), receive(&mut socket)).await;
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

/// Its pieces of another message grow old meanwhile, and are forgotten.
#[test]
fn a_message_has_its_minute_whatever_is_forgotten_meanwhile() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut socket = open(&gateway, WIDE).await;
        let piece = json!({"op": "fragment", "id": 1, "data": "{", "num": 0, "total": 2});
        send(&mut socket, piece).await;
        sleep(FRAME_TIME / 2).await;
        let mut begins = Vec::new();
        append(&mut begins, opcode::TEXT, [0; 4], b"{");
        socket.stream().write_all(&begins).await.unwrap();
        let began = Instant::now();
        assert!(matches!(
            socket.next_event().await,
            Ok(Event::Close(..)) | Err(_)
        ));
        assert_elapsed(began, FRAME_TIME);
    });
}
