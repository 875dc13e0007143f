//! Turns of other tasks while messages over a WebSocket are read. `exchanges/memory.txt` and `exchanges/encodings.txt`
//! have long messages.

use super::*;

const PAUSE: &str = Service::Pause.name();

/// Reading continues by itself, because the message is not a call.
#[test]
fn invalid_messages_are_read_in_turns() {
    in_virtual_time(async {
        let mut nodes = Nodes::default();
        Node::answering().attach(&mut nodes, &[Service::Pause], &[]);
        let gateway = Gateway::with(nodes).await;
        // With the most frames of a turn, a ping is answered in its own write, even if it is short.
        for (kind, payload, frames, most) in [
            (opcode::PONG, &[b'p'; 125][..], 30_000, 32),
            (opcode::PING, &[b'p'; 125], 30_000, 32),
            (opcode::PONG, &[], 30_000, 32),
            (opcode::PING, &[], 30_000, 32),
            (opcode::TEXT, &[], 700_000, TURN / 6),
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
                turns >= frames / most,
                "{kind}, {}: {turns} turns",
                payload.len()
            );
        }
    });
}
