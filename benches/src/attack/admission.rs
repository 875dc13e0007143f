//! Aimed at the door: tokens, requests, the page and the report.

use std::time::Duration;

use super::script::{Client, filler, light};
use super::{Attack, TOKEN};

/// The end of a head.
const END: &[u8] = b"Connection: close\r\n\r\n";

pub const ATTACKS: &[Attack] = &[
    Attack::new(
        "silent-before-token",
        "1,100 clients connect and say nothing, and the holder of the token comes",
        silent,
    )
    .locked(),
    Attack::new(
        "almost-silent",
        "1,100 clients say a space now and then instead of the token",
        || {
            Client::tcp()
                .repeats_bytes(b" \n")
                .drips(1, Duration::from_secs(1))
                .returns()
                .times(1_100)
        },
    )
    .locked(),
    Attack::new(
        "guesses",
        "100 clients guess at the token, are told so, and return",
        guesses,
    )
    .locked(),
    Attack::new(
        "guesses-web",
        "50 clients guess in addresses and cookies, and return",
        || {
            let address = Client::http("GET /?token=a-token-that-somebody-guesses")
                .says_bytes(END)
                .returns();
            let cookie = Client::http("GET /")
                .says_bytes(b"Cookie: token=guess; pendularm=guess\r\n")
                .says_bytes(END)
                .returns();
            [address.times(25), cookie.times(25)].concat()
        },
    )
    .locked(),
    Attack::new(
        "holders",
        "100 clients show the token and flood with calls",
        holders,
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
        "long-heads",
        "20 clients send heads of 16 KiB and more, of 100 lines, and return",
        || {
            let long = format!("X-Long: {}\r\n", filler(16 * 1024));
            let many = "X-Many: 1\r\n".repeat(100);
            let client = |head: &str| {
                Client::http("GET /")
                    .says_bytes(head.as_bytes())
                    .says_bytes(END)
                    .returns()
                    .times(10)
            };
            [client(&long), client(&many)].concat()
        },
    ),
    Attack::new(
        "pages",
        "50 clients ask for the page, read nothing, and return",
        pages,
    ),
    Attack::new(
        "foreign",
        "20 clients come with foreign hosts and origins, and return",
        foreign,
    ),
    Attack::new(
        "report-readers",
        "64 clients read 100 bytes of a report's file of 8 MB ten times a second",
        || {
            Client::http("GET /report/large.csv")
                .says_bytes(END)
                .sips(100)
                .returns()
                .times(64)
        },
    )
    .with(&["--report", REPORT]),
    Attack::new(
        "paths",
        "20 clients ask for files outside of the report, and return",
        paths,
    )
    .with(&["--report", REPORT]),
];

/// The folder of the report, below the folder in which the program is started.
pub const REPORT: &str = "report";

fn silent() -> Vec<Client> {
    Client::tcp().returns().times(1_100)
}

fn guesses() -> Vec<Client> {
    let guess =
        |k: usize| format!(r#"{{"op":"auth","token":"a-token-that-somebody-guesses-{k:08}"}}"#);
    super::script::each(0..100, |k| Client::tcp().says(&guess(k)).returns())
}

fn holders() -> Vec<Client> {
    let auth = format!(r#"{{"op":"auth","token":"{TOKEN}"}}"#);
    Client::tcp()
        .says(&auth)
        .floods(&light("/arm_sim/pause"))
        .times(100)
}

fn pages() -> Vec<Client> {
    Client::http("GET /")
        .says_bytes(END)
        .deaf()
        .leaves_after(50)
        .returns()
        .times(50)
}

fn foreign() -> Vec<Client> {
    let host = b"Host: evil.example\r\n";
    let origin = b"Origin: https://evil.example\r\nUpgrade: websocket\r\n\
        Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n\
        Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
    let client = |head: &[u8]| {
        Client::http("GET /")
            .says_bytes(head)
            .says_bytes(END)
            .returns()
            .times(10)
    };
    [client(host), client(origin)].concat()
}

fn paths() -> Vec<Client> {
    let paths = [
        "../../etc/passwd",
        "%2e%2e/%2e%2e/etc/passwd",
        "..%2f..%2fetc%2fpasswd",
        "%00",
        "\\..\\..\\",
        "a/./../..//b",
    ];
    let client = |path: &&str| {
        Client::http(&format!("GET /report/{path}"))
            .says_bytes(END)
            .returns()
            .times(4)
    };
    paths.iter().flat_map(client).collect()
}
