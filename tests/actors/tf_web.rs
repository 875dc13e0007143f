//! Frames for web viewers in virtual time: their receivers, their rates and their ends.
//!
//! **Invariant:** virtual time, so messages are counted.

use crate::stage::{Client, Stage, ms, number};
use crate::system::in_virtual_time;
use pendularm::actors::ros::tf_web::MAX_WISHES;
use pendularm::protocol::limits::MAX_NAME;
use pendularm::protocol::op::MAX_ARGS;
use serde_json::{Value, json};

const ACTION: &str = "/tf2_web_republisher";

fn wish(target: &str, sources: &[&str], rate: f64) -> Value {
    json!({"source_frames": sources, "target_frame": target, "rate": rate})
}

async fn send_goal(client: &mut Client, id: &str, args: Value) {
    client
        .send(
            &json!({"op": "send_action_goal", "id": id, "action": ACTION, "args": args, "feedback": true,
                "action_type": "tf2_web_republisher_interfaces/TFSubscription"}),
        )
        .await;
}

async fn with_op(client: &mut Client, op: &str) -> Value {
    client.next_where(|frame| frame["op"] == op).await
}

/// Name and x of each frame.
fn frames(message: &Value) -> Vec<(&str, f64)> {
    let transforms = message["transforms"].as_array().unwrap().iter();
    let named = transforms.map(|one| {
        let x = number(&one["transform"]["translation"]["x"]);
        (one["child_frame_id"].as_str().unwrap(), x)
    });
    named.collect()
}

#[test]
fn a_goal_has_its_frames_at_its_rate_until_it_is_cancelled() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        send_goal(&mut client, "a", wish("link2", &["hand", "world"], 10.0)).await;
        let feedback = with_op(&mut client, "action_feedback").await;
        assert_eq!(feedback["id"], "a");
        let expected = [("hand", 1.0), ("world", -1.0)];
        assert_eq!(frames(&feedback["values"]), expected);
        client.heard.clear();
        client.messages_for(ms(3000), "").await;
        let told = client.heard.iter();
        let told = told
            .filter(|frame| frame["op"] == "action_feedback")
            .count();
        // Looks come 60 times a second: one in seven is a tenth of a second after the last message.
        assert!((25..=30).contains(&told), "{told}");
        client
            .send(&json!({"op": "cancel_action_goal", "id": "a", "action": ACTION}))
            .await;
        let end = with_op(&mut client, "action_result").await;
        assert_eq!((&end["id"], &end["status"]), (&json!("a"), &json!(5)));
        client.heard.clear();
        client.messages_for(ms(1000), "").await;
        assert!(client.heard.is_empty(), "{:?}", client.heard);
    });
}

#[test]
fn of_too_many_goals_the_oldest_ends_and_the_others_go_on() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        for n in 0..MAX_WISHES {
            send_goal(&mut client, &n.to_string(), wish("world", &["hand"], 1.0)).await;
        }
        client.settle().await;
        let ended = |client: &Client| {
            let ends = client.heard.iter();
            let ends = ends.filter(|frame| frame["op"] == "action_result");
            ends.map(|end| (end["id"].clone(), end["status"].clone()))
                .collect::<Vec<_>>()
        };
        assert_eq!(ended(&client), [], "there is room for all of them");
        send_goal(&mut client, "one more", wish("world", &["hand"], 1.0)).await;
        client.settle().await;
        assert_eq!(ended(&client), [(json!("0"), json!(6))]);
    });
}

#[test]
fn whoever_has_one_goal_loses_it_to_nobody_who_has_many() {
    in_virtual_time(async {
        let (stage, mut viewer) = Stage::<2>::with_a_floating_arm().await;
        send_goal(&mut viewer, "one", wish("world", &["hand"], 10.0)).await;
        viewer.settle().await;
        let mut greedy = stage.connect();
        for n in 0..2 * MAX_WISHES {
            send_goal(&mut greedy, &n.to_string(), wish("world", &["hand"], 1.0)).await;
        }
        let end = with_op(&mut greedy, "action_result").await;
        assert_eq!((&end["id"], &end["status"]), (&json!("0"), &json!(6)));
        let why = end["values"].as_str().unwrap();
        assert!(why.contains("it has too many"), "{why}");
        viewer.heard.clear();
        viewer.messages_for(ms(1000), "").await;
        let ops: Vec<_> = viewer.heard.iter().map(|frame| &frame["op"]).collect();
        assert!(
            ops.len() >= 8 && ops.iter().all(|op| *op == "action_feedback"),
            "{ops:?}"
        );
    });
}

