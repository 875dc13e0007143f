//! Attacks on admission: tokens, requests, the page and the report.

use std::time::Duration;

use super::Attack;
use super::script::{Client, KIB, each, filler};

/// The end of a head.
const END: &[u8] = b"Connection: close\r\n\r\n";
/// The folder of the report, below the folder in which the program is started.
pub const REPORT: &str = "report";

pub const ATTACKS: &[Attack] = &[
    Attack::new(
        "silent-before-token",
        "200 clients connect, send nothing and reconnect; a client with the token connects",
        || Client::tcp().returns().times(200),
    )
    .locked(),
    Attack::new(
        "guesses",
        "100 clients send wrong tokens, read the refusal and reconnect",
        || {
            each(0..100, |k| {
                let token = format!("a-token-that-somebody-guesses-{k:08}");
                Client::tcp()
                    .says(&format!(r#"{{"op":"auth","token":"{token}"}}"#))
                    .returns()
            })
        },
    )
    .locked(),
    Attack::new(
        "slow-heads",
        "200 clients send the head of a request at a line a second",
        || {
            Client::http("GET /")
                .repeats_bytes(b"X-Slow: 1\r\n")
                .drips(11, Duration::from_secs(1))
                .returns()
                .times(200)
        },
    ),
    Attack::new(
        "refused-requests",
        "25 clients send requests that are refused, short and long ones, and reconnect",
        refused_requests,
    ),
    Attack::new(
        "pages",
        "50 clients ask for the page, read nothing, and return",
        || {
            Client::http("GET /")
                .says_bytes(END)
                .deaf()
                .leaves_after(50)
                .returns()
                .times(50)
        },
    ),
    Attack::new(
        "report-readers",
        "64 clients read 100 bytes of a report's file of 3.9 MB ten times a second",
        || {
            Client::http("GET /report/large.csv")
                .says_bytes(END)
                .sips(100)
                .returns()
                .times(64)
        },
    )
    .with(&["--report", REPORT])
    .holds(),
];

/// A foreign host, a foreign origin, a wrong version of WebSocket, a head that is too long, and one of too many lines.
fn refused_requests() -> Vec<Client> {
    let web = |origin: &str, version: u8| {
        format!(
            "Origin: {origin}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
             Sec-WebSocket-Version: {version}\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
        )
    };
    let heads = [
        "Host: evil.example\r\n".to_owned(),
        web("https://evil.example", 13),
        web("null", 8),
        format!("X-Long: {}\r\n", filler(16 * KIB)),
        "X-Many: 1\r\n".repeat(100),
    ];
    let client = |head: &String| {
        Client::http("GET /")
            .says_bytes(head.as_bytes())
            .says_bytes(END)
            .returns()
            .times(5)
    };
    heads.iter().flat_map(client).collect()
}
