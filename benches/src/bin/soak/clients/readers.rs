//! Clients that read slowly, late or never.
//!
//! **Invariant:** answers wait for a client that reads in the end; a client that takes nothing while they wait is
//! disconnected.

use std::rc::Rc;
use std::time::{Duration, Instant};

use serde_json::json;

use super::computing::push_integration;
use crate::wire::{Client, Door};
use crate::world::{Fault, World};

/// A receive buffer so small that a slow reader is felt at once.
const SMALL: u32 = 4096;
/// Answers of a hoarder: 100,000 steps are some 5 MB of JSON, so these are more than the 32 MiB that may wait.
const HOARD: usize = 8;
const HOARD_STEPS: u64 = 100_000;
/// The program disconnects a client that takes no byte for 20 s while answers wait; on a busy machine a little later.
const STALLED: Duration = Duration::from_secs(20);
const STALLED_AT_LAST: Duration = Duration::from_secs(8);

/// Subscribes to all frequent topics and reads a little now and then; the messages are in order and whole.
pub async fn slow(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let mut client =
        Client::with_buffer(&world, "slow reader", Door::any(&mut rng), Some(SMALL)).await?;
    for topic in ["/joint_states", "/tf", "/clock", "/diagnostics"] {
        client.push(&json!({"op": "subscribe", "topic": topic}));
    }
    client.flush().await?;
    let time = world
        .time_left()
        .min(Duration::from_millis(rng.u64(500..8000)));
    let until = tokio::time::Instant::now() + time;
    while tokio::time::Instant::now() < until && !client.is_over() {
        client.sip(rng.usize(1..3000));
        // Frames are cut and checked as they become whole.
        while !matches!(
            client.next(Duration::ZERO).await?,
            crate::wire::Came::Nothing | crate::wire::Came::End
        ) {}
        tokio::time::sleep(Duration::from_millis(rng.u64(20..300))).await;
    }
    Ok(())
}

/// Subscribes, asks, reads nothing at all, and goes.
pub async fn deaf(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let mut client = Client::with_buffer(&world, "deaf client", Door::Tcp, Some(SMALL)).await?;
    for topic in [
        "/joint_states",
        "/tf",
        "/clock",
        "/diagnostics",
        "/joint_trajectory",
    ] {
        client.push(&json!({"op": "subscribe", "topic": topic}));
    }
    for _ in 0..rng.usize(..200) {
        crate::questions::push_question(&mut client, &mut rng);
    }
    let bytes = client.take_out();
    client.send_deaf(&bytes, Duration::from_secs(2)).await;
    world.count("calls left behind", client.ledger.waiting() as u64);
    tokio::time::sleep(
        world
            .time_left()
            .min(Duration::from_millis(rng.u64(100..10_000))),
    )
    .await;
    if rng.bool() {
        client.reset();
    }
    Ok(())
}

/// Asks for more answers than may wait, reads none of them for a while, then all.
pub async fn hoard(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    if world.time_left() < Duration::from_secs(12) {
        return Ok(());
    }
    let mut client = Client::connect(&world, "hoarder", Door::any(&mut rng)).await?;
    for _ in 0..HOARD {
        push_integration(&mut client, &mut rng, HOARD_STEPS);
    }
    client.flush().await?;
    tokio::time::sleep(Duration::from_millis(rng.u64(2000..5000))).await;
    client.settle(|_| Ok(())).await
}

/// Asks for answers and takes none of them: it is disconnected, in time.
pub async fn stall(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    if world.time_left() < STALLED + STALLED_AT_LAST {
        return Ok(());
    }
    let mut client = Client::with_buffer(&world, "stalled client", Door::Tcp, Some(SMALL)).await?;
    // More than the buffers of both ends of a socket hold.
    for _ in 0..4 {
        push_integration(&mut client, &mut rng, HOARD_STEPS);
    }
    let bytes = client.take_out();
    client.send_deaf(&bytes, Duration::from_secs(2)).await;
    // A client stalls from the first answer on, and on a busy machine that takes its time.
    let spare = world.time_left().saturating_sub(STALLED + STALLED_AT_LAST);
    if !client.is_readable(Instant::now() + spare).await? {
        return Ok(());
    }
    tokio::time::sleep(STALLED + STALLED_AT_LAST).await;
    client.swallow(Duration::from_secs(2)).await?;
    world.count("calls left behind", client.ledger.waiting() as u64);
    world.count("stalled clients disconnected", 1);
    Ok(())
}
