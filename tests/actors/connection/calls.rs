//! Calls one after the other, and the queue of computations.

use super::*;
use pendularm::actors::gateway::limits::{MAX_COMPUTATIONS_WAITING, MAX_RESPONSES_WAITING};

#[test]
fn the_next_frame_is_taken_only_when_the_last_call_has_ended() {
    in_virtual_time(async {
        let (gateway, _, calls) = held_back().await;
        let mut client = gateway.connect(WIDE);
        client.call(PARAMS, 1).await;
        client.call(PARAMS, 2).await;
        client.call("/none", 3).await;
        settle().await;
        assert_eq!(calls.count(), 1);
        let mut reply = calls.take();
        reply.succeed(&json!({}));
        assert_eq!(id(&client.receive().await), 1);
        assert!(client.hears_nothing_for(Duration::from_secs(60)).await);
        assert_eq!(
            calls.count(),
            0,
            "answered, but not ended: its effects may follow"
        );
        drop(reply);
        settle().await;
        calls.answer();
        assert_eq!(id(&client.receive().await), 2);
        assert_eq!(id(&client.receive().await), 3);
    });
}

#[test]
fn a_call_that_its_node_drops_is_answered_all_the_same() {
    in_virtual_time(async {
        let (gateway, computations, calls) = held_back().await;
        let mut client = gateway.connect(WIDE);
        for (service, held) in [(PARAMS, &calls), (STEP, &computations)] {
            client.call(service, 1).await;
            settle().await;
            drop(held.take());
            let response = client.receive().await;
            assert_eq!(response["result"], false, "{response}");
            assert_eq!(response["id"], 1);
            assert_ne!(response["status"], "");
        }
    });
}

#[test]
fn one_computation_runs_sixteen_wait_and_then_nothing_more_is_read() {
    in_virtual_time(async {
        let (gateway, computations, calls) = held_back().await;
        let mut client = gateway.connect(WIDE);
        // One runs, and one place in the queue is left: another call is still taken.
        for n in 0..16 {
            client.call(STEP, n).await;
        }
        client.call(PARAMS, 100).await;
        settle().await;
        assert_eq!((computations.count(), calls.count()), (1, 1));
        calls.answer();
        assert_eq!(id(&client.receive().await), 100);
        // The queue is full: the call behind it waits in the pipe.
        client.call(STEP, 16).await;
        client.call(PARAMS, 101).await;
        sleep(Duration::from_secs(60)).await;
        assert_eq!((computations.count(), calls.count()), (1, 0));
        computations.answer();
        assert_eq!(id(&client.receive().await), 0);
        settle().await;
        assert_eq!((computations.count(), calls.count()), (1, 1));
        calls.answer();
        assert_eq!(id(&client.receive().await), 101);
        for n in 1..17 {
            computations.answer();
            assert_eq!(id(&client.receive().await), n);
            settle().await;
        }
        assert_eq!(MAX_COMPUTATIONS_WAITING, 16);
    });
}

#[test]
fn computations_of_one_connection_hold_up_no_other() {
    in_virtual_time(async {
        let (gateway, computations, calls) = held_back().await;
        let (mut heavy, mut other) = (gateway.connect(WIDE), gateway.connect(WIDE));
        for n in 0..40 {
            heavy.call(STEP, n).await;
        }
        other.call(STEP, 7).await;
        other.call(PARAMS, 8).await;
        settle().await;
        assert_eq!(
            (computations.count(), calls.count()),
            (2, 1),
            "one of each connection runs"
        );
    });
}

#[test]
fn while_more_than_32_mebibytes_wait_no_computation_starts_and_nothing_is_read() {
    in_virtual_time(async {
        let (gateway, computations, calls) = held_back().await;
        let mut client = gateway.connect(1024);
        for n in 0..2 {
            client.call(STEP, n).await;
        }
        client.call(PARAMS, 2).await;
        settle().await;
        calls.take().refuse("");
        let blob = "x".repeat(MAX_RESPONSES_WAITING + 4096);
        let mut reply = computations.take();
        reply.succeed(&blob);
        drop(reply);
        settle().await;
        client.call(PARAMS, 3).await;
        sleep(Duration::from_secs(15)).await;
        assert_eq!(
            computations.count(),
            0,
            "the next computation waits for room"
        );
        assert_eq!(calls.count(), 0, "the next frame too");
        // A little is taken: now what waits is less than 32 MiB.
        client.take(8192).await;
        settle().await;
        assert_eq!((computations.count(), calls.count()), (1, 1));
    });
}
