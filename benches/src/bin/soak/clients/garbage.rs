//! Bytes that are no frames, and frames that are almost right.
//!
//! **Invariant:** garbage costs its sender error statuses and nothing else: the call after it is answered.

use std::rc::Rc;

use serde_json::{Value, json};

use crate::ledger::success;
use crate::wire::{Client, Door};
use crate::world::{Fault, World};

/// Bytes that mean something to a reader of JSON.
const SPICE: &[u8] = b"{}[]\",:\\0123456789-+.eEtfnNI \t\r\n\0\xff\xc3\xed\xa0";

/// Lines of random bytes, then a call.
pub async fn garbage(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let mut client = Client::connect(&world, "sender of garbage", Door::Tcp).await?;
    // The first bytes decide what is spoken, so the first frame is one.
    client.push_call(
        "/pid_controller/enable",
        json!({}),
        json!({}),
        true,
        success(),
    );
    client.settle(|_| Ok(())).await?;
    let mut bytes = Vec::new();
    for _ in 0..rng.usize(1..80) {
        let spicy = rng.bool();
        for _ in 0..rng.usize(1..400) {
            bytes.push(if spicy {
                SPICE[rng.usize(..SPICE.len())]
            } else {
                rng.u8(..)
            });
        }
        bytes.push(b'\n');
    }
    // All of that may have been white space.
    bytes.extend(b"garbage\n");
    world.count("bytes of garbage", bytes.len() as u64);
    client.send_bytes(&bytes).await?;
    client.push_call(
        "/pid_controller/enable",
        json!({}),
        json!({}),
        true,
        success(),
    );
    let mut complaints = 0;
    client
        .settle(|frame| {
            complaints += u64::from(frame["level"] == "error");
            Ok(())
        })
        .await?;
    world.count("complaints about garbage", complaints);
    if complaints == 0 {
        return Err(client.fault(format!(
            "no complaint about {} bytes of garbage",
            bytes.len()
        )));
    }
    Ok(())
}

/// Frames with some bytes changed; none of them is near one that moves the arm.
pub async fn mutants(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let mut client = Client::connect(&world, "sender of mutants", Door::Tcp).await?;
    client.push_call(
        "/pid_controller/enable",
        json!({}),
        json!({}),
        true,
        success(),
    );
    client.settle(|_| Ok(())).await?;
    let mut bytes = Vec::new();
    for _ in 0..rng.usize(1..60) {
        let mut frame = harmless(&world, &mut rng).to_string().into_bytes();
        for _ in 0..rng.usize(1..4) {
            let at = rng.usize(..frame.len());
            match rng.u8(..4) {
                0 => frame[at] = SPICE[rng.usize(..SPICE.len())],
                1 => frame.insert(at, SPICE[rng.usize(..SPICE.len())]),
                2 => drop(frame.remove(at)),
                _ => frame.truncate(at),
            }
            if frame.is_empty() {
                break;
            }
        }
        bytes.extend(frame);
        bytes.push(b'\n');
        world.count("mutated frames", 1);
    }
    client.send_bytes(&bytes).await?;
    // An answer to a mutant may carry any id; this one is known.
    client.push_call(
        "/pid_controller/enable",
        json!({}),
        json!({}),
        false,
        success(),
    );
    client.settle(|_| Ok(())).await
}

fn harmless(world: &World, rng: &mut fastrand::Rng) -> Value {
    let n = world.number();
    match rng.u8(..7) {
        0 => {
            json!({"op": "subscribe", "topic": format!("/soak/m{n}"), "throttle_rate": 5, "queue_length": 2, "id": "m"})
        }
        1 => json!({"op": "unsubscribe", "topic": "/soak/m", "id": "m"}),
        2 => {
            json!({"op": "advertise", "topic": format!("/soak/m{n}"), "type": "std_msgs/msg/String"})
        }
        3 => {
            json!({"op": "publish", "topic": "/soak/m", "msg": {"data": [1, 2.5, null, "t\u{fc}r"]}})
        }
        4 => {
            json!({"op": "advertise_service", "service": format!("/soak/m{n}"), "type": "std_srvs/srv/Empty"})
        }
        5 => {
            json!({"op": "service_response", "service": "/soak/m", "id": "pendularm:1", "values": {}, "result": true})
        }
        _ => json!({"op": "fragment", "id": "m", "data": "{\"op\":\"x\"}", "num": 0, "total": 2}),
    }
}
