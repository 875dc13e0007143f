//! Calls, goals and registrations that end by thousands at one instant: everybody else has a turn meanwhile.
//!
//! **Invariant:** what still waits is told by the memory that is counted for it.

use std::time::Duration;

use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, Peer, WIDE};
use pendularm::actors::gateway::limits::{
    CALL_BYTES, MAX_ADVERTISED, MAX_PROVIDED, MAX_SUBSCRIPTIONS, MAX_WAITING_CALLS,
    MAX_WAITING_GOALS, REGISTRATION_BYTES,
};
use serde_json::{Value, json};

const CLIENTS: usize = 8;

/// Each of eight clients sends `frame` as often as it may; then `end` ends all of that. When the first client hears of
/// the first end, most have not ended yet, and in the end everybody has heard of each once.
fn assert_ends_in_turns(
    each: usize,
    frame: impl Fn(usize) -> Value,
    end: impl AsyncFnOnce(Peer),
    is_end: impl Fn(&Value) -> bool,
) {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut provider = gateway.connect(WIDE);
        provider.provide("/s").await;
        provider
            .send(json!({"op": "advertise_action", "action": "/a", "type": "t/A"}))
            .await;
        provider.receive().await;
        let mut clients: Vec<Peer> = (0..CLIENTS).map(|_| gateway.connect(WIDE)).collect();
        for client in &mut clients {
            for n in 0..each {
                client.send(frame(n)).await;
            }
        }
        for _ in 0..CLIENTS * each {
            provider.receive().await;
        }
        let memory = gateway.gauges.memory();
        let all = memory.held();
        assert!(all > CLIENTS * each * CALL_BYTES, "{all}");
        end(provider).await;
        let first = clients[0].receive().await;
        let left = memory.held();
        assert!(left > all * 3 / 4, "{left} of {all} when one has heard");
        let mut first = Some(first);
        for client in &mut clients {
            for n in 0..each {
                let ended = match first.take() {
                    Some(first) => first,
                    None => client.receive().await,
                };
                assert!(is_end(&ended), "{ended}");
                assert_eq!(ended["id"], n, "each once, in order");
            }
        }
    });
}

fn call(n: usize) -> Value {
    json!({"op": "call_service", "service": "/s", "id": n, "timeout": 60})
}

fn failed(response: &Value, why: &str) -> bool {
    response["result"] == false && response["status"].as_str().unwrap().contains(why)
}

#[test]
fn calls_whose_provider_goes() {
    let gone = |response: &Value| failed(response, "gone");
    assert_ends_in_turns(
        MAX_WAITING_CALLS,
        call,
        async |provider| drop(provider),
        gone,
    );
}

#[test]
fn calls_whose_time_is_over() {
    let at_once = async |_: Peer| tokio::time::advance(Duration::from_secs(61)).await;
    let late = |response: &Value| failed(response, "timeout");
    assert_ends_in_turns(MAX_WAITING_CALLS, call, at_once, late);
}

#[test]
fn goals_whose_action_server_goes() {
    let goal = |n| json!({"op": "send_action_goal", "action": "/a", "action_type": "t/A", "id": n, "args": {}});
    let aborted = |result: &Value| result["op"] == "action_result" && result["status"] == 6;
    assert_ends_in_turns(
        MAX_WAITING_GOALS,
        goal,
        async |provider| drop(provider),
        aborted,
    );
}

/// Eight clients that have registered all they may leave together: who calls then is answered while most of that still
/// stands, nobody is sent what only they would take, and in the end all of it is given back.
#[test]
fn registrations_of_those_who_leave() {
    let services = MAX_PROVIDED / 2;
    let registrations = |n: usize| {
        let topics =
            (0..MAX_SUBSCRIPTIONS).map(|i| json!({"op": "subscribe", "topic": format!("/t{i}")}));
        let advertised = (0..MAX_ADVERTISED)
            .map(move |i| json!({"op": "advertise", "topic": format!("/c{n}/{i}"), "type": "t/A"}));
        let provided = (0..services)
            .map(move |i| json!({"op": "advertise_service", "service": format!("/c{n}/{i}"), "type": "t/A"}));
        let pursued = (0..services)
            .map(move |i| json!({"op": "advertise_action", "action": format!("/c{n}/{i}"), "type": "t/A"}));
        topics.chain(advertised).chain(provided).chain(pursued)
    };
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut observer = gateway.connect(WIDE);
        let memory = gateway.gauges.memory();
        let at_first = memory.held();
        let mut clients: Vec<Peer> = (0..CLIENTS).map(|_| gateway.connect(WIDE)).collect();
        for (n, client) in clients.iter_mut().enumerate() {
            client
                .send(json!({"op": "set_level", "level": "none"}))
                .await;
            for frame in registrations(n) {
                client.send(frame).await;
            }
            client
                .send(json!({"op": "call_service", "service": "/none"}))
                .await;
            while client.receive().await["op"] != "service_response" {}
        }
        let all = memory.held();
        let each = MAX_SUBSCRIPTIONS + MAX_ADVERTISED + 2 * services;
        assert!(all > CLIENTS * each * REGISTRATION_BYTES, "{all}");
        drop(clients);
        // Its way through the gateway is some eight turns long.
        observer
            .send(json!({"op": "call_service", "service": "/c0/0"}))
            .await;
        let response = observer.receive().await;
        assert!(failed(&response, "/c0/0"), "{response}");
        let left = memory.held();
        assert!(
            left > all / 2,
            "{left} of {all} when one call has been answered"
        );
        tokio::time::advance(Duration::from_secs(1)).await;
        for n in 0..each {
            observer
                .send(json!({"op": "call_service", "service": "/none", "id": n}))
                .await;
            observer.receive().await;
        }
        let after = memory.held();
        assert!(
            after < at_first + 100_000,
            "{after} held, {at_first} at first"
        );
    });
}

/// Who has stopped sending is still spoken with, and can answer nothing: what it provided is unknown at once.
#[test]
fn services_and_actions_of_who_has_stopped_sending() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut caller = gateway.connect(WIDE);
        let mut provider = gateway.connect(WIDE);
        provider
            .send(json!({"op": "set_level", "level": "none"}))
            .await;
        for n in 0..MAX_SUBSCRIPTIONS {
            provider
                .send(json!({"op": "subscribe", "topic": format!("/t{n}")}))
                .await;
        }
        provider
            .send(json!({"op": "advertise_service", "service": "/s", "type": "t/S"}))
            .await;
        provider
            .send(json!({"op": "advertise_action", "action": "/a", "type": "t/A"}))
            .await;
        provider.half_close().await;
        caller.send(call(1)).await;
        let response = caller.receive().await;
        assert!(failed(&response, "/s"), "{response}");
        caller
            .send(json!({"op": "send_action_goal", "action": "/a", "action_type": "t/A", "id": 2}))
            .await;
        let result = caller.receive().await;
        assert_eq!(
            (&result["id"], &result["status"]),
            (&json!(2), &json!(0)),
            "{result}"
        );
    });
}
