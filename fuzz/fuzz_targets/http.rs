//! The first bytes of a connection, and HTTP after them, with and without a token.
//!
//! Asserted: the answer is lines of JSON, or well-formed HTTP answers with known headers and the announced length, and
//! then the end. Every file is from the report's folder. An input without the token gets no page, no WebSocket, and at
//! most one line of JSON. `tests/protocol` and `tests/actors` test the rules of admission.
//!
//! Input: a byte of settings, a byte that selects the pieces, and the bytes to send.

#![no_main]

use std::time::Duration;

use libfuzzer_sys::fuzz_target;
use pendularm::actors::gateway::connection::admission::Admission;
use pendularm::actors::resources::memory::Memory;
use pendularm::address::Authority;
use pendularm::protocol::op::token::Token;
use pendularm::web::Site;
use pendularm::web::access::Access;
use pendularm_client::codec::{Codec, Framing};
use pendularm_fuzz::json::Json;
use pendularm_fuzz::limits::{Allowance, hold};
use pendularm_fuzz::stage::{Stage, run};
use tokio::io::{AsyncReadExt, AsyncWriteExt, split};
use tokio::time::timeout;

const TOKEN: &str = "open-sesame-once-more";
/// The folder of the report, and the content of a file outside of it.
const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/report/inside");
const SECRET: &str = "to be given to nobody";
/// A page is long, and a connection has its buffers.
const WHOLE: Allowance = Allowance {
    time: Duration::from_secs(1),
    time_per_byte: Duration::from_micros(20),
    memory: 16 << 20,
    memory_per_byte: 1 << 10,
};
/// Longer than any file of the page.
const LONGEST: usize = 4 * 1024 * 1024;
/// Longer than any wait of this target.
const LONG: Duration = Duration::from_secs(600);

const STATUSES: [u16; 11] = [101, 200, 301, 400, 403, 404, 405, 408, 426, 431, 503];
/// Headers that an answer may have, in lower case.
const HEADERS: [&str; 19] = [
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
    "vary",
    "content-encoding",
];

fuzz_target!(|input: &[u8]| hold(input.len(), WHOLE, || check(input)));

fn check(input: &[u8]) {
    let &[settings, piece, ref bytes @ ..] = input else {
        return;
    };
    // A refusal repeats a part of the request.
    if String::from_utf8_lossy(bytes)
        .to_ascii_lowercase()
        .contains(SECRET)
    {
        return;
    }
    let answer = run(converse(admission(settings), bytes, piece.max(1).into()));
    let asks_token = settings & 1 != 0;
    // Escapes of JSON or of an address may spell the token.
    let shows_token = bytes
        .windows(TOKEN.len())
        .any(|window| window == TOKEN.as_bytes())
        || bytes.iter().any(|byte| b"\\%".contains(byte));
    if answer.starts_with(b"HTTP/") {
        let asks_head = bytes.windows(5).any(|window| window == b"HEAD ");
        let mut answers = answer.as_slice();
        while !answers.is_empty() {
            answers = check_answer(answers, asks_head, !asks_token || shows_token);
        }
        return;
    }
    let text = String::from_utf8(answer).expect("UTF-8");
    assert!(text.is_empty() || text.ends_with('\n'), "{text:?}");
    for line in text.lines() {
        assert!(Json::read(line).is_some(), "{line:?}");
    }
    if asks_token && !shows_token {
        let lines: Vec<&str> = text.lines().collect();
        assert!(
            lines.len() <= 1 && !text.contains("service_response"),
            "{lines:?}"
        );
        assert!(
            text.is_empty() || text.contains("\"level\":\"error\""),
            "{text}"
        );
    }
}

/// Bits: 1 requires the token, 2 has another name, 4 allows pages without an origin, 8 refuses other pages of this
/// machine.
fn admission(settings: u8) -> Admission {
    let is_set = |bit: u8| settings & bit != 0;
    let token = is_set(1).then(|| Token::read(TOKEN).expect("a token"));
    let named = Authority::parse("arm.example:80").expect("a host");
    let access = Access {
        token: token.clone(),
        hosts: if is_set(2) { vec![named] } else { Vec::new() },
        origins: if is_set(4) {
            vec!["null".into()]
        } else {
            Vec::new()
        },
        strict_origin: is_set(8),
    };
    Admission {
        token,
        site: Site::new(access, FOLDER.into(), &[]),
        ..Admission::default()
    }
}

/// Sends all bytes, then the end. Returns all bytes up to the end.
async fn converse(admission: Admission, bytes: &[u8], piece: usize) -> Vec<u8> {
    let stage = Stage::new(admission, Memory::default(), false).await;
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

/// Checks an answer, and returns the bytes after it. With `asks_head` a request may have an answer without a body.
/// Without `may_enter` the answer is a refusal.
fn check_answer(answer: &[u8], asks_head: bool, may_enter: bool) -> &[u8] {
    let end = answer
        .windows(4)
        .position(|window| window == b"\r\n\r\n")
        .unwrap_or_else(|| panic!("a head: {}", String::from_utf8_lossy(answer)));
    let head = std::str::from_utf8(&answer[..end]).expect("a head is text");
    let behind = &answer[end + 4..];
    let mut lines = head.split("\r\n");
    let status_line = lines
        .next()
        .and_then(|line| {
            line.strip_prefix("HTTP/1.1 ")
                .or(line.strip_prefix("HTTP/1.0 "))
        })
        .expect("a status line");
    let status: u16 = status_line
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
    let (body, rest) = if status == 101 {
        let mut frames = Codec::opened(Framing::WebSocket);
        frames.push(behind);
        while frames.next_event().expect("frames of a server").is_some() {}
        (behind, &[][..])
    } else if asks_head && (behind.is_empty() || behind.starts_with(b"HTTP/")) {
        (&[][..], behind)
    } else {
        let body = behind.split_at_checked(length.expect("a length"));
        body.unwrap_or_else(|| panic!("too short: {head}"))
    };
    let shown = String::from_utf8_lossy(body);
    assert!(!shown.contains(SECRET), "a file from outside the report");
    assert!(may_enter || !matches!(status, 101 | 200), "{head}");
    rest
}
