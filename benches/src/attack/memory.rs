//! Aimed at memory: messages that wait for a client that does not read, messages held back, and messages
//! that are begun and not ended.

use super::Attack;
use super::script::{Client, call, each, filler, light, publish, subscribe};

const MIB: usize = 1024 * 1024;
const LONG: usize = 4 * MIB - 1024;

pub const ATTACKS: &[Attack] = &[
    Attack::new(
        "deaf-statuses",
        "1 client sends lines of two bytes and reads no complaint",
        deaf_statuses,
    ),
    Attack::new("deaf-statuses-10", "10 clients do so", || {
        vec![deaf_statuses(); 10].concat()
    }),
    Attack::new(
        "deaf-calls",
        "20 clients make calls of unknown services and read nothing",
        || {
            Client::tcp()
                .floods(&call("/x", "1", "{}"))
                .deaf()
                .times(20)
        },
    ),
    Attack::new(
        "deaf-tiny",
        "200 clients read no message of a flood of 40 bytes each",
        || {
            let flood = Client::tcp()
                .advertises("/attack/tiny")
                .floods(&publish("/attack/tiny", r#"{"data":1}"#))
                .after(300)
                .times(1);
            [
                Client::tcp()
                    .says(&subscribe("/attack/tiny", ""))
                    .deaf()
                    .times(200),
                flood,
            ]
            .concat()
        },
    ),
    Attack::new(
        "deaf-topics",
        "200 clients read nothing of topics of their own with messages of a megabyte",
        deaf_topics,
    ),
    Attack::new(
        "deaf-halfway",
        "200 clients stop reading in the middle of one message of 4 MiB, each of its own",
        || deaf_publishers(LONG, Client::says),
    ),
    Attack::new(
        "deaf-watchers",
        "200 clients subscribe to all that the arm publishes and read nothing",
        || {
            const TOPICS: [&str; 8] = [
                "/joint_states",
                "/clock",
                "/diagnostics",
                "/tf",
                "/tf_static",
                "/robot_description",
                "/rosout",
                "/arm_sim/error_estimate",
            ];
            Client::tcp()
                .says_each(0..TOPICS.len(), |k| subscribe(TOPICS[k], ""))
                .deaf()
                .times(200)
        },
    ),
    Attack::new(
        "deaf-log",
        "20 clients watch /rosout and diagnostics unread, others give reason for warnings",
        || {
            let watch = Client::tcp()
                .says(&subscribe("/rosout", ""))
                .says(&subscribe("/diagnostics", ""))
                .deaf();
            let warn = call("/arm_sim/set_integrator", "1", r#"{"timestep":-1}"#);
            let forge = publish("/rosout", r#"{"level":30,"msg":"forged"}"#);
            [
                watch.times(20),
                Client::tcp().floods(&warn).floods(&forge).times(10),
            ]
            .concat()
        },
    ),
    Attack::new(
        "deaf-lists",
        "100 clients ask for everything that there is and read nothing",
        deaf_lists,
    ),
    Attack::new(
        "sips",
        "50 clients ask for much and read 100 bytes ten times a second",
        sips,
    ),
    Attack::new(
        "throttled-series",
        "200 subscribers are throttled beside a flood of short messages",
        || {
            let further = |k| {
                format!(
                    r#","throttle_rate":{},"queue_length":{}"#,
                    1 + k % 50,
                    1 + k % 100
                )
            };
            let flood = Client::tcp()
                .advertises("/attack/series")
                .floods(&publish("/attack/series", r#"{"data":1}"#))
                .after(400)
                .times(1);
            [
                each(0..200, |k| {
                    Client::tcp().says(&subscribe("/attack/series", &further(k)))
                }),
                flood,
            ]
            .concat()
        },
    ),
    Attack::new(
        "throttle-hoards",
        "50 subscribers have 100,000 messages held back for a year",
        || {
            each(0..50, |k| {
                let topic = format!("/attack/hoard/{k}");
                Client::tcp()
                    .says(&subscribe(&topic, HELD_BACK))
                    .advertises(&topic)
                    .floods(&publish(&topic, r#"{"data":"held back"}"#))
            })
        },
    ),
    Attack::new(
        "throttle-topics",
        "16 clients have 100,000 messages held back of one topic after the other",
        || {
            const EACH: usize = 100_000;
            let topics = 0..12;
            let name = |n: usize| format!("/{n:x}");
            let subscriber =
                Client::tcp().says_each(topics.clone(), |n| subscribe(&name(n), HELD_BACK));
            let publisher = topics
                .clone()
                .fold(Client::tcp(), |client, n| client.advertises(&name(n)));
            let messages = topics.start * EACH..topics.end * EACH;
            let publisher = publisher.says_each(messages, |n| publish(&name(n / EACH), "{}"));
            [subscriber.times(16), vec![publisher.after(400)]].concat()
        },
    ),
    Attack::new(
        "unfinished-frames",
        "200 clients send all of a frame of 4 MiB but its end",
        unfinished_frames,
    ),
    Attack::new(
        "fragment-bombs",
        "200 clients begin 8 fragmented messages of 4,096 pieces each",
        fragment_bombs,
    ),
    Attack::new(
        "many-fragments",
        "50 clients send pieces of a byte, out of order, of messages that never end",
        || {
            let piece = |k: usize| {
                let num = (k / 8 * 2503) % 4096;
                format!(
                    r#"{{"op":"fragment","id":"m{}","num":{num},"total":4096,"data":"x"}}"#,
                    k % 8
                )
            };
            Client::tcp()
                .advertises("/attack/pieces")
                .repeats_each(0..8 * 4000, piece)
                .times(50)
        },
    ),
    // The allocator keeps the memory of clients that have left for a while.
    Attack::new(
        "one-after-another",
        "clients that fill memory in one way leave, and others come who fill it in another",
        || {
            let ways = [
                deaf_topics(),
                unfinished_frames(),
                deaf_lists(),
                fragment_bombs(),
            ];
            let turns = ways.into_iter().zip((0..).step_by(1000));
            turns
                .flat_map(|(clients, begin)| {
                    clients
                        .into_iter()
                        .map(move |client| client.after(begin).leaves_after(800))
                })
                .collect()
        },
    ),
];

fn deaf_statuses() -> Vec<Client> {
    Client::tcp()
        .says(&light("/arm_sim/pause"))
        .floods("x")
        .deaf()
        .times(1)
}

fn deaf_topics() -> Vec<Client> {
    deaf_publishers(MIB, Client::repeats)
}

/// Clients who read nothing of what they publish to themselves in this way.
fn deaf_publishers(bytes: usize, publishes: fn(Client, &str) -> Client) -> Vec<Client> {
    let msg = format!(r#"{{"data":"{}"}}"#, filler(bytes));
    each(0..200, |k| {
        let topic = format!("/attack/deaf/{k}");
        let client = Client::tcp()
            .says(&subscribe(&topic, ""))
            .advertises(&topic);
        publishes(client, &publish(&topic, &msg)).deaf()
    })
}

fn deaf_lists() -> Vec<Client> {
    let ask = [
        "/rosapi/topics_and_raw_types",
        "/rosapi/topics",
        "/rosapi/services",
        "/rosapi/interfaces",
    ];
    Client::tcp()
        .repeats_each(0..ask.len(), |k| light(ask[k]))
        .deaf()
        .times(100)
}

fn sips() -> Vec<Client> {
    let steps = r#"{"function":"t","x0":0,"dt":1,"steps":20000,"integrator":"euler"}"#;
    let client = Client::tcp().says(&subscribe("/joint_states", ""));
    client
        .repeats(&light("/rosapi/topics_and_raw_types"))
        .repeats(&call("/arm_sim/integration_step", "1", steps))
        .sips(100)
        .times(50)
}

/// As much is held back as a queue may have, for a year.
const HELD_BACK: &str = r#","throttle_rate":31536000000,"queue_length":100000"#;

fn unfinished_frames() -> Vec<Client> {
    let begun = format!(
        r#"{{"op":"publish","topic":"/t","msg":{{"data":"{}"#,
        filler(LONG - 64)
    );
    Client::tcp().says_bytes(begun.as_bytes()).times(200)
}

fn fragment_bombs() -> Vec<Client> {
    let piece = |k: usize| {
        let data = filler(60_000);
        format!(
            r#"{{"op":"fragment","id":"b{}","num":{},"total":4096,"data":"{data}"}}"#,
            k % 8,
            k / 8
        )
    };
    Client::tcp().says_each(0..64, piece).times(200)
}
