//! `advertise`, `unadvertise`, `publish`, `subscribe`, `unsubscribe`, and ops that are none.
//!
//! **Invariant:** whether a message comes is told without waiting: after its sender has been answered, and then its
//! receiver, nothing is still on its way.

mod publishing;
mod subscriptions;

use crate::common::{Client, Runtime};
use serde_json::{Value, json};

fn publish(topic: &str, data: impl Into<Value>) -> Value {
    json!({"op": "publish", "topic": topic, "msg": {"data": data.into()}})
}

/// The data of all messages that have come to `receiver`, once `sender`'s have all been handled.
fn delivered(sender: &mut Client, receiver: &mut Client) -> Vec<Value> {
    sender.settle();
    received(receiver)
}

fn received(receiver: &mut Client) -> Vec<Value> {
    receiver.settle();
    let kept = std::mem::take(&mut receiver.kept);
    let messages = kept.into_iter().filter(|frame| frame["op"] == "publish");
    messages
        .map(|mut frame| frame["msg"]["data"].take())
        .collect()
}

fn error(client: &mut Client, frame: &Value) -> String {
    client.send(frame);
    let status = client.receive();
    assert_eq!(status["op"], "status", "{status}");
    assert_eq!(status["level"], "error", "{status}");
    assert_eq!(status["id"], frame["id"], "{status}");
    status["msg"].as_str().expect("a text").to_owned()
}

/// A publisher that has advertised `/t`, and a subscriber to it.
fn pair(runtime: &Runtime) -> (Client, Client) {
    let (mut publisher, mut subscriber) = (runtime.connect(), runtime.connect());
    publisher.send(&json!({"op": "advertise", "topic": "/t", "type": "std_msgs/msg/String"}));
    subscriber.subscribe("/t");
    (publisher, subscriber)
}
