//! Messages that a response of the arm discards while a throttle holds them back.

use super::*;
use crate::virtual_time::{Held, Node};
use pendularm::actors::gateway::registry::Nodes;
use pendularm::protocol::catalog::Service;

#[test]
fn a_response_of_the_arm_discards_throttled_messages_of_its_state() {
    for topic in ["/joint_states", "joint_states"] {
        in_virtual_time(discards(topic));
    }
}

async fn discards(topic: &str) {
    let calls = Held::default();
    let mut nodes = Nodes::default();
    Node::holding(&calls).attach(&mut nodes, &[Service::SetParams], &[]);
    let gateway = Gateway::with(nodes).await;
    let mut client = gateway.connect(WIDE);
    client
        .send(json!({"op": "subscribe", "topic": topic, "throttle_rate": 1000}))
        .await;
    client.receive().await;
    let publish = |n: u64| Publish {
        topic: Topic::JointStates,
        frame: Box::new(move || messages::publish("/joint_states", &json!({"n": n}))),
    };
    for n in 0..2 {
        gateway.registry.do_send(publish(n));
    }
    assert_eq!(client.receive().await["msg"]["n"], 0);
    client.call(Service::SetParams.name(), 7).await;
    settle().await;
    calls.answer();
    assert_eq!(client.receive().await["id"], 7);
    assert!(client.receives_nothing_for(Duration::from_secs(5)).await);
    gateway.registry.do_send(publish(2));
    assert_eq!(
        client.receive().await["msg"]["n"],
        2,
        "1 is from before the response"
    );
}
