//! Subscriptions, topics and services.

use super::*;
use pendularm::actors::gateway::limits::REGISTRATION_BYTES;

#[test]
fn subscriptions_topics_and_services() {
    in_virtual_time(async {
        let mut scene = Scene::new(WIDE, Nodes::default()).await;
        let quiet = json!({"op": "set_level", "level": "none"});
        scene.client.send(quiet).await;
        let long = "x".repeat(900);
        for n in 0..200 {
            let name = format!("/{n}/{long}");
            for frame in [
                // One topic under many ids, and as many topics.
                json!({"op": "subscribe", "topic": "/t", "id": name}),
                json!({"op": "subscribe", "topic": name, "type": "a/b"}),
                json!({"op": "advertise", "topic": name, "type": "a/b"}),
                json!({"op": "advertise_service", "service": name, "type": "a/b"}),
            ] {
                scene.client.send(frame).await;
            }
        }
        settle().await;
        scene.holds(800 * (REGISTRATION_BYTES + 3 * 900));
        for n in 0..200 {
            let name = format!("/{n}/{long}");
            for frame in [
                json!({"op": "unsubscribe", "topic": "/t", "id": name}),
                json!({"op": "unsubscribe", "topic": name}),
                json!({"op": "unadvertise", "topic": name}),
                json!({"op": "unadvertise_service", "service": name}),
            ] {
                scene.client.send(frame).await;
            }
        }
        settle().await;
        assert!(scene.held() < 300 * KIB, "{}", scene.held());
        scene.end().await;
    });
}

/// A service that goes to another provider is not the first one's any more.
#[test]
fn a_service_that_another_provides_is_charged_to_that_one() {
    in_virtual_time(async {
        let mut scene = Scene::new(WIDE, Nodes::default()).await;
        let mut other = scene.gateway.connect(WIDE);
        scene.client.provide("/s").await;
        other.provide("/s").await;
        drop(other);
        settle().await;
        let kept = scene.held();
        assert!(kept < REGISTRATION_BYTES + 200 * KIB, "{kept}");
        scene.end().await;
    });
}
