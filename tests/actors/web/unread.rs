//! WebSocket clients that read little or nothing.

use super::*;
use bytes::Bytes;
use pendularm::actors::gateway::limits::STALL_LIMIT;
use pendularm::actors::gateway::messages::Publish;
use pendularm::protocol::catalog::Topic;

#[test]
fn a_client_that_takes_a_little_at_a_time_is_borne_with() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut socket = open(&gateway, 1024).await;
        let id = "x".repeat(60_000);
        let unknown = json!({"op": "call_service", "service": "/nobody", "id": id});
        send(&mut socket, unknown).await;
        // For more than twice as long as one that takes nothing is borne with, within one write of ours.
        let mut some = [0; 1024];
        for _ in 0..50 {
            sleep(Duration::from_secs(1)).await;
            socket.stream().read_exact(&mut some).await.unwrap();
        }
        assert_eq!(gateway.gauges.connections(), 1);
        sleep(STALL_LIMIT + Duration::from_secs(1)).await;
        assert_eq!(gateway.gauges.connections(), 0);
    });
}

#[test]
fn a_slow_client_loses_the_oldest_messages_and_no_response() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut socket = open(&gateway, 1024).await;
        send(
            &mut socket,
            json!({"op": "subscribe", "topic": "/joint_states"}),
        )
        .await;
        settle().await;
        let line = format!(
            "{{\"op\":\"publish\",\"pad\":\"{}\"}}\n",
            "x".repeat(10_000)
        );
        for _ in 0..100 {
            gateway.registry.do_send(Publish {
                topic: Topic::JointStates,
                frame: Bytes::from(line.clone()).into(),
            });
        }
        settle().await;
        let dropped = gateway.gauges.messages_dropped();
        assert!(
            (65..=72).contains(&dropped),
            "{dropped} of 1 MB do not fit into 304 KiB"
        );
        let unknown = json!({"op": "call_service", "service": "/nobody", "id": "last"});
        send(&mut socket, unknown).await;
        let mut messages = 0;
        loop {
            let text = receive_text(&mut socket).await;
            if text.contains("last") {
                break;
            }
            assert_eq!(text.len() + 1, line.len());
            messages += 1;
        }
        assert_eq!(messages + dropped, 100);
    });
}

/// Pings of a peer that reads no pong: fewer pongs wait for it than a write of ours holds, and when it reads, the last
/// of them has been answered.
#[test]
fn pings_whose_pongs_are_not_read_cost_next_to_nothing() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut stream = open(&gateway, 64 * 1024).await.into_stream();
        for n in 0..20_000_u32 {
            let mut ping = vec![0x89, 0x80 | 125, 0, 0, 0, 0];
            ping.extend_from_slice(&n.to_be_bytes());
            ping.resize(6 + 125, b'x');
            stream.write_all(&ping).await.unwrap();
        }
        settle().await;
        let (mut last, mut pongs) = (0, 0);
        while last != 19_999 {
            let mut pong = [0; 127];
            stream.read_exact(&mut pong).await.unwrap();
            assert_eq!(pong[..2], [0x8a, 125], "a pong");
            last = u32::from_be_bytes([pong[2], pong[3], pong[4], pong[5]]);
            pongs += 1;
        }
        assert!(pongs * 127 <= (64 + 72) * 1024, "{pongs} pongs waited");
    });
}
