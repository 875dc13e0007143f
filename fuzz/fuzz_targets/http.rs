//! The first bytes of a connection, and HTTP behind them, with and without a token to be shown.
//!
//! Asserted: the answer is lines of JSON, or well-formed HTTP answers of known headers, as long as they say, and then
//! the end. A file is never one from outside the report's folder. Admission with the first request is as a [second
//! opinion](pendularm_fuzz::admission) says. A client that speaks JSON and does not show the token hears one line.
//!
//! Input: a byte of settings, a byte that says in which pieces the rest is sent, the rest.

#![no_main]

use std::time::Duration;

use libfuzzer_sys::fuzz_target;
use pendularm::actors::gateway::connection::admission::{Admission, Newcomers};
use pendularm::actors::resources::memory::Memory;
use pendularm::protocol::op::token::Token;
use pendularm::web::Site;
use pendularm::web::access::Access;
use pendularm::web::authority::Authority;
use pendularm_client::codec::{Codec, Framing};
use pendularm_fuzz::admission::{Opinion, Rules, judge};
use pendularm_fuzz::json::Json;
use pendularm_fuzz::limits::{Allowance, hold};
use pendularm_fuzz::stage::{Stage, run};
use tokio::io::{AsyncReadExt, AsyncWriteExt, split};
use tokio::time::timeout;

const TOKEN: &str = "open-sesame-once-more";
/// The folder of the report, and what a file beside it says.
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
/// Longer than anything here may take.
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
    let rules = Rules {
        token: (settings & 1 != 0).then_some(TOKEN),
        has_name: settings & 2 != 0,
        allows_null: settings & 4 != 0,
        is_strict: settings & 8 != 0,
    };
    let answer = run(converse(admission(rules), bytes, piece.max(1).into()));
    let expected = judge(bytes, rules);
    if answer.starts_with(b"HTTP/") {
        let mut answers = answer.as_slice();
        let mut first = Some((expected, bytes.starts_with(b"HEAD ")));
        let asks_head = bytes.windows(5).any(|window| window == b"HEAD ");
        while !answers.is_empty() {
            answers = check_answer(answers, first.take(), asks_head);
        }
        return;
    }
    let is_certain = expected.is_some_and(|(_, is_certain)| is_certain);
    assert!(!is_certain, "no answer to a request");
    let text = String::from_utf8(answer).expect("UTF-8");
    assert!(text.is_empty() || text.ends_with('\n'), "{text:?}");
    for line in text.lines() {
        assert!(Json::read(line).is_some(), "{line:?}");
    }
    let shows_token = bytes
        .windows(TOKEN.len())
        .any(|window| window == TOKEN.as_bytes());
    // Written as escapes it is the token all the same.
    if rules.token.is_some() && !shows_token && !bytes.contains(&b'\\') {
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

fn admission(rules: Rules<'_>) -> Admission {
    let token = rules.token.map(|token| Token::new(token).expect("a token"));
    let named = Authority::parse("arm.example:80").expect("a host");
    let access = Access {
        token: token.clone(),
        hosts: if rules.has_name {
            vec![named]
        } else {
            Vec::new()
        },
        origins: if rules.allows_null {
            vec!["null".into()]
        } else {
            Vec::new()
        },
        strict_origin: rules.is_strict,
    };
    Admission {
        token,
        site: Site::new(access, FOLDER.into()),
        newcomers: Newcomers::default(),
    }
}

/// Sends all of it, then the end; gives what comes up to the end.
async fn converse(admission: Admission, bytes: &[u8], piece: usize) -> Vec<u8> {
    let stage = Stage::new(admission, Memory::default()).await;
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

/// Whether the answer whose head ends before `behind` has no body.
fn is_bodyless(
    behind: &[u8],
    first: Option<(Option<(Opinion, bool)>, bool)>,
    asks_head: bool,
) -> bool {
    let at_end = behind.is_empty() || behind.starts_with(b"HTTP/");
    match first {
        Some((Some((_, true)), is_head)) => is_head,
        Some((_, is_head)) => is_head && at_end,
        None => asks_head && at_end,
    }
}

/// Checks an answer. The `first` one is checked against an opinion of its request, and whether that is a HEAD request.
/// The answer to such a request has no body; `asks_head` says whether a later request may be one. Returns the bytes
/// behind the answer.
fn check_answer(
    answer: &[u8],
    first: Option<(Option<(Opinion, bool)>, bool)>,
    asks_head: bool,
) -> &[u8] {
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
    } else if is_bodyless(behind, first, asks_head) {
        (&[][..], behind)
    } else {
        let body = behind.split_at_checked(length.expect("a length"));
        body.unwrap_or_else(|| panic!("too short: {head}"))
    };
    let shown = String::from_utf8_lossy(body);
    assert!(!shown.contains(SECRET), "a file from outside the report");
    let Some((expected, _)) = first else {
        return rest;
    };
    let opinion = expected.map(|(opinion, _)| opinion);
    // However odd a request is otherwise, nobody is let in who may not.
    match status {
        101 | 426 => assert_eq!(opinion, Some(Opinion::Socket), "{head}"),
        200 | 301 => assert_eq!(opinion, Some(Opinion::Page), "{head}"),
        404 => assert!(
            matches!(opinion, Some(Opinion::Page | Opinion::Socket)),
            "{head}"
        ),
        _ => {}
    }
    if let Some((opinion, true)) = expected {
        let fitting: &[u16] = match opinion {
            Opinion::NoHost => &[400],
            Opinion::Refused => &[403],
            Opinion::Page => &[200, 301, 404],
            Opinion::Socket => &[101, 400, 404, 426],
        };
        assert!(fitting.contains(&status), "{opinion:?}: {head}");
    }
    rest
}
