//! Attacks on WebSocket: pings, fragments of messages, masks, closes.

use super::Attack;
use super::script::{Client, LONG, light, publish, web_frame};
use pendularm_client::websocket::opcode::{CLOSE, CONTINUATION, PING, TEXT};

pub const ATTACKS: &[Attack] = &[
    Attack::new(
        "unread-pings",
        "20 clients ping without end and read no pong",
        || {
            Client::web()
                .repeats_bytes(&ping().repeat(512))
                .deaf()
                .times(20)
        },
    ),
    Attack::new(
        "read-pings",
        "10 clients ping without end and read the pongs",
        || Client::web().repeats_bytes(&ping().repeat(512)).times(10),
    ),
    Attack::new(
        "pings-in-pieces",
        "10 clients send messages in frames of one byte, and a ping between any two",
        || {
            let frame = light("/arm_sim/pause");
            let piece = |(at, byte): (usize, u8)| {
                let kind = if at == 0 { TEXT } else { CONTINUATION };
                [web_frame(kind, at == frame.len() - 1, &[byte]), ping()].concat()
            };
            let message: Vec<u8> = frame.bytes().enumerate().flat_map(piece).collect();
            Client::web().repeats_bytes(&message.repeat(8)).times(10)
        },
    ),
    Attack::new(
        "empty-pieces",
        "20 clients send a message that goes on in empty frames without end",
        || {
            Client::web()
                .says_bytes(&web_frame(TEXT, false, b"{"))
                .repeats_bytes(&web_frame(CONTINUATION, false, &[]).repeat(8192))
                .deaf()
                .times(20)
        },
    ),
    Attack::new(
        "unfinished-messages",
        "100 clients begin a message of 4 MiB and do not end it",
        || {
            Client::web()
                .says_bytes(&web_frame(TEXT, false, &vec![b' '; LONG]))
                .times(100)
        },
    ),
    Attack::new(
        "long-messages",
        "20 clients send messages of 4 MiB, each over a million lines",
        || {
            let msg = format!(r#"{{"data":[{}1]}}"#, "1,\n".repeat(LONG / 3));
            Client::web()
                .advertises("/attack/long")
                .repeats(&publish("/attack/long", &msg))
                .times(20)
        },
    ),
    Attack::new(
        "violations",
        "24 clients send frames unmasked, reserved, unknown, too long or behind a close, and return",
        violations,
    ),
    Attack::new(
        "handshakes",
        "20 clients open a WebSocket, call and leave, over and over",
        || {
            Client::web()
                .says(&light("/arm_sim/pause"))
                .leaves_after(0)
                .returns()
                .times(20)
        },
    ),
];

fn ping() -> Vec<u8> {
    web_frame(PING, true, &[b'p'; 125])
}

fn violations() -> Vec<Client> {
    let mut reserved = web_frame(TEXT, true, b"{}");
    reserved[0] |= 0x70;
    let close = web_frame(CLOSE, true, b"\x03\xe8the end");
    let more = web_frame(TEXT, true, light("/arm_sim/pause").as_bytes()).repeat(500);
    let wrong = [
        b"\x81\x02{}".to_vec(),
        reserved,
        web_frame(7, true, b"{}"),
        web_frame(CONTINUATION, true, b"{}"),
        // A length of 2^63 - 1.
        b"\x81\xff\x7f\xff\xff\xff\xff\xff\xff\xff\0\0\0\0".to_vec(),
        [close, more].concat(),
    ];
    let client = |bytes: &Vec<u8>| {
        Client::web()
            .says_bytes(bytes)
            .leaves_after(20)
            .returns()
            .times(4)
    };
    wrong.iter().flat_map(client).collect()
}
