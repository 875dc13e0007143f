//! Attacks on memory: messages for clients that do not read, throttled messages, and unfinished messages.

use super::Attack;
use super::script::{Client, LONG, MIB, call, each, filler, light, publish, subscribe};

pub const ATTACKS: &[Attack] = &[
    Attack::new(
        "deaf-statuses-10",
        "10 clients send lines of two bytes and read no errors",
        || {
            Client::tcp()
                .says(&light("/arm_sim/pause"))
                .floods("x")
                .deaf()
                .times(10)
        },
    ),
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
        "200 clients subscribe to all topics of the arm and read nothing",
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
        "20 clients subscribe to /rosout and diagnostics and read nothing, others cause warnings",
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
        || {
            let steps = r#"{"function":"t","x0":0,"dt":1,"steps":20000,"integrator":"euler"}"#;
            Client::tcp()
                .says(&subscribe("/joint_states", ""))
                .repeats(&light("/rosapi/topics_and_raw_types"))
                .repeats(&call("/arm_sim/integration_step", "1", steps))
                .sips(100)
                .times(50)
        },
    ),
    Attack::new(
        "throttle-hoards",
        "50 subscribers have 100,000 messages held back for a year",
        || {
            each(0..50, |k| {
                let topic = format!("/attack/hoard/{k}");
                let held_back = r#","throttle_rate":31536000000,"queue_length":100000"#;
                Client::tcp()
                    .says(&subscribe(&topic, held_back))
                    .advertises(&topic)
                    .floods(&publish(&topic, r#"{"data":"held back"}"#))
            })
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
                        .map(move |client| client.after(begin).stays_for(800))
                })
                .collect()
        },
    ),
];

fn deaf_topics() -> Vec<Client> {
    deaf_publishers(MIB, Client::repeats)
}

/// Clients that publish to themselves in this way and read nothing.
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
