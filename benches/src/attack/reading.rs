//! Attacks on the reading of frames: names, numbers and pieces that are expensive to read, and many of them at once.

use std::time::Duration;

use super::Attack;
use super::script::{Client, KIB, LONG, MIB, SLOW, call, filler, light, publish, subscribe};

pub const ATTACKS: &[Attack] = &[
    Attack::new(
        "goal-ids",
        "a goal whose id is 3 MB of slow decimals, with feedback; its client goes",
        || {
            let id = format!("[{}{SLOW}]", format!("{SLOW},").repeat(3 * MIB / 50));
            let goal = format!(
                r#""id":{id},"feedback":true,"args":{{"x":1,"y":1,"epsilon":1e-9,"success_hold":1000}}"#
            );
            Client::tcp()
                .says(&format!(
                    r#"{{"op":"send_action_goal","action":"/ik_action",{goal}}}"#
                ))
                .leaves_after(300)
                .times(1)
        },
    )
    .moves(),
    Attack::new(
        "long-ids",
        "20 clients make calls with ids of 4 MiB and read the answers",
        || {
            let id = format!("\"{}\"", filler(LONG));
            Client::tcp()
                .repeats(&call("/arm_sim/pause", &id, "{}"))
                .times(20)
        },
    ),
    Attack::new(
        "long-args",
        "20 clients call with 4 MiB of slow decimals",
        || {
            let args = format!(r#"{{"kp":[{}1]}}"#, format!("{SLOW},").repeat(LONG / 50));
            Client::tcp()
                .repeats(&call("/pid_controller/set_gains", "1", &args))
                .times(20)
        },
    ),
    Attack::new(
        "trajectories",
        "20 clients publish trajectories of 4 MiB",
        || {
            let points = r#"{"positions":[0.1,0.2]},"#.repeat(LONG / 24 - 1);
            let msg = format!(r#"{{"points":[{points}{{"positions":[0.1,0.2]}}]}}"#);
            Client::tcp()
                .repeats(&publish("/joint_trajectory", &msg))
                .times(20)
        },
    )
    .moves(),
    Attack::new(
        "slow-paths",
        "100 clients send paths of slow decimals, of 15 KB",
        || {
            let point = format!(
                r#"{{"positions":[{SLOW}],"velocities":[{SLOW}],"time_from_start":{{"sec":1,"nanosec":0}}}}"#
            );
            let points = vec![point; 90].join(",");
            let action = "/joint_trajectory_controller/follow_joint_trajectory";
            let path = format!(r#"{{"joint_names":["joint1","joint2"],"points":[{points}]}}"#);
            let goal = format!(
                r#"{{"op":"send_action_goal","action":"{action}","id":"1","args":{{"trajectory":{path}}}}}"#
            );
            Client::tcp().repeats(&goal).times(100)
        },
    ),
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
        || {
            let text = r"\u0041\ud83d\ude00".repeat(LONG / 18 - 10);
            let topic = r"\u002fattack\u002fescapes";
            let frame = publish(topic, &format!(r#"{{"data":"{text}"}}"#));
            let publisher = Client::tcp().advertises(topic).repeats(&frame);
            let reader = Client::web().says(&subscribe(topic, r#","compression":"cbor""#));
            [publisher.times(10), reader.times(2)].concat()
        },
    ),
    Attack::new(
        "deep",
        "10 clients send 4 MiB of arrays in arrays, too deep and just not",
        || {
            let too_deep = format!(r#"{{"op":"publish","msg":{}"#, "[".repeat(LONG));
            let pairs = format!("{}1{},", "[".repeat(100), "]".repeat(100)).repeat(LONG / 202 - 1);
            let just_not = publish("/attack/deep", &format!(r#"{{"n":[{pairs}1]}}"#));
            Client::tcp()
                .advertises("/attack/deep")
                .repeats(&too_deep)
                .repeats(&just_not)
                .times(10)
        },
    ),
    Attack::new(
        "empty-lines",
        "10 clients send line ends and spaces",
        || {
            let bytes = [b"\n".repeat(32 * KIB), b" \t\r".repeat(32 * KIB)].concat();
            // The first bytes select the protocol, so the first frame is valid.
            Client::tcp()
                .says(&light("/arm_sim/pause"))
                .repeats_bytes(&bytes)
                .times(10)
        },
    ),
    Attack::new(
        "slashes",
        "60 clients ask who serves a type whose name is 15 KB of slashes",
        || {
            let args = format!(r#"{{"service":"{}"}}"#, "/".repeat(15_000));
            Client::tcp()
                .repeats(&call("/rosapi/service_providers", "1", &args))
                .times(60)
        },
    ),
    Attack::new(
        "nested-pieces",
        "10 clients send fragments of fragments of fragments",
        || {
            let mut piece = light("/arm_sim/pause");
            // Each layer doubles the escapes. Six layers make some 20 KB.
            for _ in 0..6 {
                let data = piece.replace('\\', r"\\").replace('"', "\\\"");
                piece =
                    format!(r#"{{"op":"fragment","id":"n","num":0,"total":1,"data":"{data}"}}"#);
            }
            Client::tcp().floods(&piece).times(10)
        },
    ),
    Attack::new(
        "last-pieces",
        "40 clients send messages of 4 MB in pieces of 64 KB",
        || {
            // The joined pieces are no frame, but are read to the end.
            let piece = |num: usize| {
                let begin = if num == 0 { r#"{\"x\":\""# } else { "" };
                let data = filler(64_000);
                format!(
                    r#"{{"op":"fragment","id":"1","num":{num},"total":64,"data":"{begin}{data}"}}"#
                )
            };
            Client::tcp().repeats_each(0..64, piece).times(40)
        },
    ),
    Attack::new(
        "half-chunks",
        "200 clients send a frame of 31 KB each, four times a second",
        || {
            let frame = format!(r#"{{"op":"none","x":"{}"}}"#, filler(31_000));
            Client::tcp()
                .repeats(&frame)
                .drips(frame.len() + 1, Duration::from_millis(250))
                .times(200)
        },
    )
    .fills(),
];
