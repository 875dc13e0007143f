//! Frames and messages that have come in part, and what is read before it is clear who comes.

use super::*;
use pendularm::actors::resources::budget::CONNECTION_BYTES;
use pendularm::protocol::wire::fragments::PIECE_BYTES;

#[test]
fn a_frame_that_is_not_complete() {
    in_virtual_time(async {
        let mut scene = Scene::new(WIDE, Nodes::default()).await;
        let begun = format!("{{\"op\":\"publish\",\"msg\":\"{}", "x".repeat(3 * MIB));
        scene.flood(&begun).await;
        scene.holds(3 * MIB);
        scene.end().await;
    });
}

#[test]
fn a_frame_that_is_skipped_is_not_kept() {
    in_virtual_time(async {
        let mut scene = Scene::new(WIDE, Nodes::default()).await;
        let long = format!("{{\"op\":\"publish\",\"msg\":\"{}", "x".repeat(9 * MIB));
        scene.flood(&long).await;
        assert_eq!(scene.client.receive().await["level"], "error");
        settle().await;
        assert!(scene.held() < MIB, "{}", scene.held());
        scene.end().await;
    });
}

#[test]
fn fragments_without_text() {
    in_virtual_time(async {
        let mut scene = Scene::new(WIDE, Nodes::default()).await;
        for message in 0..8 {
            for num in 0..1000 {
                let piece =
                    json!({"op": "fragment", "id": message, "num": num, "total": 4096, "data": ""});
                scene.client.send(piece).await;
            }
        }
        settle().await;
        scene.holds(8000 * PIECE_BYTES);
        // They are forgotten when they are old, though nothing more comes.
        sleep(Duration::from_secs(61)).await;
        settle().await;
        assert!(scene.held() < 200 * KIB, "{}", scene.held());
        scene.end().await;
    });
}

#[test]
fn fragments_with_text() {
    in_virtual_time(async {
        let mut scene = Scene::new(WIDE, Nodes::default()).await;
        for num in 0..6 {
            let data = "x".repeat(MIB / 2);
            let piece = json!({"op": "fragment", "id": 1, "num": num, "total": 7, "data": data});
            scene.client.send(piece).await;
        }
        settle().await;
        scene.holds(3 * MIB);
        scene.end().await;
    });
}

/// From the first moment on: who says nothing, and who has begun a request, has a buffer as well.
#[test]
fn what_is_read_before_it_is_clear_who_comes() {
    in_virtual_time(async {
        let memory = Memory::default();
        let gateway = Gateway::within(memory.clone(), Nodes::default()).await;
        let mut clients = Vec::new();
        for head in ["", " ", "GE", "GET / HTTP/1.1\r\nX: "] {
            let before = memory.held();
            let mut client = gateway.connect(WIDE);
            client.offer(head).await;
            settle().await;
            let counted = memory.held() - before;
            assert_eq!(counted, CONNECTION_BYTES + 64 * KIB, "{head}");
            clients.push(client);
        }
        drop(clients);
        settle().await;
        assert_eq!(memory.held(), 0);
    });
}
