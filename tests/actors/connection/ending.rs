//! The end of a connection in virtual time: remaining messages for a client that has stopped sending, and the shutdown.
//!
//! **Invariant:** no test depends on how fast the machine is; times are read from the paused clock.

use super::*;
use crate::virtual_time::assert_elapsed;
use pendularm::actors::gateway::limits::{LINGER, RESPONSES_TIME, STALL_LIMIT};
use pendularm::actors::gateway::messages::{FinishAll, RefuseCalls};
use tokio::time::Instant;

#[test]
fn a_half_closed_client_is_owed_its_computations_and_its_calls() {
    in_virtual_time(async {
        let (gateway, computations, _) = held_back().await;
        let (mut client, mut provider) = (gateway.connect(WIDE), gateway.connect(WIDE));
        provider.provide("/s").await;
        for n in 0..3 {
            client.call(STEP, n).await;
        }
        client.call("/s", 3).await;
        client.half_close().await;
        provider.receive().await;
        sleep(Duration::from_secs(11)).await;
        for n in 0..3 {
            computations.answer();
            sleep(Duration::from_secs(1)).await;
            assert_eq!(computations.count(), usize::from(n < 2));
        }
        let ids: Vec<u64> = client.rest().await.iter().map(id).collect();
        assert_eq!(ids, [3, 0, 1, 2], "the call timed out before that");
        settle().await;
        assert_eq!(gateway.gauges.connections(), 1);
    });
}

/// Whether it has only stopped sending or has disconnected is unknown until something is sent to it.
#[test]
fn a_half_closed_client_is_not_kept_for_ever_by_a_call_or_a_computation() {
    in_virtual_time(async {
        let (gateway, computations, _) = held_back().await;
        let (mut client, mut provider) = (gateway.connect(WIDE), gateway.connect(WIDE));
        provider.provide("/s").await;
        client.call(STEP, 1).await;
        client.call(STEP, 2).await;
        client
            .send(json!({"op": "call_service", "service": "/s", "id": 3, "timeout": 80000}))
            .await;
        client.half_close().await;
        settle().await;
        let began = Instant::now();
        client.rest().await;
        assert!(began.elapsed() <= RESPONSES_TIME, "{:?}", began.elapsed());
        settle().await;
        assert_eq!(gateway.gauges.connections(), 1);
        assert!(computations.take().is_gone(), "it need not go on");
        assert_eq!(computations.count(), 0, "the next one is not begun");
    });
}

/// With its queue full no frame of it is performed, but its end is seen all the same.
#[test]
fn a_client_that_ends_while_its_queue_is_full_is_not_kept() {
    in_virtual_time(async {
        let (gateway, computations, _) = held_back().await;
        let mut client = gateway.connect(WIDE);
        for n in 0..30 {
            client.call(STEP, n).await;
        }
        settle().await;
        client.half_close().await;
        settle().await;
        // It gets the results of its computations, one after the other.
        for _ in 0..3 {
            sleep(RESPONSES_TIME - Duration::from_secs(1)).await;
            computations.answer();
            settle().await;
        }
        assert_eq!(gateway.gauges.connections(), 1);
        let began = Instant::now();
        assert_eq!(client.rest().await.len(), 3);
        assert_elapsed(began, RESPONSES_TIME - Duration::from_millis(10));
        settle().await;
        assert_eq!(gateway.gauges.connections(), 0);
        assert!(computations.take().is_gone(), "it need not go on");
        assert_eq!(computations.count(), 0, "the next one is not begun");
        settle().await;
    });
}

#[test]
fn a_client_whose_queue_is_full_is_read_a_little_further_and_all_of_it_is_performed() {
    in_virtual_time(async {
        let (gateway, computations, _) = held_back().await;
        let mut client = gateway.connect(WIDE);
        let calls: u64 = 3000;
        for n in 0..calls {
            client.call(STEP, n).await;
        }
        settle().await;
        client.half_close().await;
        for n in 0..calls {
            settle().await;
            computations.answer();
            assert_eq!(id(&client.receive().await), n);
        }
        assert!(client.rest().await.is_empty());
    });
}

