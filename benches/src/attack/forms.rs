//! Attacks on encodings of messages: each requested form is encoded separately, and some need a parsed message.

use std::time::Duration;

use super::Attack;
use super::script::{Client, MIB, each, filler, publish, subscribe};

pub const ATTACKS: &[Attack] = &[
    Attack::new(
        "fragment-sizes-200",
        "200 subscribers, each with a fragment size of its own, of messages of 3 MB",
        || {
            let further = |k| format!(r#","fragment_size":{}"#, 1_000 + k);
            sizes(200, Client::tcp, further, &text(3 * MIB))
        },
    ),
    Attack::new(
        "tiny-fragments",
        "20 subscribers want a megabyte in fragments of one byte",
        || {
            let further = |_| r#","fragment_size":1"#.to_owned();
            sizes(20, Client::tcp, further, &text(MIB))
        },
    ),
    Attack::new(
        "cbor-sizes",
        "20 subscribers want cbor, each with a fragment size of its own, of 3 MB",
        || {
            let further = |k| format!(r#","compression":"cbor","fragment_size":{}"#, 1_000 + k);
            sizes(20, Client::web, further, &many("data", "[1.5,2,\"a\"],"))
        },
    ),
    Attack::new(
        "flat-cbor",
        "10 subscribers want cbor of a million and a half numbers of one digit",
        || {
            let further = |_| r#","compression":"cbor""#.to_owned();
            sizes(10, Client::web, further, &many("data", "1,"))
        },
    ),
    Attack::new(
        "deep-cbor",
        "20 subscribers want cbor of 3 MB nested 100 deep, under two spellings of two topics",
        || {
            let deep = format!("{}{},", r#"{"a":["#.repeat(50), "]}".repeat(50));
            let topics = ["/attack/one", "/attack/two"];
            let mut clients = each(0..20, |k| {
                let topic = topics[k % 2];
                let spelling = if k % 4 < 2 { topic } else { &topic[1..] };
                Client::web().says(&subscribe(spelling, r#","compression":"cbor""#))
            });
            clients.extend(topics.map(|topic| publisher(topic, &many("data", &deep))));
            clients
        },
    ),
    Attack::new(
        "cbor-topics",
        "40 subscribers want cbor, each of a topic of its own with messages of a megabyte",
        || {
            let msg = format!(r#"{{"data":[{}1]}}"#, "1.5,".repeat(MIB / 4));
            let pair = |k| {
                let topic = format!("/attack/cbor{k}");
                let subscriber = Client::web().says(&subscribe(&topic, r#","compression":"cbor""#));
                [subscriber, publisher(&topic, &msg)]
            };
            (0..40).flat_map(pair).collect()
        },
    ),
    Attack::new(
        "raw-empties",
        "10 subscribers want cbor-raw of a million empty transforms: 80 bytes each in CDR",
        || {
            let further = r#","compression":"cbor-raw","type":"tf2_msgs/msg/TFMessage""#;
            let msg = many("transforms", "{},");
            sizes(10, Client::web, |_| further.to_owned(), &msg)
        },
    ),
];

/// Subscribers of `/attack/sizes`, each with its own further fields, and two messages a second to them.
fn sizes(
    count: usize,
    door: fn() -> Client,
    further: impl Fn(usize) -> String,
    msg: &str,
) -> Vec<Client> {
    let mut clients = each(0..count, |k| {
        door().says(&subscribe("/attack/sizes", &further(k)))
    });
    clients.push(publisher("/attack/sizes", msg));
    clients
}

/// Two messages a second.
fn publisher(topic: &str, msg: &str) -> Client {
    let frame = publish(topic, msg);
    Client::tcp()
        .advertises(topic)
        .repeats(&frame)
        .drips(frame.len() + 1, Duration::from_millis(500))
        .after(300)
}

fn text(bytes: usize) -> String {
    format!(r#"{{"data":"{}"}}"#, filler(bytes))
}

/// 3 MB of the same entry, which ends with a comma.
fn many(field: &str, entry: &str) -> String {
    let entries = entry.repeat(3 * MIB / entry.len());
    format!(r#"{{"{field}":[{}]}}"#, entries.trim_end_matches(','))
}