#[test]
fn the_topic_has_every_frame_thirty_times_a_second_while_somebody_subscribes() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        let named = client.ask("/republish_tfs", wish("world", &["hand"], 5.0));
        let named = named.await["topic_name"].clone();
        let topic = named.as_str().unwrap();
        client.subscribe(topic).await;
        let told = client.messages_for(ms(3000), topic).await;
        assert!((85..=91).contains(&told.len()), "{}", told.len());
        let expected = [("link1", 0.0), ("link2", 1.0), ("hand", 2.0)];
        assert_eq!(frames(&told[0]), expected);
        client.unsubscribe(topic).await;
        assert_eq!(client.messages_for(ms(1000), topic).await.len(), 0);
    });
}

#[test]
fn a_published_goal_has_its_frames_under_its_id_until_it_is_cancelled_or_nobody_hears_of_it() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        let (goal, feedback) = (format!("{ACTION}/goal"), format!("{ACTION}/feedback"));
        let publish = |id: &str| {
            let msg = json!({"goal_id": {"id": id}, "goal": wish("world", &["link2"], 10.0)});
            json!({"op": "publish", "topic": goal, "msg": msg})
        };
        client.subscribe(&feedback).await;
        for id in ["first", "second"] {
            client.send(&publish(id)).await;
        }
        let ids = |told: &[Value]| {
            let ids = told.iter().map(|one| &one["status"]["goal_id"]["id"]);
            ["first", "second"].map(|id| ids.clone().filter(|one| *one == id).count())
        };
        let told = client.messages_for(ms(1000), &feedback).await;
        assert!(ids(&told).iter().all(|count| *count >= 8), "{told:?}");
        assert_eq!(frames(&told[0]["feedback"]), [("link2", 1.0)]);
        client
            .send(&json!({"op": "publish", "topic": format!("{ACTION}/cancel"), "msg": {"id": "first"}}))
            .await;
        client.settle().await;
        let told = client.messages_for(ms(1000), &feedback).await;
        let [first, second] = ids(&told);
        assert!(first == 0 && second >= 8, "{told:?}");
        client.unsubscribe(&feedback).await;
        client.subscribe(&feedback).await;
        assert_eq!(client.messages_for(ms(1000), &feedback).await.len(), 0);
    });
}

fn published(id: &str) -> Value {
    let msg = json!({"goal_id": {"id": id}, "goal": wish("world", &["link2"], 10.0)});
    json!({"op": "publish", "topic": format!("{ACTION}/goal"), "msg": msg})
}

/// Ids of the wishes that a viewer hears of in a second.
async fn heard_of(viewer: &mut Client, feedback: &str) -> Vec<Value> {
    viewer.settle().await;
    let told = viewer.messages_for(ms(1000), feedback).await;
    let ids = told.iter().map(|one| &one["status"]["goal_id"]["id"]);
    let mut ids: Vec<_> = ids.cloned().collect();
    ids.sort_by_key(Value::to_string);
    ids.dedup();
    ids
}

#[test]
fn a_published_wish_ends_with_its_connection_or_when_that_unsubscribes_from_feedback() {
    in_virtual_time(async {
        let (stage, mut viewer) = Stage::<2>::with_a_floating_arm().await;
        let feedback = format!("{ACTION}/feedback");
        let relative = feedback.trim_start_matches('/').to_owned();
        viewer.subscribe(&feedback).await;
        viewer.send(&published("mine")).await;
        // One that does not listen itself publishes for those who do.
        let mut publisher = stage.connect();
        publisher.send(&published("for others")).await;
        let mut page = stage.connect();
        for topic in [&feedback, &relative] {
            page.subscribe(topic).await;
        }
        page.subscribe("/clock").await;
        page.send(&published("page's")).await;
        page.settle().await;
        let all = ["for others", "mine", "page's"];
        assert_eq!(heard_of(&mut viewer, &feedback).await, all);
        for topic in ["/clock", &relative] {
            page.unsubscribe(topic).await;
            page.settle().await;
            assert_eq!(heard_of(&mut viewer, &feedback).await, all, "{topic}");
        }
        page.unsubscribe(&feedback).await;
        page.settle().await;
        assert_eq!(
            heard_of(&mut viewer, &feedback).await,
            ["for others", "mine"]
        );
        page.subscribe(&feedback).await;
        page.send(&published("again")).await;
        page.settle().await;
        assert_eq!(
            heard_of(&mut viewer, &feedback).await,
            ["again", "for others", "mine"]
        );
        drop(publisher);
        drop(page);
        viewer.messages_for(ms(100), &feedback).await;
        assert_eq!(heard_of(&mut viewer, &feedback).await, ["mine"]);
    });
}

