//! Aimed at how frames are read: names, numbers and pieces that take long for what they are, and much of it at once.

use std::time::Duration;

use super::Attack;
use super::script::{Client, call, filler};

pub const ATTACKS: &[Attack] = &[
    Attack::new(
        "slashes",
        "60 clients ask who serves a type whose name is 15 KB of slashes",
        slashes,
    ),
    Attack::new(
        "slow-paths",
        "100 clients send paths of numbers in the middle between two doubles, of 15 KB",
        || {
            const SLOW: &str = "10000000000000001268e281";
            let point = format!(
                r#"{{"positions":[{SLOW},{SLOW}],"velocities":[{SLOW},{SLOW}],"time_from_start":{{"sec":1,"nanosec":0}}}}"#
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
        "last-pieces",
        "40 clients send messages of 4 MB in pieces of 64 KB",
        || {
            const PIECES: usize = 64;
            let data = filler(64_000);
            let piece = move |num: usize| {
                // The pieces make a text that is no frame, read to its end.
                let data = if num == 0 {
                    format!(r#"{{\"x\":\"{data}"#)
                } else {
                    data.clone()
                };
                format!(
                    r#"{{"op":"fragment","id":"1","num":{num},"total":{PIECES},"data":"{data}"}}"#
                )
            };
            Client::tcp().repeats_each(0..PIECES, piece).times(40)
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

fn slashes() -> Vec<Client> {
    let name = "/".repeat(15_000);
    let ask = call(
        "/rosapi/service_providers",
        "1",
        &format!(r#"{{"service":"{name}"}}"#),
    );
    Client::tcp().repeats(&ask).times(60)
}
