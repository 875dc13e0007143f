//! Much at once: thousands of calls in one go, thousands of messages from client to client.
//!
//! **Invariant:** what is dropped may be missing, nothing comes out of order, and the newest always comes.

use std::rc::Rc;
use std::time::Duration;

use serde_json::{Value, json};

use crate::questions::push_question;
use crate::wire::{Came, Client, Door};
use crate::world::{Fault, PATIENCE, World};

/// Thousands of calls in one write, each answered in its turn.
pub async fn calls(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let mut client = Client::connect(&world, "caller in floods", Door::any(&mut rng)).await?;
    for _ in 0..rng.usize(500..3000) {
        push_question(&mut client, &mut rng);
    }
    client.settle(|_| Ok(())).await
}

/// One client publishes thousands of messages, others take them, at once or throttled or slowly.
pub async fn messages(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let topic = format!("/soak/flood/{}", world.number());
    let last = rng.u64(300..2500);
    let length = rng.usize(10..4000);
    // Gone in the end, or awake in the end: then it gets the newest at least.
    let vanishes = rng.bool();
    let mut takers = Vec::new();
    for _ in 0..rng.usize(1..4) {
        let mut taker = Client::connect(&world, "taker of a flood", Door::any(&mut rng)).await?;
        let extra = match rng.u8(..4) {
            0 => json!({"throttle_rate": rng.u32(1..100), "queue_length": rng.u32(1..20)}),
            _ => json!({}),
        };
        taker.subscribe(&topic, extra).await?;
        takers.push(take(taker, topic.clone(), last, length));
    }
    // One that reads nothing while what it should read fills its outbox, where the oldest go.
    let mut deaf =
        Client::with_buffer(&world, "deaf taker of a flood", Door::Tcp, Some(4096)).await?;
    deaf.subscribe(&topic, json!({})).await?;
    let publisher = Client::connect(&world, "publisher of a flood", Door::any(&mut rng)).await?;
    let publishing = publish(publisher, topic.clone(), last, length, rng);
    let (published, taken) = tokio::join!(publishing, all(takers));
    published.and(taken)?;
    if vanishes {
        return Ok(());
    }
    take(deaf, topic, last, length).await
}

/// All futures at once, ended by the first fault.
async fn all<F: Future<Output = Result<(), Fault>>>(futures: Vec<F>) -> Result<(), Fault> {
    let mut futures = futures.into_iter();
    let (first, second, third) = (futures.next(), futures.next(), futures.next());
    let one = |future: Option<F>| async move {
        match future {
            Some(future) => future.await,
            None => Ok(()),
        }
    };
    tokio::try_join!(one(first), one(second), one(third)).map(|_| ())
}

async fn publish(
    mut client: Client,
    topic: String,
    last: u64,
    length: usize,
    mut rng: fastrand::Rng,
) -> Result<(), Fault> {
    client.push(&json!({"op": "advertise", "topic": topic, "type": "soak_msgs/msg/Flood"}));
    for n in 0..=last {
        client.push(&json!({"op": "publish", "topic": topic, "msg": message(n, length)}));
        if n % 256 == 0 {
            client.flush().await?;
            tokio::time::sleep(Duration::from_millis(rng.u64(..4))).await;
        }
    }
    client.world.count("messages published", last + 1);
    push_question(&mut client, &mut rng);
    client.settle(|_| Ok(())).await?;
    client.push(&json!({"op": "unadvertise", "topic": topic}));
    client.flush().await
}

fn message(n: u64, length: usize) -> Value {
    let digit = char::from(b'a' + (n % 26) as u8);
    json!({"n": n, "content": String::from(digit).repeat(length)})
}

/// Reads up to the last message; the numbers rise and the content is as it was sent.
async fn take(mut client: Client, topic: String, last: u64, length: usize) -> Result<(), Fault> {
    let mut before: Option<u64> = None;
    let mut count = 0;
    while before != Some(last) {
        let frame = match client.next(PATIENCE).await? {
            Came::Other(frame) if frame["topic"] == topic.as_str() => frame,
            Came::Other(_) | Came::Answer(_) | Came::Binary => continue,
            Came::End | Came::Nothing => {
                return Err(client.fault(format!("after {before:?} of {last} nothing more came")));
            }
        };
        let n = frame["msg"]["n"].as_u64().unwrap_or(u64::MAX);
        if before.is_some_and(|before| n <= before) {
            return Err(client.fault(format!("message {n} after {before:?}")));
        }
        if frame["msg"] != message(n, length) {
            return Err(client.fault(format!("message {n} is not as it was published")));
        }
        before = Some(n);
        count += 1;
    }
    client.world.count("messages received", count);
    client
        .world
        .count("messages held back or dropped in floods", last + 1 - count);
    Ok(())
}