/// Wishes of many clients together.
const WISHES: usize = 16 * MAX_WISHES;

#[test]
fn published_wishes_have_three_hundred_messages_a_second_together_and_each_its_part() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        let (goal, feedback) = (format!("{ACTION}/goal"), format!("{ACTION}/feedback"));
        client.subscribe(&feedback).await;
        let mut publishers = Vec::new();
        for id in 0..WISHES {
            if id % MAX_WISHES == 0 {
                publishers.push(stage.connect());
            }
            let goal_id = json!({"id": id.to_string()});
            let msg = json!({"goal_id": goal_id, "goal": wish("world", &["link2"], 60.0)});
            let publisher = publishers.last_mut().unwrap();
            publisher
                .send(&json!({"op": "publish", "topic": goal, "msg": msg}))
                .await;
            publisher.settle().await;
        }
        client.settle().await;
        let told = client.messages_for(ms(3000), &feedback).await;
        // 180 looks of five each, and one more or less at either end.
        assert!((890..=910).contains(&told.len()), "{}", told.len());
        for id in 0..WISHES {
            let name = id.to_string();
            let of_it = |one: &&Value| one["status"]["goal_id"]["id"] == name.as_str();
            let part = told.iter().filter(of_it).count();
            assert!((13..=15).contains(&part), "{part} of {id}");
        }
    });
}

#[test]
fn what_is_published_and_cannot_be_meant_is_refused_by_field_and_ends_nothing() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        let feedback = format!("{ACTION}/feedback");
        client.subscribe(&feedback).await;
        let goal =
            |id: &str| json!({"goal_id": {"id": id}, "goal": wish("world", &["link2"], 10.0)});
        let publish = |to: &str, msg: Value| {
            let topic = format!("{ACTION}/{to}");
            json!({"op": "publish", "topic": topic, "msg": msg})
        };
        let longest = "x".repeat(MAX_NAME);
        client.send(&publish("goal", goal(&longest))).await;
        for (to, msg, why) in [
            (
                "goal",
                goal(&format!("{longest}x")),
                "goal: goal_id.id must be at most 1024 bytes long",
            ),
            (
                "cancel",
                json!({"id": 5}),
                "cancel: id must be a string, got 5",
            ),
            (
                "cancel",
                json!({"id": null}),
                "cancel: id must be a string, got null",
            ),
            (
                "cancel",
                json!({"id": "x".repeat(MAX_ARGS)}),
                "cancel: msg must be at most 16384 bytes long",
            ),
        ] {
            client.send(&publish(to, msg)).await;
            let status = client.next_where(|frame| frame["level"] == "error").await;
            assert_eq!(status["msg"], format!("{ACTION}/{why}"));
        }
        let told = client.messages_for(ms(1000), &feedback).await;
        assert!(told.len() >= 8, "it goes on: {}", told.len());
        for msg in [json!({}), json!({"id": ""})] {
            client.send(&publish("goal", goal("x"))).await;
            client.send(&publish("cancel", msg)).await;
            client.settle().await;
            let told = client.messages_for(ms(1000), &feedback).await;
            assert!(told.is_empty(), "without an id all of them end: {told:?}");
        }
    });
}

#[test]
fn goals_of_the_action_have_a_bounded_number_of_messages_together_and_each_its_part() {
    in_virtual_time(async {
        let (stage, first) = Stage::<2>::with_a_floating_arm().await;
        let mut clients = [first, stage.connect()];
        for client in &mut clients {
            for n in 0..MAX_WISHES {
                let everything = wish("world", &["hand"; 32], 1e6);
                send_goal(client, &n.to_string(), everything).await;
            }
            client.settle().await;
            client.heard.clear();
        }
        let [first, second] = &mut clients;
        tokio::join!(
            first.messages_for(ms(4000), ""),
            second.messages_for(ms(4000), "")
        );
        for client in &clients {
            for n in 0..MAX_WISHES {
                let id = n.to_string();
                let of_it = |frame: &&Value| frame["id"] == id.as_str();
                let part = client.heard.iter().filter(of_it).count();
                // 240 looks of five each, among eight; the first client began a moment earlier.
                assert!((145..=155).contains(&part), "{part} of {id}");
            }
        }
    });
}
