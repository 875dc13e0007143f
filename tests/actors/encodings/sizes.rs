//! Sizes of pieces: how many there are of a topic at a time.

use super::*;
use pendularm::actors::gateway::limits::MAX_FRAGMENT_SIZES;

/// Bytes of the pieces that the next message comes in.
async fn piece_of(peer: &mut Peer) -> usize {
    let first = peer.receive().await;
    for _ in 1..first["total"].as_u64().unwrap() {
        peer.receive().await;
    }
    first["data"].as_str().unwrap().len()
}

#[test]
fn a_topic_is_cut_up_in_so_many_sizes_and_one_more_counts_as_the_power_of_two_below() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut peers = Vec::new();
        for n in 0..MAX_FRAGMENT_SIZES {
            let mut peer = gateway.connect(WIDE);
            assert_eq!(
                subscribe_in_pieces(&mut peer, 100 + n).await["level"],
                "info"
            );
            peers.push(peer);
        }
        let mut publisher = gateway.connect(WIDE);
        publisher.advertise("/t").await;
        let mut late = [99, 110, 127, 128, 500, 99, 600].map(|size| (size, gateway.connect(WIDE)));
        for (size, late) in &mut late {
            assert_eq!(subscribe_in_pieces(late, *size).await["level"], "info");
        }
        publish_long(&mut publisher, "/t").await;
        let cut_in = [64, 110, 64, 128, 256, 64, 512];
        for ((_, late), piece) in late.iter_mut().zip(cut_in) {
            assert_eq!(piece_of(late).await, piece);
        }
        assert_eq!(piece_of(&mut peers[5]).await, 105);
        let (_, late) = &mut late[0];
        late.send(json!({"op": "subscribe", "topic": "/other", "fragment_size": 99}))
            .await;
        late.receive().await;
        publisher.advertise("/other").await;
        publish_long(&mut publisher, "/other").await;
        assert_eq!(piece_of(late).await, 99, "another topic has its own");
    });
}

/// Another size under the same id takes the place of the one before, also where all are in use.
#[test]
fn a_subscription_changes_its_own_size_where_all_are_in_use() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut peers = Vec::new();
        for n in 0..MAX_FRAGMENT_SIZES {
            let mut peer = gateway.connect(WIDE);
            subscribe_in_pieces(&mut peer, 100 + n).await;
            peers.push(peer);
        }
        let mut second = gateway.connect(WIDE);
        subscribe_in_pieces(&mut second, 100).await;
        // Another has the size that it gives up.
        subscribe_in_pieces(&mut second, 99).await;
        let last = peers.last_mut().unwrap();
        for size in [300, 256, 200] {
            subscribe_in_pieces(last, size).await;
        }
        let mut publisher = gateway.connect(WIDE);
        publisher.advertise("/t").await;
        publish_long(&mut publisher, "/t").await;
        assert_eq!(piece_of(&mut second).await, 64);
        assert_eq!(piece_of(last).await, 200);
    });
}
