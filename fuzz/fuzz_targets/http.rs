//! The first bytes of a connection, and HTTP behind them: one request, with and without a token to be shown.
//!
//! What holds: the answer is lines of JSON, or one well-formed HTTP answer of known headers, as long as it says, and then the
//! end, whatever follows the request; a file is never one from outside the report's folder; without a host, without the
//! token where there is one, nothing is given.
//!
//! Input: a byte of settings, a byte that says in which pieces the rest is sent, the rest.

#![no_main]

use std::time::Duration;

use libfuzzer_sys::fuzz_target;
use pendularm::actors::budget::Totals;
use pendularm::actors::connection::gate::Gate;
use pendularm::protocol::token::Token;
use pendularm::web::Door;
use pendularm::web::access::Access;
use pendularm::web::authority::Authority;
use pendularm_fuzz::json::Json;
use pendularm_fuzz::stage::{Stage, run};
use pendularm_fuzz::websocket;
use tokio::io::{AsyncReadExt, AsyncWriteExt, split};
use tokio::time::timeout;

const TOKEN: &str = "open-sesame";
/// The folder of the report, and what a file beside it says.
const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/report/inside");
const SECRET: &str = "to be given to nobody";
/// Longer than any file of the page.
const LONGEST: usize = 4 * 1024 * 1024;
/// Longer than anything here may take.
const LONG: Duration = Duration::from_secs(600);

const STATUSES: [u16; 11] = [101, 200, 301, 400, 403, 404, 405, 408, 426, 431, 503];
/// What an answer may have, in lower case.
const HEADERS: [&str; 17] = [
    "content-type",
    "content-length",
    "connection",
    "cache-control",
    "content-security-policy",
    "x-content-type-options",
    "referrer-policy",
    "cross-origin-resource-policy",
    "cross-origin-opener-policy",
    "x-frame-options",
    "location",
    "allow",
    "set-cookie",
    "upgrade",
    "sec-websocket-version",
    "sec-websocket-accept",
    "date",
];

fuzz_target!(|input: &[u8]| {
    let &[settings, piece, ref bytes @ ..] = input else {
        return;
    };
    let asks_token = settings & 1 != 0;
    let answer = run(converse(gate(settings), bytes, piece.max(1).into()));
    if answer.starts_with(b"HTTP/") {
        check_answer(&answer, bytes, asks_token);
    } else {
        let text = String::from_utf8(answer).expect("UTF-8");
        assert!(text.is_empty() || text.ends_with('\n'), "{text:?}");
        for line in text.lines() {
            assert!(Json::read(line).is_some(), "{line:?}");
        }
    }
});

fn gate(settings: u8) -> Gate {
    let token = (settings & 1 != 0).then(|| Token::new(TOKEN).expect("a token"));
    let named = Authority::parse("arm.example:80").expect("a host");
    let access = Access {
        token: token.clone(),
        hosts: if settings & 2 != 0 {
            vec![named]
        } else {
            Vec::new()
        },
        origins: if settings & 4 != 0 {
            vec!["null".into()]
        } else {
            Vec::new()
        },
        strict_origin: settings & 8 != 0,
    };
    Gate {
        token,
        door: Door::new(access, FOLDER.into()),
    }
}

/// Sends all of it, then the end; gives what comes up to the end.
async fn converse(gate: Gate, bytes: &[u8], piece: usize) -> Vec<u8> {
    let stage = Stage::new(gate, Totals::default()).await;
    let (mut input, mut output) = split(stage.connect(256));
    let mut answer = Vec::new();
    let talk = async {
        let send = async {
            for piece in bytes.chunks(piece) {
                if output.write_all(piece).await.is_err() {
                    return;
                }
                tokio::task::yield_now().await;
            }
            let _ = output.shutdown().await;
        };
        let receive = async {
            let _ = (&mut input)
                .take(LONGEST as u64)
                .read_to_end(&mut answer)
                .await;
        };
        tokio::join!(send, receive);
    };
    assert!(timeout(LONG, talk).await.is_ok(), "it does not end");
    assert!(answer.len() < LONGEST);
    let mut waited = 0;
    while !stage.is_empty() {
        tokio::time::sleep(Duration::from_millis(100)).await;
        waited += 1;
        assert!(
            waited < 600,
            "something outlives the client: {:?}",
            stage.gauges
        );
    }
    answer
}

fn check_answer(answer: &[u8], request: &[u8], asks_token: bool) {
    let end = answer
        .windows(4)
        .position(|window| window == b"\r\n\r\n")
        .expect("a head");
    let head = std::str::from_utf8(&answer[..end]).expect("a head is text");
    let body = &answer[end + 4..];
    let mut lines = head.split("\r\n");
    let first = lines
        .next()
        .and_then(|line| line.strip_prefix("HTTP/1.1 "))
        .expect("a status line");
    let status: u16 = first
        .get(..3)
        .and_then(|code| code.parse().ok())
        .expect("a status");
    assert!(STATUSES.contains(&status), "{head}");
    let mut length = None;
    for line in lines {
        let (name, value) = line.split_once(": ").expect("a header");
        assert!(HEADERS.contains(&&*name.to_ascii_lowercase()), "{head}");
        assert!(!value.contains(char::is_control), "{head}");
        if name.eq_ignore_ascii_case("content-length") {
            assert!(
                length
                    .replace(value.parse::<usize>().expect("a length"))
                    .is_none()
            );
        }
    }
    if status == 101 {
        let mut frames = websocket::Reader::default();
        frames.push(body);
        while frames.event().is_some() {}
    } else {
        assert_eq!(length, Some(body.len()), "{head}");
    }
    let shown = String::from_utf8_lossy(body);
    assert!(!shown.contains(SECRET), "a file from outside the report");
    if [101, 200, 301, 404].contains(&status) {
        let request = String::from_utf8_lossy(request).to_ascii_lowercase();
        assert!(request.contains("host:"), "{request:?}: {head}");
        let shows_token = request.contains("token=") || request.contains("pendularm_9095=");
        assert!(!asks_token || shows_token, "{request:?}: {head}");
    }
}
