//! Clients as they should be: they ask, they listen for a while, they leave.
//!
//! **Invariant:** every call of theirs is answered.

use std::rc::Rc;
use std::time::Duration;

use serde_json::{Value, json};

use crate::questions::push_question;
use crate::wire::{Came, Client, Door};
use crate::world::{Fault, World};

/// Topics of the runtime that a visitor listens to; each sends something within the second or at once.
const TOPICS: [&str; 6] = [
    "/joint_states",
    "/clock",
    "/tf",
    "/diagnostics",
    "/robot_description",
    "/arm_sim/error_estimate",
];
/// Clients of a crowd: a class of students and their screens.
const CROWD: usize = 40;

/// Asks a few things, listens to a topic, leaves in one of several ways.
pub async fn visit(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let door = Door::any(&mut rng);
    let mut client = Client::connect(&world, "visitor", door).await?;
    for _ in 0..rng.usize(0..12) {
        push_question(&mut client, &mut rng);
    }
    if rng.u8(..4) == 0 {
        refused_setpoint(&mut client).await?;
    }
    client.settle(|_| Ok(())).await?;
    if rng.u8(..3) > 0 {
        listen(&mut client, &mut rng).await?;
    }
    for _ in 0..rng.usize(0..4) {
        push_question(&mut client, &mut rng);
    }
    match rng.u8(..3) {
        0 => client.settle(|_| Ok(())).await?,
        // Over WebSocket an end without a word is a break, after which nothing is owed.
        1 if door == Door::Tcp => {
            client.flush().await?;
            client.shut_down().await?;
            client.read_to_end().await?;
        }
        // Gone without a look at the answers.
        _ => {
            client.flush().await?;
            world.count("calls left behind", client.ledger.waiting() as u64);
        }
    }
    Ok(())
}

/// A setpoint of the wrong length comes back as an error status and moves nothing.
async fn refused_setpoint(client: &mut Client) -> Result<(), Fault> {
    let id = json!({"setpoint": client.world.number()});
    let msg = json!({"points": [{"positions": [1, 2, 3, 4, 5]}]});
    client.push(&json!({"op": "publish", "topic": "/joint_trajectory", "msg": msg, "id": id}));
    client.flush().await?;
    let status = client.status(&id).await?;
    if status["level"] != "error" {
        return Err(client.fault(format!("a setpoint of five joints: {status}")));
    }
    Ok(())
}

async fn listen(client: &mut Client, rng: &mut fastrand::Rng) -> Result<(), Fault> {
    let topic = TOPICS[rng.usize(..TOPICS.len())];
    let binary = client.door() == Door::Web && rng.u8(..3) == 0;
    let extra = match rng.u8(..3) {
        _ if binary => json!({"compression": if rng.bool() { "cbor" } else { "cbor-raw" }}),
        0 => json!({"throttle_rate": rng.u32(0..200), "queue_length": rng.u32(0..5)}),
        _ => json!({}),
    };
    client.subscribe(topic, extra).await?;
    let most = if topic == "/robot_description" {
        1
    } else {
        rng.usize(1..60)
    };
    let until = tokio::time::Instant::now() + Duration::from_secs(3);
    for heard in 0..most {
        if tokio::time::Instant::now() > until {
            break;
        }
        match client.next(Duration::from_secs(10)).await? {
            Came::Other(frame) if is_message(&frame, topic) && !binary => {
                client.world.count("messages received", 1);
            }
            Came::Binary if binary => client.world.count("messages received as CBOR", 1),
            Came::Other(frame) => return Err(client.fault(format!("unasked: {frame}"))),
            Came::Binary => return Err(client.fault("unasked bytes")),
            Came::Answer(_) => {}
            Came::End | Came::Nothing => {
                return Err(client.fault(format!("{topic} fell silent after {heard} messages")));
            }
        }
    }
    if rng.bool() {
        client.push(&json!({"op": "unsubscribe", "topic": topic}));
        client.flush().await?;
    }
    Ok(())
}

fn is_message(frame: &Value, topic: &str) -> bool {
    frame["op"] == "publish" && frame["topic"] == topic && frame["msg"].is_object()
}

/// Many clients at the same moment, one question each.
pub async fn crowd(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let mut clients = Vec::new();
    for _ in 0..CROWD {
        clients.push(Client::connect(&world, "one of a crowd", Door::any(&mut rng)).await?);
    }
    for client in &mut clients {
        push_question(client, &mut rng);
        client.flush().await?;
    }
    for client in &mut clients {
        client.settle(|_| Ok(())).await?;
    }
    Ok(())
}

/// Sends its frames in crumbs, with line ends of all kinds, or none.
pub async fn dribble(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let mut client = Client::connect(&world, "dribbler", Door::Tcp).await?;
    let mut bytes = Vec::new();
    for _ in 0..rng.usize(1..15) {
        push_question(&mut client, &mut rng);
        let mut frame = client.take_out();
        frame.pop();
        bytes.extend(frame);
        let ends: [&[u8]; 4] = [b"", b"\n", b"\r\n", b"\n \n\n"];
        bytes.extend(ends[rng.usize(..ends.len())]);
    }
    let pause = Duration::from_millis(rng.u64(..20));
    let most = if rng.bool() { 5 } else { 200 };
    // A byte at a time would take minutes; the last crumbs go at once.
    let mut crumbs = 0;
    while !bytes.is_empty() {
        let crumb = if crumbs < 100 {
            rng.usize(1..=most).min(bytes.len())
        } else {
            bytes.len()
        };
        let rest = bytes.split_off(crumb);
        client.send_bytes(&bytes).await?;
        bytes = rest;
        crumbs += 1;
        tokio::time::sleep(pause).await;
    }
    client.settle(|_| Ok(())).await
}
