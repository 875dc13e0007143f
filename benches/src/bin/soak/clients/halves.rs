//! Sockets of which one side is closed, and clients that are gone in the middle of a frame.
//!
//! **Invariant:** whoever has stopped sending and still reads gets every answer, and then the end of the stream.

use std::rc::Rc;
use std::time::Duration;

use serde_json::json;

use super::computing::push_integration;
use crate::ledger::{anything, refusal};
use crate::questions::push_question;
use crate::wire::{Client, Door};
use crate::world::{Fault, World};

/// Stops sending, and then reads to the end, or goes, or stays silent for a while.
pub async fn half(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let mut client = Client::connect(&world, "half-open client", Door::Tcp).await?;
    if rng.bool() {
        client.subscribe("/joint_states", json!({})).await?;
    }
    for _ in 0..rng.usize(..30) {
        push_question(&mut client, &mut rng);
    }
    if rng.u8(..3) == 0 {
        push_integration(&mut client, &mut rng, 2000);
    }
    if rng.u8(..4) == 0 {
        // Its own provider, which can answer no more once it has stopped sending.
        let service = format!("/soak/half/{}", world.number());
        client.push(&json!({"op": "advertise_service", "service": service}));
        client.push_call(
            &service,
            json!({}),
            json!({}),
            false,
            refusal(service.clone()),
        );
    }
    if rng.u8(..4) == 0 {
        let mut bytes = client.take_out();
        bytes.extend(b"{\"op\":\"call_service\",\"service\":\"/arm_sim/reset\",\"args\":{");
        client.send_bytes(&bytes).await?;
    }
    client.flush().await?;
    client.shut_down().await?;
    world.count("sockets half closed", 1);
    match rng.u8(..3) {
        0 => client.read_to_end().await,
        1 => {
            tokio::time::sleep(Duration::from_millis(rng.u64(..1500))).await;
            client.read_to_end().await
        }
        _ => {
            world.count("calls left behind", client.ledger.waiting() as u64);
            Ok(())
        }
    }
}

/// Goes with a reset at any point of a frame.
pub async fn reset(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let door = Door::any(&mut rng);
    let mut client = Client::connect(&world, "client that resets", door).await?;
    if rng.bool() {
        client.subscribe("/joint_states", json!({})).await?;
    }
    client.push(&json!({"op": "advertise", "topic": format!("/soak/reset/{}", world.number())}));
    let service = format!("/soak/reset/{}", world.number());
    client.push(&json!({"op": "advertise_service", "service": service}));
    for _ in 0..rng.usize(..20) {
        push_question(&mut client, &mut rng);
    }
    // Its call to itself is never answered, and goes with it.
    client.push_call(&service, json!({}), json!({}), false, anything());
    let filler = "x".repeat(rng.usize(1..60_000));
    client.push(&json!({"op": "publish", "topic": "/soak/none", "msg": {"filler": filler}}));
    let mut bytes = client.take_out();
    bytes.truncate(rng.usize(1..=bytes.len()));
    client.send_deaf(&bytes, Duration::from_secs(2)).await;
    world.count("calls left behind", client.ledger.waiting() as u64);
    tokio::time::sleep(Duration::from_millis(rng.u64(..300))).await;
    client.reset();
    Ok(())
}
