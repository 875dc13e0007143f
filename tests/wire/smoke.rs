//! The program as a newcomer meets it: it starts, moves, and ends.

use crate::common::Runtime;
use serde_json::json;

#[test]
fn a_fresh_arm_falls_freely_and_settles_where_it_is_sent() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    let falling = client.message("/joint_states");
    assert_eq!(falling["effort"], json!([0.0, 0.0]));
    client.ask("/pid_controller/enable", json!({"data": true}));
    client.send(&json!({"op": "publish", "topic": "/joint_trajectory",
        "msg": {"points": [{"positions": [0.3, -0.5]}]}}));
    let settled = client.receive_where("a settled arm", |frame| {
        let position = &frame["msg"]["position"];
        let near = |joint: usize, wanted: f64| {
            position[joint]
                .as_f64()
                .is_some_and(|value| (value - wanted).abs() < 0.02)
        };
        near(0, 0.3) && near(1, -0.5)
    });
    assert_eq!(settled["topic"], "/joint_states");
}
