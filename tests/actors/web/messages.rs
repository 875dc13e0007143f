//! Turns of other tasks while messages over a WebSocket are read, and pings whose pongs are not read.
//! `exchanges/memory.txt` and `exchanges/encodings.txt` have long messages.

use super::*;

const PAUSE: &str = Service::Pause.name();

/// Reading continues by itself, because the message is not a call.
#[test]
fn invalid_messages_are_read_in_turns() {
    in_virtual_time(async {
        let mut nodes = Nodes::default();
        let answer = route(|mut call: ServiceCall| call.caller.succeed(&json!({})));
        nodes.services.insert(Service::Pause, answer);
        let gateway = Gateway::with(nodes).await;
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
            // Text is a frame, and so counts itself.
            let texts = if kind == opcode::TEXT { frames } else { 0 };
            let least = (bytes.len() / TURN).max(texts / FRAMES_IN_A_TURN);
            assert!(turns >= least, "{kind}, {}: {turns}", payload.len());
        }
    });
}

/// Pings of a peer that reads no pong: fewer pongs wait for it than one write holds. When it reads, the last ping has
/// been answered.
#[test]
fn pings_whose_pongs_are_not_read_cost_next_to_nothing() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut stream = open(&gateway, 64 * 1024).await.into_stream();
        for n in 0..20_000_u32 {
            let mut ping = vec![0x89, 0x80 | 125, 0, 0, 0, 0];
            ping.extend_from_slice(&n.to_be_bytes());
            ping.resize(6 + 125, b'x');
            stream.write_all(&ping).await.unwrap();
        }
        settle().await;
        let (mut last, mut pongs) = (0, 0);
        while last != 19_999 {
            let mut pong = [0; 127];
            stream.read_exact(&mut pong).await.unwrap();
            assert_eq!(pong[..2], [0x8a, 125], "a pong");
            last = u32::from_be_bytes([pong[2], pong[3], pong[4], pong[5]]);
            pongs += 1;
        }
        assert!(pongs * 127 <= (64 + 72) * 1024, "{pongs} pongs waited");
    });
}
