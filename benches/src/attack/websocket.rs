//! Aimed at what WebSocket adds: pings, fragments of messages, masks, closes.

use super::Attack;
use super::script::{Client, light, publish, web_frame};
use pendularm_client::websocket::opcode::{CLOSE, CONTINUATION, PING, PONG, TEXT};

const MIB: usize = 1024 * 1024;
/// The head of a WebSocket's request behind its first line.
const UPGRADE: &[u8] =
    b"Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n\
    Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n";

pub const ATTACKS: &[Attack] = &[
    Attack::new(
        "unread-pings",
        "1 client pings without end and reads no pong",
        || Client::web().repeats_bytes(&pings(PING)).deaf().times(1),
    ),
    Attack::new("unread-pings-20", "20 clients do so", || {
        Client::web().repeats_bytes(&pings(PING)).deaf().times(20)
    }),
    Attack::new(
        "read-pings",
        "10 clients ping without end and read the pongs",
        || Client::web().repeats_bytes(&pings(PING)).times(10),
    ),
    Attack::new(
        "pongs",
        "10 clients send pongs that nobody asked for",
        pongs,
    ),
    Attack::new(
        "tiny-pieces",
        "10 clients send messages in frames of one byte",
        || {
            Client::web()
                .repeats_bytes(&in_pieces(&light("/arm_sim/pause"), &[]).repeat(64))
                .times(10)
        },
    ),
    Attack::new(
        "empty-pieces",
        "1 client sends a message that goes on in empty frames without end",
        empty_pieces,
    ),
    Attack::new("empty-pieces-20", "20 clients do so", || {
        vec![empty_pieces(); 20].concat()
    }),
    Attack::new(
        "unfinished-messages",
        "100 clients begin a message of 4 MiB and do not end it",
        unfinished,
    ),
    Attack::new(
        "long-messages",
        "20 clients send messages of 4 MiB, each over a million lines",
        || {
            let numbers = "1,\n".repeat((4 * MIB - 1024) / 3);
            Client::web()
                .advertises("/attack/long")
                .repeats(&publish(
                    "/attack/long",
                    &format!(r#"{{"data":[{numbers}1]}}"#),
                ))
                .times(20)
        },
    ),
    Attack::new(
        "pings-in-pieces",
        "10 clients put pings between the frames of a message",
        || {
            let ping = web_frame(PING, true, &[b'p'; 125]);
            Client::web()
                .repeats_bytes(&in_pieces(&light("/arm_sim/pause"), &ping).repeat(8))
                .times(10)
        },
    ),
    Attack::new(
        "masks",
        "20 clients send frames unmasked, with reserved bits, of unknown kinds, and return",
        masks,
    ),
    Attack::new(
        "closes",
        "20 clients close with a reason, send on, and return",
        closes,
    ),
    Attack::new(
        "lengths",
        "20 clients announce a frame of 2^63 bytes, and return",
        lengths,
    ),
    Attack::new(
        "handshakes",
        "20 clients open a WebSocket, call and leave, over and over",
        handshakes,
    ),
    Attack::new(
        "bad-handshakes",
        "20 clients ask for a WebSocket with wrong keys and versions, and return",
        || {
            let wrong = |from: &str, to: &str| {
                String::from_utf8_lossy(UPGRADE)
                    .replace(from, to)
                    .into_bytes()
            };
            let heads = [
                wrong("13", "8"),
                wrong("dGhl", "d"),
                wrong("websocket", "h2c"),
                wrong("Key", "Keys"),
            ];
            let client = |head: &Vec<u8>| {
                Client::http("GET /")
                    .says_bytes(head)
                    .leaves_after(20)
                    .returns()
                    .times(5)
            };
            heads.iter().flat_map(client).collect()
        },
    ),
    Attack::new(
        "unread-answers",
        "20 clients call without end and read no answer",
        || {
            Client::web()
                .floods(&light("/arm_sim/set_params"))
                .deaf()
                .times(20)
        },
    ),
];

fn pings(kind: u8) -> Vec<u8> {
    web_frame(kind, true, &[b'p'; 125]).repeat(512)
}

fn pongs() -> Vec<Client> {
    Client::web().repeats_bytes(&pings(PONG)).deaf().times(10)
}

/// The frame as a WebSocket message, a byte in each frame, with something between them.
fn in_pieces(frame: &str, between: &[u8]) -> Vec<u8> {
    let last = frame.len() - 1;
    let piece = |(at, byte): (usize, u8)| {
        let kind = if at == 0 { TEXT } else { CONTINUATION };
        [
            &web_frame(kind, at == last, &[byte])[..],
            if at == last { &[][..] } else { between },
        ]
        .concat()
    };
    frame.bytes().enumerate().flat_map(piece).collect()
}

fn empty_pieces() -> Vec<Client> {
    let begin = web_frame(TEXT, false, b"{");
    Client::web()
        .says_bytes(&begin)
        .repeats_bytes(&web_frame(CONTINUATION, false, &[]).repeat(8192))
        .deaf()
        .times(1)
}

fn unfinished() -> Vec<Client> {
    Client::web()
        .says_bytes(&web_frame(TEXT, false, &vec![b' '; 4 * MIB - 1024]))
        .times(100)
}

fn masks() -> Vec<Client> {
    let mut reserved = web_frame(TEXT, true, b"{}");
    reserved[0] |= 0x70;
    let bad: [Vec<u8>; 4] = [
        b"\x81\x02{}".to_vec(),
        reserved,
        web_frame(7, true, b"{}"),
        web_frame(CONTINUATION, true, b"{}"),
    ];
    bad.iter()
        .flat_map(|bytes| {
            Client::web()
                .says_bytes(bytes)
                .leaves_after(20)
                .returns()
                .times(5)
        })
        .collect()
}

fn closes() -> Vec<Client> {
    let close = web_frame(CLOSE, true, b"\x03\xe8the end");
    let more = web_frame(TEXT, true, light("/arm_sim/pause").as_bytes()).repeat(500);
    Client::web()
        .says(&light("/arm_sim/pause"))
        .says_bytes(&close)
        .says_bytes(&more)
        .leaves_after(20)
        .returns()
        .times(20)
}

fn lengths() -> Vec<Client> {
    Client::web()
        .says_bytes(b"\x81\xff\x7f\xff\xff\xff\xff\xff\xff\xff\0\0\0\0")
        .leaves_after(20)
        .returns()
        .times(20)
}

fn handshakes() -> Vec<Client> {
    Client::web()
        .says(&light("/arm_sim/pause"))
        .leaves_after(0)
        .returns()
        .times(20)
}
