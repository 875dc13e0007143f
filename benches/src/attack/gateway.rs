//! Aimed at the gateway's thread: work per message, per connection, per line.

use super::Attack;
use super::script::{Client, call, filler, light, numbers, publish, slow_numbers, subscribe};

const MIB: usize = 1024 * 1024;
/// A frame of almost the length that is taken.
const LONG: usize = 4 * MIB - 1024;
/// A light call that goes to the arm.
const PAUSE: &str = "/arm_sim/pause";

pub const ATTACKS: &[Attack] = &[
    Attack::new(
        "goal-ids",
        "a goal whose id is 3 MB of slow decimals, with feedback; its client goes",
        || {
    let args = r#"{"x":1,"y":1,"epsilon":1e-9,"success_hold":1000}"#;
    let goal = |bytes| {
        let id = slow_numbers(bytes);
        format!(
            r#"{{"op":"send_action_goal","action":"/ik_action","id":{id},"feedback":true,"args":{args}}}"#
        )
    };
    Client::tcp()
        .says(&goal(3 * MIB))
        .leaves_after(300)
        .times(1)
},
    )
    .moves(),
    Attack::new(
        "slow-numbers",
        "1 client publishes 4 MiB of slow decimals, over and over",
        || {
    let msg = format!(r#"{{"n":{}}}"#, slow_numbers(LONG));
    Client::tcp()
        .advertises("/attack/slow")
        .repeats(&publish("/attack/slow", &msg))
        .times(1)
},
    ),
    Attack::new(
        "slow-numbers-20",
        "20 clients publish 64 KiB of slow decimals, over and over",
        || {
    let msg = format!(r#"{{"n":{}}}"#, slow_numbers(64 * 1024));
    Client::tcp()
        .advertises("/attack/slow")
        .repeats(&publish("/attack/slow", &msg))
        .times(20)
},
    ),
    Attack::new(
        "slow-numbers-arm",
        "4 clients call the arm with 4 MiB of slow decimals",
        || {
    let args = format!(r#"{{"masses":{}}}"#, slow_numbers(LONG));
    Client::tcp()
        .repeats(&call("/arm_sim/set_params", "1", &args))
        .times(4)
},
    ),
    Attack::new(
        "long-ids",
        "20 clients make calls with ids of 4 MiB and read the answers",
        || Client::tcp()
        .repeats(&call(PAUSE, &format!("\"{}\"", filler(LONG)), "{}"))
        .times(20),
    ),
    Attack::new(
        "long-args",
        "20 clients call with arrays of a million arguments",
        || Client::tcp()
        .repeats(&call("/pid_controller/set_gains", "1", &numbers(LONG)))
        .times(20),
    ),
    Attack::new(
        "trajectories",
        "20 clients publish trajectories of 4 MiB",
        trajectories,
    )
    .moves(),
    Attack::new(
        "many-keys",
        "10 clients send frames of 300,000 fields, the same over and over",
        || {
    let keys = r#""msg":{},"topic":"/a","#.repeat(LONG / 22 - 10);
    Client::tcp()
        .repeats(&format!(r#"{{{keys}"op":"publish"}}"#))
        .times(10)
},
    ),
    Attack::new(
        "escapes",
        "10 clients publish 4 MiB of escaped characters, names escaped too",
        escapes,
    ),
    Attack::new(
        "deep",
        "10 clients send 4 MiB of arrays in arrays, too deep and just not",
        deep,
    ),
    Attack::new(
        "empty-lines",
        "10 clients send line ends and spaces",
        || {
    let mut bytes = b"\n".repeat(32 * 1024);
    bytes.extend(b" \t\r".repeat(32 * 1024));
    // The first bytes decide what is spoken, so the first frame is one.
    Client::tcp()
        .says(&light(PAUSE))
        .repeats_bytes(&bytes)
        .times(10)
},
    ),
    Attack::new(
        "garbage",
        "10 clients send lines of a few bytes that are no frames and read the complaints",
        garbage,
    ),
    Attack::new(
        "garbage-traced",
        "the same while the log tells everything",
        garbage,
    )
    .with(&["--log", "trace"]),
    Attack::new(
        "nested-pieces",
        "10 clients send fragments of fragments of fragments",
        || {
    let mut piece = light(PAUSE);
    // Each layer doubles the escapes; six come to some 20 KB.
    for _ in 0..6 {
        let data = piece.replace('\\', r"\\").replace('"', "\\\"");
        piece = format!(r#"{{"op":"fragment","id":"n","num":0,"total":1,"data":"{data}"}}"#);
    }
    Client::tcp().floods(&piece).times(10)
},
    ),
    Attack::new(
        "calls",
        "20 clients make light calls as fast as they are taken",
        calls,
    ),
    Attack::new(
        "levels",
        "20 clients set their level, over and over",
        levels,
    ),
    Attack::new(
        "connects",
        "50 clients connect, say nothing and go, over and over",
        connects,
    ),
    Attack::new(
        "openings",
        "20 clients open like TLS, HTTP, BSON, a mail server, and return",
        openings,
    ),
    Attack::new(
        "resets",
        "20 clients leave in the middle of a frame, with answers unread, and return",
        resets,
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
    ),
    Attack::new("idle", "300 clients connect and are silent", idle).fills(),
    Attack::new(
        "byte-per-second",
        "200 clients send a frame at a byte a second",
        || {
    let drip = std::time::Duration::from_secs(1);
    Client::tcp().says(&light(PAUSE)).drips(1, drip).times(200)
},
    ),
    Attack::new(
        "few-files",
        "200 clients come and go while the program may have 64 files open",
        || {
    let asks = Client::tcp().says(&light(PAUSE));
    [
        asks.clone().times(100),
        asks.leaves_after(5).returns().times(100),
    ]
    .concat()
},
    )
    .with_files(64),
];

fn trajectories() -> Vec<Client> {
    let entries = r#"{"positions":[0.1,0.2]},"#.repeat(LONG / 24 - 1);
    let msg = format!(r#"{{"points":[{entries}{{"positions":[0.1,0.2]}}]}}"#);
    Client::tcp()
        .repeats(&publish("/joint_trajectory", &msg))
        .times(20)
}

fn escapes() -> Vec<Client> {
    let text = r"\u0041\ud83d\ude00".repeat(LONG / 18 - 10);
    let topic = r"\u002fattack\u002fescapes";
    let frame = publish(topic, &format!(r#"{{"data":"{text}"}}"#));
    let mut clients = Client::tcp().advertises(topic).repeats(&frame).times(10);
    clients.extend(
        Client::web()
            .says(&subscribe(topic, r#","compression":"cbor""#))
            .times(2),
    );
    clients
}

fn deep() -> Vec<Client> {
    let too_deep = format!(r#"{{"op":"publish","msg":{}"#, "[".repeat(LONG));
    let pairs = format!("{}1{},", "[".repeat(100), "]".repeat(100)).repeat(LONG / 202 - 1);
    let just_not = publish("/attack/deep", &format!(r#"{{"n":[{pairs}1]}}"#));
    Client::tcp()
        .advertises("/attack/deep")
        .repeats(&too_deep)
        .repeats(&just_not)
        .times(10)
}

fn garbage() -> Vec<Client> {
    Client::tcp()
        .says(&light(PAUSE))
        .floods(r#"{"op":"x"}"#)
        .floods("x")
        .floods("[1,{}]")
        .times(10)
}

fn calls() -> Vec<Client> {
    Client::tcp().floods(&light(PAUSE)).times(20)
}

fn levels() -> Vec<Client> {
    Client::tcp()
        .floods(r#"{"op":"set_level","level":"none"}"#)
        .floods(r#"{"op":"set_level","level":"info"}"#)
        .times(20)
}

fn connects() -> Vec<Client> {
    Client::tcp().leaves_after(0).returns().times(50)
}

fn openings() -> Vec<Client> {
    let openings: [&[u8]; 5] = [
        b"\x16\x03\x01\x02\0\x01\0\x01\xfc\x03\x03",
        b"POST / HTTP/1.1\r\n\r\n",
        b"\x16\0\0\0\x02a\0",
        b"EHLO me\r\n",
        b"PRI * H",
    ];
    let clients = openings.iter().flat_map(|bytes| {
        Client::tcp()
            .says_bytes(bytes)
            .leaves_after(1)
            .returns()
            .times(4)
    });
    clients.collect()
}

fn resets() -> Vec<Client> {
    let client = Client::tcp()
        .says_each(0..20, |_| light(PAUSE))
        .says_bytes(b"{\"op\":\"publish\",\"topic\":\"/a\",\"msg\":{");
    client.deaf().leaves_after(20).returns().times(20)
}

fn idle() -> Vec<Client> {
    Client::tcp().times(300)
}
