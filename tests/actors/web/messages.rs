//! Messages over a WebSocket: the cost of a long one, and the forms of messages.

use super::*;
use pendularm::actors::resources::long_work::{PLACES, WorkKind, WorkPermit};
use tokio::time::timeout;

const PAUSE: &str = Service::Pause.name();
/// A gateway whose `/arm_sim/pause` answers at once.
async fn pausing_gateway() -> Gateway {
    let mut nodes = Nodes::default();
    Node::answering().attach(&mut nodes, &[Service::Pause], &[]);
    Gateway::with(nodes).await
}

/// A message has one permit while it arrives, for any fragmentation.
#[test]
fn a_long_message_of_a_websocket_has_room_while_it_is_there() {
    const LONG: usize = 3 << 20;
    in_virtual_time(async {
        let memory = Memory::of(1, 1 << 20);
        let gateway = Gateway::within(memory.clone(), Nodes::default()).await;
        let mut socket = open(&gateway, WIDE).await;
        for _ in 0..2 {
            let long =
                json!({"op": "publish", "topic": "/nobody", "msg": {"data": "x".repeat(LONG)}});
            let mut bytes = Vec::new();
            append(
                &mut bytes,
                LAST | opcode::TEXT,
                [0; 4],
                long.to_string().as_bytes(),
            );
            let last = bytes.split_off(LONG);
            socket.stream().write_all(&bytes).await.unwrap();
            settle().await;
            assert_eq!(memory.taken(), 1);
            socket.stream().write_all(&last).await.unwrap();
            settle().await;
            assert_eq!(memory.taken(), 0);
        }
        // White space is no frame, and keeps no memory.
        let mut bytes = Vec::new();
        append(
            &mut bytes,
            LAST | opcode::TEXT,
            [0; 4],
            " ".repeat(LONG).as_bytes(),
        );
        socket.stream().write_all(&bytes).await.unwrap();
        settle().await;
        assert_eq!(memory.taken(), 0);
    });
}

/// A long message is read on another thread. Here all places of such threads are taken, and another client is served meanwhile.
#[test]
fn a_long_message_is_read_on_another_thread() {
    const LONG: usize = 4 << 20;
    in_virtual_time(async {
        let gateway = pausing_gateway().await;
        let light = json!({"op": "call_service", "service": PAUSE, "id": 1});
        let call = light.to_string();
        let lines = "\n".repeat(LONG - call.len());
        let numbers = "1,\n".repeat(LONG / 3 - 3);
        for message in [
            format!("{lines}{call}"),
            format!("{call}{lines}"),
            format!("[{numbers}"),
            format!("{{\"d\":[{numbers}}}"),
        ] {
            let mut places = Vec::new();
            for _ in 0..PLACES {
                places.push(WorkPermit::take(WorkKind::Long).await);
            }
            let mut socket = open(&gateway, WIDE).await;
            let mut bytes = Vec::new();
            append(&mut bytes, LAST | opcode::TEXT, [0; 4], message.as_bytes());
            socket.stream().write_all(&bytes).await.unwrap();
            if !message.contains(&call) {
                send(&mut socket, light.clone()).await;
            }
            settle().await;
            let mut other = open(&gateway, WIDE).await;
            assert_eq!(other.call(PAUSE, json!({})).await["result"], true);
            let early = timeout(Duration::from_secs(1), receive_text(&mut socket)).await;
            assert!(early.is_err(), "{early:?}");
            drop(places);
            let answer = receive_text(&mut socket).await;
            assert!(answer.contains(r#""result":true"#), "{answer}");
        }
    });
}

/// Reading continues by itself, because the message is not a call.
#[test]
fn invalid_messages_are_read_in_turns() {
    in_virtual_time(async {
        let gateway = pausing_gateway().await;
        for (kind, payload, frames) in [
            (opcode::PONG, &[b'p'; 125][..], 30_000),
            (opcode::PING, &[b'p'; 125], 30_000),
            (opcode::PONG, &[], 700_000),
            (opcode::PING, &[], 700_000),
            (opcode::TEXT, &[], 700_000),
        ] {
            let mut socket = open(&gateway, WIDE).await;
            let mut bytes = Vec::new();
            for _ in 0..frames {
                append(&mut bytes, LAST | kind, [0; 4], payload);
            }
            let (turns, answer) = turns_of_others(async {
                socket.stream().write_all(&bytes).await.unwrap();
                socket.call(PAUSE, json!({})).await
            })
            .await;
            assert_eq!(answer["result"], true, "{answer}");
            assert!(
                turns >= bytes.len() / TURN,
                "{kind}, {}: {turns} turns",
                payload.len()
            );
        }
    });
}
