//! Attacks on the gateway's thread: work per connection, per short message, per error.

use std::time::Duration;

use super::Attack;
use super::script::{Client, light, subscribe};

/// A light call to the arm.
const PAUSE: &str = "/arm_sim/pause";

pub const ATTACKS: &[Attack] = &[
    Attack::new(
        "garbage-traced",
        "10 clients send lines of a few bytes that are no frames and read the errors; the log has every event",
        || {
            Client::tcp()
                .says(&light(PAUSE))
                .floods(r#"{"op":"x"}"#)
                .floods("x")
                .floods("[1,{}]")
                .times(10)
        },
    )
    .with(&["--log", "trace"]),
    Attack::new(
        "calls",
        "20 clients make light calls as fast as they are taken",
        || Client::tcp().floods(&light(PAUSE)).times(20),
    ),
    Attack::new(
        "openings",
        "20 clients open like TLS, HTTP, BSON, a mail server, and reconnect",
        || {
            let openings: [&[u8]; 5] = [
                b"\x16\x03\x01\x02\0\x01\0\x01\xfc\x03\x03",
                b"POST / HTTP/1.1\r\n\r\n",
                b"\x16\0\0\0\x02a\0",
                b"EHLO me\r\n",
                b"PRI * H",
            ];
            let client = |bytes: &&[u8]| {
                Client::tcp()
                    .says_bytes(bytes)
                    .leaves_after(1)
                    .returns()
                    .times(4)
            };
            openings.iter().flat_map(client).collect()
        },
    ),
    Attack::new(
        "resets",
        "20 clients leave in the middle of a frame, with answers unread, and return",
        || {
            Client::tcp()
                .says_each(0..20, |_| light(PAUSE))
                .says_bytes(b"{\"op\":\"publish\",\"topic\":\"/a\",\"msg\":{")
                .deaf()
                .leaves_after(20)
                .returns()
                .times(20)
        },
    ),
    Attack::new(
        "half-open",
        "200 clients ask, stop sending and stay; 20 more come and go",
        || {
            let asks = Client::tcp()
                .says(&subscribe("/joint_states", ""))
                .says_each(0..10, |_| light(PAUSE))
                .half_closes();
            let returns = asks.clone().returns().times(20);
            [asks.deaf().times(200), returns].concat()
        },
    )
    // Each keeps its place for 15 s after it has stopped sending.
    .fills(),
    Attack::new(
        "byte-per-second",
        "200 clients send a frame at a byte a second",
        || {
            Client::tcp()
                .says(&light(PAUSE))
                .drips(1, Duration::from_secs(1))
                .times(200)
        },
    ),
];
