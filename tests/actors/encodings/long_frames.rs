//! Frames that are too long to be read on the connection's own thread.

use super::*;
use crate::virtual_time::{Held, Node};
use pendularm::actors::gateway::registry::Nodes;
use pendularm::protocol::catalog::Service;
use pendularm::protocol::limits::SHORT;

/// Every answer to a frame that another thread reads comes before the answers to the next frame.
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
            // Not JSON, although its braces balance.
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

/// They are read on another thread, while the client's next frames wait.
#[test]
fn long_arguments_arrive_whole_and_in_their_place() {
    in_virtual_time(async {
        let held = Held::default();
        let mut nodes = Nodes::default();
        Node::holding(&held).attach(&mut nodes, &[Service::SetParams], &[]);
        let gateway = Gateway::with(nodes).await;
        let mut client = gateway.connect(WIDE);
        let args = json!({"gravity": 2, "pad": vec![1; SHORT]});
        for args in [&args, &json!({})] {
            let call =
                json!({"op": "call_service", "service": "/arm_sim/set_params", "args": args});
            client.send(call).await;
        }
        sleep(Duration::from_secs(1)).await;
        assert_eq!(held.count(), 1);
        let arrived = held.0.borrow_mut().remove(0);
        let read: Value = serde_json::from_str(arrived.arguments.payload().get()).unwrap();
        assert_eq!(read, args);
    });
}
