//! `fragment` in both directions.
//!
//! **Invariant:** pieces make the frame that they were cut from, whatever else is begun and never finished.

use std::rc::Rc;

use serde_json::{Value, json};

use crate::questions::push_question;
use crate::wire::{Came, Client, Door};
use crate::world::{Fault, PATIENCE, World};

/// Calls in pieces, shuffled, some of them never finished; a long message in pieces.
pub async fn pieces(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let mut client = Client::connect(&world, "client in pieces", Door::Tcp).await?;
    // The program keeps eight unfinished ones; the one that is being sent must have its place.
    let mut begun = 0;
    for _ in 0..rng.usize(1..10) {
        client.flush().await?;
        push_question(&mut client, &mut rng);
        let mut frame = client.take_out();
        frame.pop();
        let text = String::from_utf8_lossy(&frame).into_owned();
        let mut all = cut(
            &text,
            rng.usize(8..80),
            &json!(format!("p{}", world.number())),
        );
        rng.shuffle(&mut all);
        for piece in all {
            client.push(&piece);
        }
        if begun < 6 && rng.bool() {
            begun += 1;
            let id = format!("b{}", world.number());
            client.push(
                &json!({"op": "fragment", "id": id, "data": "{\"op\":", "num": 0, "total": 3}),
            );
        }
    }
    client.settle(|_| Ok(())).await?;
    world.count("clients in pieces answered", 1);
    client.push(&json!({"op": "subscribe", "topic": "/robot_description", "fragment_size": 200}));
    client.flush().await?;
    let text = gather(&mut client).await?;
    let frame: Value = serde_json::from_str(&text)
        .map_err(|error| client.fault(format!("pieces of no JSON: {error}")))?;
    let urdf = frame["msg"]["data"].as_str().unwrap_or_default();
    if frame["topic"] != "/robot_description" || !urdf.contains("<robot") {
        return Err(client.fault("the pieces make no robot description"));
    }
    Ok(())
}

/// Cut into pieces of this many bytes; the text is ASCII.
fn cut(text: &str, size: usize, id: &Value) -> Vec<Value> {
    let chunks: Vec<&[u8]> = text.as_bytes().chunks(size).collect();
    let total = chunks.len();
    let piece = |(num, chunk)| {
        let data = String::from_utf8_lossy(chunk);
        json!({"op": "fragment", "id": id, "data": data, "num": num, "total": total})
    };
    chunks.into_iter().enumerate().map(piece).collect()
}

async fn gather(client: &mut Client) -> Result<String, Fault> {
    let mut text = String::new();
    let mut num = 0;
    loop {
        match client.next(PATIENCE).await? {
            Came::Other(frame) if frame["op"] == "fragment" => {
                let data = frame["data"].as_str().unwrap_or_default();
                if frame["num"] != num || data.is_empty() || data.len() > 200 {
                    return Err(client.fault(format!("not piece {num}: {frame}")));
                }
                client.world.count("pieces received", 1);
                text.push_str(data);
                num += 1;
                if frame["total"] == num {
                    return Ok(text);
                }
            }
            Came::Other(_) | Came::Answer(_) | Came::Binary => {}
            Came::End | Came::Nothing => return Err(client.fault(format!("no piece {num}"))),
        }
    }
}
