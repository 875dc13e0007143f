//! Sizes of pieces.

use super::*;

#[test]
fn a_size_counts_as_the_power_of_two_below_it() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut publisher = gateway.connect(WIDE);
        publisher.advertise("/t").await;
        for (size, cut_in) in [(64, 64), (99, 64), (127, 64), (128, 128), (600, 512)] {
            let mut peer = gateway.connect(WIDE);
            let status = subscribe_in_pieces(&mut peer, size).await;
            assert_eq!(status["level"], "info");
            publish_long(&mut publisher, "/t").await;
            let first = peer.receive().await;
            assert_eq!(first["data"].as_str().unwrap().len(), cut_in, "{size}");
        }
    });
}

/// A new size under the same id replaces the old one.
#[test]
fn a_subscription_changes_its_size() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut publisher, mut peer) = (gateway.connect(WIDE), gateway.connect(WIDE));
        publisher.advertise("/t").await;
        for size in [256, 4096, 512] {
            subscribe_in_pieces(&mut peer, size).await;
        }
        publish_long(&mut publisher, "/t").await;
        let first = peer.receive().await;
        assert_eq!(first["data"].as_str().unwrap().len(), 512);
    });
}
