//! Frames that are too long to be read on the connection's own thread.

use super::*;
use crate::virtual_time::{Held, Node};
use pendularm::actors::gateway::registry::Nodes;
use pendularm::protocol::catalog::Service;
use pendularm::protocol::limits::SHORT;
use pendularm::protocol::op::MAX_ARGS;

/// Everything about a frame that is read elsewhere comes before everything about the next one.
#[test]
fn long_frames_are_answered_in_their_place() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut client = gateway.connect(WIDE);
        let pad = "[1e5,\"\\u00e9\"],".repeat(SHORT / 8);
        for id in 0..20 {
            let long = format!(
                "{{\"op\":\"call_service\",\"service\":\"/none\",\"id\":{id},\"pad\":[{pad}0]}}\n"
            );
            client.send_text(&long).await;
            client.call("/none", 100 + id).await;
            // No JSON, though its braces balance.
            client
                .send_text(&format!("{{\"id\":{id},\"pad\":[{pad}]}}\n"))
                .await;
        }
        for id in 0..20 {
            assert_eq!(client.receive().await["id"], id);
            assert_eq!(client.receive().await["id"], 100 + id);
            let status = client.receive().await;
            assert!(
                status["msg"]
                    .as_str()
                    .unwrap()
                    .starts_with("malformed frame"),
                "{status}"
            );
        }
    });
}

/// A node reads its arguments on its own thread, and so never megabytes of them: not even of members that it has no
/// use for.
#[test]
fn a_node_never_gets_long_arguments() {
    in_virtual_time(async {
        let held = Held::default();
        let mut nodes = Nodes::default();
        Node::holding(&held).attach(&mut nodes, &[Service::SetParams], &[]);
        let gateway = Gateway::with(nodes).await;
        let mut client = gateway.connect(WIDE);
        let call = |args: Value| json!({"op": "call_service", "service": "/arm_sim/set_params", "id": 1, "args": args});
        let (few, many) = (vec![1; 10], vec![1; MAX_ARGS]);
        client
            .send(call(json!({"lengths": few, "pad": many})))
            .await;
        sleep(Duration::from_secs(1)).await;
        let arrived = held.0.borrow_mut().remove(0);
        let args: Value = serde_json::from_str(arrived.arguments.payload().get()).unwrap();
        assert_eq!(
            args,
            json!({"lengths": few}),
            "the rest was never the service's"
        );
        drop(arrived);
        assert_eq!(client.receive().await["id"], 1);
        client.send(call(json!({"lengths": many}))).await;
        let response = client.receive().await;
        assert_eq!(
            (&response["id"], &response["result"]),
            (&json!(1), &json!(false))
        );
        assert!(
            response["status"]
                .as_str()
                .unwrap()
                .contains("args must be at most"),
            "{response}"
        );
        assert_eq!(held.count(), 0);
    });
}
