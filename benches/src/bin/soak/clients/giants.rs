//! Frames at the limits: of length, and of nesting.
//!
//! **Invariant:** what is within the limit arrives as it was sent, what is beyond costs one error status; then calls work.

use std::rc::Rc;

use serde_json::{Value, json};

use crate::questions::push_question;
use crate::wire::{Came, Client, Door};
use crate::world::{Fault, PATIENCE, World};

/// Longest frame that the program takes.
const MAX_FRAME: usize = 4 * 1024 * 1024;

/// A message of almost 4 MiB to itself, or a frame that is longer than that.
pub async fn giant(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let door = Door::any(&mut rng);
    let mut client = Client::connect(&world, "sender of giants", door).await?;
    let topic = format!("/soak/giant/{}", world.number());
    client.subscribe(&topic, json!({})).await?;
    client.push(&json!({"op": "advertise", "topic": topic}));
    if rng.u8(..3) > 0 {
        let length = MAX_FRAME - rng.usize(200..100_000);
        let content = String::from(char::from(rng.alphanumeric() as u8)).repeat(length);
        client.push(&json!({"op": "publish", "topic": topic, "msg": {"content": content}}));
        client.flush().await?;
        let message = next_message(&mut client, &topic).await?;
        if message["content"] != content.as_str() {
            return Err(client.fault("a giant message is not as it was published"));
        }
        world.count("giant frames delivered", 1);
    } else if door == Door::Tcp {
        client.flush().await?;
        let length = MAX_FRAME + rng.usize(1..3_000_000);
        client.push_text(&format!(
            "{{\"op\":\"publish\",\"id\":\"{}\"}}",
            "y".repeat(length)
        ));
        client.flush().await?;
        expect_error(&mut client).await?;
        world.count("giant frames refused", 1);
    }
    for _ in 0..3 {
        push_question(&mut client, &mut rng);
    }
    client.settle(|_| Ok(())).await
}

async fn next_message(client: &mut Client, topic: &str) -> Result<Value, Fault> {
    loop {
        match client.next(PATIENCE).await? {
            Came::Other(frame) if frame["topic"] == topic => return Ok(frame["msg"].clone()),
            Came::Other(frame) if frame["level"] == "error" => {
                return Err(client.fault(format!("refused: {frame}")));
            }
            Came::Other(_) | Came::Answer(_) | Came::Binary => {}
            Came::End => return Err(client.fault("the connection ends before the message")),
            Came::Nothing => return Err(client.fault("the message does not come")),
        }
    }
}

async fn expect_error(client: &mut Client) -> Result<(), Fault> {
    match client.next(PATIENCE).await? {
        Came::Other(frame) if frame["level"] == "error" => Ok(()),
        Came::Other(frame) => Err(client.fault(format!("expected an error status, got {frame}"))),
        _ => Err(client.fault("no error status")),
    }
}

/// Arrays in arrays: so deep that they are refused, or just not.
pub async fn deep(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let mut client = Client::connect(&world, "sender of deep frames", Door::any(&mut rng)).await?;
    for _ in 0..rng.usize(1..5) {
        let depth = rng.usize(200..200_000);
        let closed = rng.bool();
        let end = if closed {
            "]".repeat(depth) + "}"
        } else {
            String::new()
        };
        client.push_text(&format!(
            "{{\"op\":\"publish\",\"msg\":{}{end}",
            "[".repeat(depth)
        ));
        client.flush().await?;
        expect_error(&mut client).await?;
        world.count("deep frames refused", 1);
    }
    let topic = format!("/soak/deep/{}", world.number());
    client.subscribe(&topic, json!({})).await?;
    client.push(&json!({"op": "advertise", "topic": topic}));
    let content = format!("{}1{}", "[".repeat(90), "]".repeat(90));
    client.push_text(&format!(
        "{{\"op\":\"publish\",\"topic\":\"{topic}\",\"msg\":{{\"content\":{content}}}}}"
    ));
    client.flush().await?;
    let message = next_message(&mut client, &topic).await?;
    let arrived = message["content"].to_string();
    if arrived != content {
        return Err(client.fault("a deep message is not as it was published"));
    }
    push_question(&mut client, &mut rng);
    client.settle(|_| Ok(())).await
}
