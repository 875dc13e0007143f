//! `diagnostics`: its output, and its exit status.

use serde_json::json;

use super::{ask, json_of, said};
use crate::common::Runtime;

#[test]
fn diagnostics_are_printed_and_their_exit_status_shows_whether_every_part_is_ok() {
    let runtime = Runtime::start();
    let yaml = said(&runtime, "diagnostics");
    let ok = "- level: 0\n  name: arm_sim\n  message: running\n";
    assert!(yaml.contains(ok), "{yaml}");
    assert_eq!(json_of(&runtime, "diagnostics")["status"][0]["level"], 0);
    let mut client = runtime.connect();
    client.subscribe("/diagnostics");
    client.send(&json!({"op": "publish", "topic": "/joint_trajectory", "msg": {"points": [{"positions": [1, 1]}]}}));
    for (level, why) in [(1, "the controller is off"), (2, "diverged")] {
        client.receive_where("that level", |frame| {
            frame["topic"] == "/diagnostics" && frame["msg"]["status"][0]["level"] == level
        });
        let output = ask(&runtime, "diagnostics");
        assert_eq!(output.status.code(), Some(1));
        let yaml = String::from_utf8(output.stdout).unwrap();
        let part = format!("- level: {level}\n  name: arm_sim\n");
        assert!(yaml.contains(&part), "{yaml}");
        let complaint = String::from_utf8(output.stderr).unwrap();
        let start = format!("pendularm: arm_sim: {why}");
        assert!(complaint.starts_with(&start), "{complaint}");
        let gains = json!({"kp": [1e6, 1e6], "kd": [1e5, 1e5]});
        client.ask("/pid_controller/set_gains", gains);
        client.ask("/arm_sim/set_integrator", json!({"timestep": 0.02}));
        client.ask("/pid_controller/enable", json!({"data": true}));
    }
}