#[test]
fn a_half_closed_client_that_reads_nothing_is_let_go() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        // Responses wait: twenty seconds, as ever.
        let mut client = gateway.connect(64);
        client.call("/none", 1).await;
        client.half_close().await;
        sleep(STALL_LIMIT - Duration::from_secs(1)).await;
        let kept = client.rest().await;
        assert_eq!(kept.len(), 1, "what is read in time arrives whole");

        // Topic messages only: they are not owed for so long. The registry has let go of it at once.
        let (mut publisher, mut client) = (gateway.connect(WIDE), gateway.connect(64));
        client.subscribe("/t").await;
        publisher.advertise("/t").await;
        for n in 0..9 {
            publisher.publish("/t", n).await;
        }
        settle().await;
        client.half_close().await;
        sleep(LINGER + Duration::from_secs(1)).await;
        client.take(64).await;
        assert!(
            !client.hears_nothing_for(Duration::from_secs(1)).await,
            "the stream has ended"
        );
    });
}

#[test]
fn at_the_end_of_the_runtime_every_waiting_computation_is_refused_before_the_stream_ends() {
    in_virtual_time(async {
        let (gateway, computations, _) = held_back().await;
        let mut client = gateway.connect(WIDE);
        for n in 0..17 {
            client.call(STEP, n).await;
        }
        settle().await;
        gateway
            .registry
            .send(RefuseCalls("shutting down"))
            .await
            .unwrap();
        // The end overtakes the answer to the running one, as happens with a slow worker.
        gateway.registry.send(FinishAll).await.unwrap();
        settle().await;
        computations.take().refuse("shutting down");
        let frames = client.rest().await;
        assert_eq!(
            frames.iter().map(id).collect::<Vec<_>>(),
            (0..17).collect::<Vec<_>>()
        );
        assert!(
            frames
                .iter()
                .all(|frame| frame["status"] == "shutting down")
        );
    });
}

#[test]
fn at_the_end_of_the_runtime_forwarded_goals_have_their_results() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut server, mut client) = (gateway.connect(WIDE), gateway.connect(WIDE));
        server
            .send(json!({"op": "advertise_action", "action": "/a", "type": "t/A"}))
            .await;
        server.receive().await;
        for n in 0..3 {
            let goal = json!({"op": "send_action_goal", "action": "/a", "id": n, "args": {}});
            client.send(goal).await;
            server.receive().await;
        }
        let refuse = RefuseCalls("shutting down");
        gateway.registry.send(refuse).await.unwrap();
        gateway.registry.send(FinishAll).await.unwrap();
        let frames = client.rest().await;
        assert_eq!(frames.len(), 3);
        for (n, frame) in frames.iter().enumerate() {
            assert_eq!(
                (
                    &frame["op"],
                    &frame["id"],
                    &frame["status"],
                    &frame["values"]
                ),
                (
                    &json!("action_result"),
                    &json!(n),
                    &json!(6),
                    &json!("shutting down")
                )
            );
        }
    });
}

#[test]
fn at_the_end_of_the_runtime_forwarded_calls_are_refused_and_streams_end() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut client, mut provider) = (gateway.connect(WIDE), gateway.connect(WIDE));
        provider.provide("/s").await;
        client.call("/s", 1).await;
        provider.receive().await;
        gateway
            .registry
            .send(RefuseCalls("shutting down"))
            .await
            .unwrap();
        client.call("/s", 2).await;
        settle().await;
        gateway.registry.send(FinishAll).await.unwrap();
        let frames = client.rest().await;
        assert_eq!(frames.iter().map(id).collect::<Vec<_>>(), [1, 2]);
        assert!(
            frames
                .iter()
                .all(|frame| frame["status"] == "shutting down")
        );
        let mut late = gateway.connect(WIDE);
        let frames = late.rest().await;
        assert_eq!(frames.len(), 1);
        assert_eq!(frames[0]["msg"], "shutting down");
        provider.rest().await;
        settle().await;
        assert_eq!(gateway.gauges.connections(), 0);
    });
}

#[test]
fn a_foreign_client_gets_its_line_and_the_end_at_once() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut client = gateway.connect(WIDE);
        let began = Instant::now();
        client
            .send_text("POST / HTTP/1.1\r\n\r\n{\"op\":\"nonsense\"}\n")
            .await;
        assert_eq!(client.rest().await.len(), 1);
        assert_elapsed(began, Duration::ZERO);
        sleep(Duration::from_secs(2)).await;
        assert_eq!(gateway.gauges.connections(), 0);
    });
}
