//! Subscriptions and advertisements by the hundred, made and withdrawn.
//!
//! **Invariant:** each subscription is confirmed once, under its id; a withdrawn one gives nothing.

use std::collections::BTreeSet;
use std::rc::Rc;

use serde_json::{Value, json};

use crate::questions::push_question;
use crate::wire::{Came, Client, Door};
use crate::world::{Fault, PATIENCE, World};

const TOPICS: [&str; 8] = [
    "/joint_states",
    "/clock",
    "/diagnostics",
    "/tf",
    "/tf_static",
    "/robot_description",
    "/arm_sim/error_estimate",
    "/ik_trial/status",
];

/// Subscribes and unsubscribes hundreds of times, to the runtime's topics and to clients'.
pub async fn subscriptions(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let mut client = Client::connect(&world, "storming subscriber", Door::any(&mut rng)).await?;
    let mut unconfirmed = BTreeSet::new();
    for _ in 0..rng.usize(50..600) {
        let at = rng.usize(..16);
        let topic = TOPICS
            .get(at)
            .map_or_else(|| format!("/soak/storm/{at}"), |name| (*name).into());
        if rng.u8(..5) < 3 {
            let id = format!("s{}", world.number());
            unconfirmed.insert(id.clone());
            let throttle = rng.u32(0..50);
            client.push(
                &json!({"op": "subscribe", "topic": topic, "id": id, "throttle_rate": throttle}),
            );
        } else {
            client.push(&json!({"op": "unsubscribe", "topic": topic}));
        }
    }
    world.count("subscriptions in storms", unconfirmed.len() as u64);
    push_question(&mut client, &mut rng);
    client
        .settle(|frame| confirm(frame, &mut unconfirmed))
        .await?;
    // The answer to a later call came, so all of these should have.
    if !unconfirmed.is_empty() {
        return Err(client.fault(format!(
            "{} subscriptions are not confirmed",
            unconfirmed.len()
        )));
    }
    for topic in TOPICS {
        client.push(&json!({"op": "unsubscribe", "topic": topic}));
    }
    push_question(&mut client, &mut rng);
    client.settle(|_| Ok(())).await?;
    match client.next(std::time::Duration::from_millis(100)).await? {
        Came::Nothing => Ok(()),
        Came::Other(frame) => Err(client.fault(format!("unsubscribed, and still got {frame}"))),
        _ => Err(client.fault("unsubscribed, and something else happened")),
    }
}

fn confirm(frame: &Value, unconfirmed: &mut BTreeSet<String>) -> Result<(), String> {
    if frame["op"] != "status" {
        return Ok(());
    }
    let id = frame["id"].as_str().unwrap_or_default();
    if frame["level"] == "info" && unconfirmed.remove(id) {
        return Ok(());
    }
    Err(format!("a confirmation too many: {frame}"))
}

/// Advertises, publishes and withdraws topics; a publish without an advertisement reaches nobody.
pub async fn topics(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let mut listener = Client::connect(&world, "listener of a churn", Door::any(&mut rng)).await?;
    let mut client = Client::connect(&world, "churning publisher", Door::any(&mut rng)).await?;
    let base = format!("/soak/churn/{}", world.number());
    let names: Vec<String> = (0..rng.usize(1..8))
        .map(|at| format!("{base}/{at}"))
        .collect();
    for name in &names {
        listener.subscribe(name, json!({})).await?;
    }
    let mut advertised = vec![false; names.len()];
    let mut expected = Vec::new();
    for n in 0..rng.u64(20..400) {
        let at = rng.usize(..names.len());
        match rng.u8(..4) {
            0 => {
                advertised[at] = true;
                client.push(
                    &json!({"op": "advertise", "topic": names[at], "type": "std_msgs/msg/UInt64"}),
                );
            }
            1 => {
                advertised[at] = false;
                client.push(&json!({"op": "unadvertise", "topic": names[at]}));
            }
            _ => {
                client.push(&json!({"op": "publish", "topic": names[at], "msg": {"data": n}}));
                if advertised[at] {
                    expected.push((names[at].clone(), n));
                }
            }
        }
    }
    world.count("messages published", expected.len() as u64);
    push_question(&mut client, &mut rng);
    client.settle(|_| Ok(())).await?;
    for (topic, n) in expected {
        match listener.next(PATIENCE).await? {
            Came::Other(frame) if frame["topic"] == topic.as_str() && frame["msg"]["data"] == n => {
            }
            Came::Other(frame) => {
                return Err(listener.fault(format!("expected {n} on {topic}, got {frame}")));
            }
            _ => return Err(listener.fault(format!("expected {n} on {topic}, got nothing"))),
        }
        world.count("messages received", 1);
    }
    match listener.next(std::time::Duration::from_millis(50)).await? {
        Came::Nothing => Ok(()),
        _ => Err(listener.fault("a message that was published without an advertisement")),
    }
}
