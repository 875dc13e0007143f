//! Keepalive: pings, pongs and any other bytes of a peer.

use super::*;
use crate::virtual_time::Held;
use tokio::time::timeout;

#[test]
fn a_peer_that_answers_pings_stays_and_is_pinged_every_fifteen_seconds() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut socket = open(&gateway, WIDE).await;
        let began = Instant::now();
        for ping in 1..=240 {
            let message = socket.next_event().await.unwrap();
            assert!(matches!(message, Event::Ping(_)), "{message:?}");
            assert_elapsed(began, ping * PING_INTERVAL);
        }
        assert_eq!(gateway.gauges.connections(), 1);
    });
}

#[test]
fn a_peer_without_a_sign_of_life_is_closed_thirty_seconds_after_it_was_asked() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let socket = open(&gateway, WIDE).await;
        settle().await;
        sleep(PING_INTERVAL + PONG_TIME - Duration::from_secs(1)).await;
        assert_eq!(gateway.gauges.connections(), 1);
        // The close frame is not answered either; it is waited for, and no longer than that.
        sleep(Duration::from_secs(1) + Duration::from_secs(5)).await;
        settle().await;
        assert_eq!(gateway.gauges.connections(), 0);
        drop(socket);
    });
}

/// Over a slow line a message can take longer than a pong may: its bytes are as good a sign of life.
#[test]
fn a_peer_in_the_middle_of_a_long_message_is_alive() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let socket = open(&gateway, WIDE).await;
        let mut stream = socket.into_stream();
        let frame = json!({"op": "subscribe", "topic": "/chat/over/a/slow/line"}).to_string();
        let length = u8::try_from(frame.len()).unwrap();
        let began = Instant::now();
        let mut bytes = vec![0x81, 0x80 | length, 0, 0, 0, 0];
        bytes.extend_from_slice(frame.as_bytes());
        for byte in bytes {
            stream.write_all(&[byte]).await.unwrap();
            sleep(Duration::from_secs(1)).await;
        }
        assert!(
            began.elapsed() > PING_INTERVAL + PONG_TIME,
            "else it proves nothing"
        );
        assert_eq!(gateway.gauges.connections(), 1);
    });
}

/// A node that answers after ten minutes: meanwhile the connection reads nothing, so it sees no pong.
#[test]
fn while_the_client_is_not_read_it_need_not_show_life() {
    in_virtual_time(async {
        let held = Held::default();
        let mut nodes = Nodes::default();
        Node::holding(&held).attach(&mut nodes, &[Service::Pause], &[]);
        let gateway = Gateway::with(nodes).await;
        let mut socket = open(&gateway, WIDE).await;
        send(
            &mut socket,
            json!({"op": "call_service", "service": "/arm_sim/pause", "id": 1}),
        )
        .await;
        sleep(Duration::from_secs(600)).await;
        assert_eq!(held.count(), 1);
        held.answer();
        let answer = receive_text(&mut socket).await;
        assert!(answer.contains("\"id\":1"));
        // From here on it is asked again, and answers.
        let quiet = timeout(Duration::from_secs(600), receive(&mut socket)).await;
        assert!(quiet.is_err());
        assert_eq!(gateway.gauges.connections(), 1);
    });
}

/// Its pieces of other messages grow old meanwhile, each at another moment, and are forgotten.
#[test]
fn a_message_has_its_minute_whatever_is_forgotten_meanwhile() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut socket = open(&gateway, WIDE).await;
        for number in 0..8 {
            let piece = json!({"op": "fragment", "id": number, "data": "{", "num": 0, "total": 2});
            send(&mut socket, piece).await;
            sleep(Duration::from_secs(7)).await;
        }
        let mut begins = Vec::new();
        append(&mut begins, opcode::TEXT, [0; 4], b"{");
        socket.stream().write_all(&begins).await.unwrap();
        let began = Instant::now();
        while let Ok(Event::Ping(_)) = socket.next_event().await {}
        assert_elapsed(began, FRAME_TIME);
    });
}
