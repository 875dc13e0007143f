//! Calls, computations and goals that wait for their ends.

use std::sync::Mutex;

use super::*;
use crate::virtual_time::Held;
use pendularm::actors::gateway::limits::CALL_BYTES;
use pendularm::actors::wire::action_client::{ActionClient, ActionRequest};
use pendularm::protocol::catalog::Action;

/// Calls that wait for a day, and the answered ones, of which nothing is left.
#[test]
fn calls_that_wait() {
    in_virtual_time(async {
        let mut scene = Scene::new(WIDE, Nodes::default()).await;
        let mut provider = scene.gateway.connect(WIDE);
        provider.provide("/s").await;
        let id = "x".repeat(10_000);
        let call = |n: usize| json!({"op": "call_service", "service": "/s", "id": format!("{n}{id}"), "timeout": 86_400});
        scene.client.send(call(0)).await;
        let request = provider.receive().await;
        provider.answer(&request, json!({})).await;
        scene.client.receive().await;
        settle().await;
        // From here on buffers have their size.
        let idle = scene.held();
        for n in 0..100 {
            scene.client.send(call(n)).await;
        }
        let mut requests = Vec::new();
        for _ in 0..100 {
            requests.push(provider.receive().await);
        }
        settle().await;
        let waiting = scene.held() - idle;
        let expected = 100 * (CALL_BYTES + 10_000);
        assert!(
            (expected..expected * 2).contains(&waiting),
            "{waiting} for {expected}"
        );
        for request in &requests {
            provider.answer(request, json!({})).await;
            scene.client.receive().await;
        }
        settle().await;
        let left = scene.held() - idle;
        assert!(left < 20 * CALL_BYTES, "{left}: some are left");
        drop(provider);
        scene.end().await;
    });
}

#[test]
fn requests_of_computations_that_wait() {
    in_virtual_time(async {
        let held = Held::default();
        let mut nodes = Nodes::default();
        Node::holding(&held).attach(&mut nodes, &[Service::IntegrationStep], &[]);
        let mut scene = Scene::new(WIDE, nodes).await;
        for id in 0..8 {
            let call = json!({"op": "call_service", "service": "/arm_sim/integration_step", "id": id,
                "args": {"function": "x".repeat(MIB)}});
            scene.client.send(call).await;
        }
        settle().await;
        scene.holds(8 * MIB);
        for _ in 0..8 {
            held.answer();
            settle().await;
            scene.client.receive().await;
        }
        settle().await;
        assert!(scene.held() < MIB, "{}", scene.held());
        scene.end().await;
    });
}

/// Messages that wait have been read already: their text is gone, and beside what came there is the line that is
/// written of it, if that is another.
#[test]
fn arguments_are_counted_as_they_are_kept() {
    // As they came and as they are written: the same; shorter by one of six; both longer than the text, six and five
    // for four.
    for (entry, kept) in [("1000,", 5), ("1e999,", 6 + 5), ("NaN,", 6 + 5)] {
        in_virtual_time(async {
            let held = Held::default();
            let mut nodes = Nodes::default();
            Node::holding(&held).attach(&mut nodes, &[Service::IntegrationStep], &[]);
            let mut scene = Scene::new(WIDE, nodes).await;
            let count = MIB / entry.len();
            let entries = entry.repeat(count);
            for id in 0..8 {
                let call = format!(
                    r#"{{"op":"call_service","service":"/arm_sim/integration_step","id":{id},"args":{{"x":[{entries}0]}}}}"#
                );
                scene.client.send_text(&(call + "\n")).await;
            }
            settle().await;
            let (waiting, expected) = (scene.held(), 8 * kept * count);
            assert!(
                (expected..expected + MIB / 2).contains(&waiting),
                "{entry} {waiting} for {expected}"
            );
            for _ in 0..8 {
                held.answer();
                settle().await;
                scene.client.receive().await;
            }
            scene.end().await;
        });
    }
}

#[test]
fn ids_of_goals_that_are_pursued() {
    const COUNT: usize = 300;
    const ID: usize = 1000;
    in_virtual_time(async {
        // A node that sets every goal in motion and reaches none.
        let pursued = Mutex::new(Vec::<ActionClient>::new());
        let pursue = move |request| {
            let mut pursued = pursued.lock().unwrap();
            match request {
                ActionRequest::Goal { client, .. } => pursued.push(client),
                ActionRequest::Cancel { from, .. } => pursued.retain(|one| !one.is(&from.goal)),
            }
        };
        let mut nodes = Nodes::default();
        nodes.actions.insert(Action::MoveTo, Box::new(pursue));
        let mut scene = Scene::new(WIDE, nodes).await;
        let id = |n: usize| format!("{n}{}", "x".repeat(ID));
        for n in 0..COUNT {
            let goal =
                json!({"op": "send_action_goal", "action": "/ik_action", "id": id(n), "args": {}});
            scene.client.send(goal).await;
        }
        settle().await;
        let pursued = scene.held();
        let expected = COUNT * ID;
        assert!(
            (expected..2 * expected).contains(&pursued),
            "{pursued} for {expected}"
        );
        for n in 0..COUNT {
            let end = json!({"op": "cancel_action_goal", "action": "/ik_action", "id": id(n)});
            scene.client.send(end).await;
        }
        settle().await;
        assert!(scene.held() < expected / 2, "{}", scene.held());
        scene.end().await;
    });
}
