//! Clients that take little or nothing of what waits for them.

use super::*;
use pendularm::actors::gateway::limits::STALL_LIMIT;

#[test]
fn a_client_that_takes_nothing_while_responses_wait_is_disconnected_after_twenty_seconds() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut client = gateway.connect(64);
        client.call("/none", 1).await;
        settle().await;
        sleep(STALL_LIMIT - Duration::from_secs(1)).await;
        assert_eq!(gateway.gauges.connections(), 1);
        sleep(Duration::from_secs(2)).await;
        assert_eq!(gateway.gauges.connections(), 0);
        assert_eq!(STALL_LIMIT, Duration::from_secs(20));
    });
}

#[test]
fn every_byte_that_it_takes_gives_a_client_twenty_seconds_more() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut client = gateway.connect(16);
        client.call("/none", 1).await;
        for _ in 0..5 {
            sleep(STALL_LIMIT - Duration::from_secs(1)).await;
            assert_eq!(gateway.gauges.connections(), 1);
            client.take(1).await;
        }
        sleep(STALL_LIMIT + Duration::from_secs(1)).await;
        assert_eq!(gateway.gauges.connections(), 0);
    });
}

#[test]
fn a_client_that_takes_no_topic_message_is_never_disconnected() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut publisher, mut client) = (gateway.connect(WIDE), gateway.connect(64));
        client.subscribe("/t").await;
        publisher.advertise("/t").await;
        for n in 0..1000 {
            publisher.publish("/t", n).await;
            sleep(Duration::from_secs(1)).await;
        }
        assert_eq!(gateway.gauges.connections(), 2);
        assert_eq!(client.receive().await["msg"]["n"], 0);
    });
}

#[test]
fn the_twenty_seconds_begin_with_the_response_not_with_the_messages_before_it() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut publisher, mut client) = (gateway.connect(WIDE), gateway.connect(128));
        client.subscribe("/t").await;
        publisher.advertise("/t").await;
        for n in 0..10 {
            publisher.publish("/t", n).await;
        }
        sleep(Duration::from_secs(60)).await;
        client.call("/none", 1).await;
        sleep(STALL_LIMIT - Duration::from_secs(1)).await;
        assert_eq!(gateway.gauges.connections(), 2);
        sleep(Duration::from_secs(2)).await;
        assert_eq!(gateway.gauges.connections(), 1);
    });
}
