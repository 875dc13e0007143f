//! Aimed at the forms in which subscribers want messages: each form is made of the text for itself, and some are made
//! by reading it.

use std::time::Duration;

use super::Attack;
use super::script::{Client, each, filler, publish, subscribe};

const MIB: usize = 1024 * 1024;

pub const ATTACKS: &[Attack] = &[
    Attack::new(
        "fragment-sizes",
        "100 subscribers want 100 fragment sizes of messages of 3 MB",
        || {
            sizes(
                100,
                Client::tcp,
                |k| format!(r#","fragment_size":{}"#, 10_000 + k),
                &text(3 * MIB),
            )
        },
    ),
    Attack::new(
        "fragment-sizes-200",
        "200 subscribers, each with a size of its own",
        || {
            sizes(
                200,
                Client::tcp,
                |k| format!(r#","fragment_size":{}"#, 1_000 + k),
                &text(3 * MIB),
            )
        },
    ),
    Attack::new(
        "cbor-sizes",
        "20 subscribers want cbor, each with a fragment size of its own, of 3 MB",
        || {
            let further = |k| format!(r#","compression":"cbor","fragment_size":{}"#, 1_000 + k);
            sizes(20, Client::web, further, &many("[1.5,2,\"a\"],"))
        },
    ),
    Attack::new(
        "deep-cbor",
        "10 subscribers want cbor of messages of 3 MB nested 100 deep",
        || cbor_of(&deep()),
    ),
    Attack::new(
        "two-deep-cbor",
        "20 subscribers do so under two spellings of two topics: each is read for itself",
        || {
            let further = r#","compression":"cbor""#;
            let topics = ["/attack/one", "/attack/two"];
            let mut clients = each(0..20, |k| {
                let topic = topics[k % 2];
                let spelling = if k % 4 < 2 { topic } else { &topic[1..] };
                Client::web().says(&subscribe(spelling, further))
            });
            clients.extend(topics.map(|topic| publisher(topic, &deep())));
            clients
        },
    ),
    Attack::new(
        "flat-cbor",
        "10 subscribers want cbor of a million and a half numbers of one digit",
        || cbor_of(&many("1,")),
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
        "brackets-cbor",
        "10 subscribers want cbor of a million and a half brackets, 100 deep",
        || cbor_of(&many(&format!("{}{},", "[".repeat(100), "]".repeat(100)))),
    ),
    Attack::new(
        "nameless-cbor",
        "10 subscribers want cbor of 600,000 members without a name",
        || {
            let members = r#""":1,"#.repeat(3 * MIB / 5);
            cbor_of(&format!("{{{members}\"\":1}}"))
        },
    ),
    Attack::new(
        "raw-empties",
        "10 subscribers want cbor-raw of a million empty transforms: 80 bytes each in CDR",
        || {
            let further = r#","compression":"cbor-raw","type":"tf2_msgs/msg/TFMessage""#;
            let msg = many("{},").replace("data", "transforms");
            sizes(10, Client::web, |_| further.to_owned(), &msg)
        },
    ),
    Attack::new(
        "fragments-64",
        "10 subscribers want 3 MB of quotes in fragments of 64 bytes",
        || {
            let msg = format!(r#"{{"data":"{}"}}"#, "\\\"".repeat(3 * MIB / 2));
            let further = |k| format!(r#","fragment_size":{}"#, 64 + k);
            sizes(10, Client::tcp, further, &msg)
        },
    ),
    Attack::new(
        "tiny-fragments",
        "20 subscribers want a megabyte in fragments of one byte",
        || {
            sizes(
                20,
                Client::tcp,
                |_| r#","fragment_size":1"#.to_owned(),
                &text(MIB),
            )
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

/// 3 MB of one thing behind the other.
fn many(unit: &str) -> String {
    format!(r#"{{"data":[{}1]}}"#, unit.repeat(3 * MIB / unit.len()))
}

fn cbor_of(msg: &str) -> Vec<Client> {
    let further = |_| r#","compression":"cbor""#.to_owned();
    sizes(10, Client::web, further, msg)
}

fn deep() -> String {
    many(&format!("{}{},", r#"{"a":["#.repeat(50), "]}".repeat(50)))
}
