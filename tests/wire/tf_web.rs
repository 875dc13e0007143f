//! `tf2_web_republisher`, as web viewers ask it: by its service, by its action, and by the topics of ROS 1's actions.

use crate::common::{Client, Runtime};
use pendularm::actors::ros::tf_web::MAX_FRAMES;
use serde_json::{Value, json};

fn wish(target: &str, sources: &[&str]) -> Value {
    json!({"source_frames": sources, "target_frame": target, "angular_thres": 2.0, "trans_thres": 0.01, "rate": 50.0})
}

fn action(id: &str, args: &Value) -> Value {
    json!({"op": "send_action_goal", "id": id, "action": "/tf2_web_republisher", "args": args, "feedback": true,
           "action_type": "tf2_web_republisher_interfaces/TFSubscription"})
}

fn with_op(client: &mut Client, op: &str) -> Value {
    client.receive_where(op, |frame| frame["op"] == op)
}

/// Name, x and y of each frame.
fn frames(message: &Value) -> Vec<(String, f64, f64)> {
    let transforms = message["transforms"].as_array().unwrap().iter();
    transforms
        .map(|one| {
            let at = |axis: &str| one["transform"]["translation"][axis].as_f64().unwrap();
            (
                one["child_frame_id"].as_str().unwrap().to_owned(),
                at("x"),
                at("y"),
            )
        })
        .collect()
}

fn stretched(runtime: &Runtime) -> Client {
    let mut client = runtime.connect();
    client.ask("/arm_sim/set_params", json!({"gravity": 0}));
    client.ask("/arm_sim/reset", json!({}));
    client
}

#[test]
fn the_service_names_a_topic_with_every_frame() {
    let runtime = Runtime::start();
    let mut client = stretched(&runtime);
    let topic =
        client.ask("/republish_tfs", wish("/world", &["link1", "hand"]))["topic_name"].clone();
    assert_eq!(topic, "/tf2_web_republisher/frames");
    client.subscribe(topic.as_str().unwrap());
    let message = client.message(topic.as_str().unwrap());
    let expected = [("link1", 0.0), ("link2", 1.0), ("hand", 2.0)];
    assert_eq!(
        frames(&message),
        expected.map(|(name, x)| (name.to_owned(), x, 0.0))
    );
    let why = client.refusal("/republish_tfs", wish("link1", &["hand"]));
    assert!(why.starts_with("target_frame must be world"), "{why}");
}

#[test]
fn the_action_tells_the_frames_that_are_wished_for_until_it_is_cancelled() {
    let runtime = Runtime::start();
    let mut client = stretched(&runtime);
    client.send(&action("a", &wish("link9", &["hand"])));
    let end = with_op(&mut client, "action_result");
    assert_eq!((&end["status"], &end["result"]), (&json!(0), &json!(false)));
    assert_eq!(
        end["values"],
        "target_frame must be a frame of the arm, got link9"
    );
    // Frames that the arm does not have are left out.
    client.send(&action("a", &wish("link2", &["/hand", "nothing", "world"])));
    for _ in 0..3 {
        let feedback = with_op(&mut client, "action_feedback");
        assert_eq!(feedback["id"], "a");
        let expected = [
            ("/hand".to_owned(), 1.0, 0.0),
            ("world".to_owned(), -1.0, 0.0),
        ];
        assert_eq!(frames(&feedback["values"]), expected);
    }
    client.send(&json!({"op": "cancel_action_goal", "id": "a", "action": "/tf2_web_republisher"}));
    let end = with_op(&mut client, "action_result");
    assert_eq!((&end["id"], &end["status"]), (&json!("a"), &json!(5)));
    let many = vec!["hand"; MAX_FRAMES + 1];
    client.send(&action("b", &wish("world", &many)));
    let end = with_op(&mut client, "action_result");
    assert!(
        end["values"]
            .as_str()
            .unwrap()
            .contains("at most 32 entries"),
        "{end}"
    );
}
