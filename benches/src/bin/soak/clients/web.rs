//! HTTP requests, right and wrong, and WebSocket clients that break the protocol.
//!
//! **Invariant:** whatever is asked over HTTP is answered or closed within the program's own limits.

use std::rc::Rc;
use std::time::Duration;

use serde_json::json;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::time::timeout;

use crate::questions::push_question;
use crate::wire::{Client, Door};
use crate::world::{Fault, PATIENCE, World};
use pendularm_client::websocket::{LAST, append, append_close, opcode};

/// HTTP's status for those who take too long, and the README's word for it.
const HEAD_TIME: Duration = Duration::from_secs(5);

/// The mask where any will do.
const MASK: [u8; 4] = [0, 0, 0, 1];

fn mask(rng: &mut fastrand::Rng) -> [u8; 4] {
    rng.u32(..).to_be_bytes()
}

/// One request or the beginning of one.
pub async fn requests(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let host = world.address;
    let right =
        |path: &str| format!("GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n");
    let long = format!(
        "GET / HTTP/1.1\r\nHost: {host}\r\nX: {}\r\n\r\n",
        "y".repeat(20_000)
    );
    let cases = [
        (right("/"), "HTTP/1.1 200 "),
        (right("/?a=b&c=%20"), "HTTP/1.1 200 "),
        (right("/nothing/here"), "HTTP/1.1 404 "),
        (right("/../../etc/passwd"), "HTTP/1.1 404 "),
        (
            "GET / HTTP/1.1\r\nHost: elsewhere.example\r\n\r\n".to_owned(),
            "HTTP/1.1 403 ",
        ),
        (long, "HTTP/1.1 431 "),
        (
            "POST / HTTP/1.1\r\nContent-Length: 2\r\n\r\n{}".to_owned(),
            "",
        ),
        ("\u{16}\u{3}\u{1}\u{2}\u{0}hello".to_owned(), ""),
        ("\u{20}\u{0}\u{0}\u{0}document".to_owned(), ""),
        ("GET / HTTP/1.1\r\nHost: ".to_owned(), "HTTP/1.1 408 "),
    ];
    let (request, expected) = &cases[rng.usize(..cases.len())];
    world.count("HTTP requests and the like", 1);
    let shown = request.chars().take(60).collect::<String>();
    let fault = |what: String| Fault::of("HTTP client", format!("{what}, to {shown:?}"));
    let answer = exchange(&world, request.as_bytes()).await.map_err(fault)?;
    let told = answer.starts_with(expected.as_bytes());
    if !told || answer.is_empty() {
        let answer = String::from_utf8_lossy(&answer[..answer.len().min(200)]).into_owned();
        return Err(fault(format!("expected {expected:?}, got {answer:?}")));
    }
    Ok(())
}

/// Sends, and reads to the end of the stream.
async fn exchange(world: &World, request: &[u8]) -> Result<Vec<u8>, String> {
    let mut answer = Vec::new();
    let exchanging = async {
        let mut stream = TcpStream::connect(world.address).await?;
        world.count("connections", 1);
        stream.write_all(request).await?;
        stream.read_to_end(&mut answer).await
    };
    match timeout(HEAD_TIME + PATIENCE, exchanging).await {
        Ok(Ok(_)) => Ok(answer),
        Ok(Err(error)) => Err(error.to_string()),
        Err(_) => Err("the stream does not end".to_owned()),
    }
}

/// A WebSocket that does something it may, and then something it may not.
pub async fn broken(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let mut client = Client::connect(&world, "broken WebSocket", Door::Web).await?;
    for _ in 0..rng.usize(..5) {
        push_question(&mut client, &mut rng);
    }
    let mut out = client.take_out();
    append(
        &mut out,
        LAST | opcode::PING,
        mask(&mut rng),
        b"are you there",
    );
    split_frame(&mut client, &mut out, &mut rng);
    client.send_bytes(&out).await?;
    client.settle(|_| Ok(())).await?;
    let filler = vec![b'z'; rng.usize(1..30_000)];
    let mut end = Vec::new();
    match rng.u8(..6) {
        // Not masked, of a kind that does not exist, longer than may be, no UTF-8: closed by the program.
        0 => end.extend([0x81, 2, b'{', b'}']),
        1 => append(&mut end, LAST | 5, MASK, b"?"),
        2 => end.extend([0x81, 0xff, 0, 0, 0, 0, 0x7f, 0xff, 0xff, 0xff, 1, 2, 3, 4]),
        3 => append(&mut end, LAST | opcode::TEXT, MASK, b"\xff\xfe{}"),
        // An orderly end.
        4 => append_close(&mut end, MASK, 1000, ""),
        // Gone in the middle of a frame.
        _ => {
            append(&mut end, LAST | opcode::TEXT, MASK, &filler);
            end.truncate(end.len() - 1);
            client.send_deaf(&end, Duration::from_secs(2)).await;
            if rng.bool() {
                client.reset();
            }
            return Ok(());
        }
    }
    client.send_bytes(&end).await?;
    client.swallow(PATIENCE).await?;
    world.count("WebSockets closed by the program", 1);
    Ok(())
}

/// A call in several WebSocket frames, with a ping between them.
fn split_frame(client: &mut Client, out: &mut Vec<u8>, rng: &mut fastrand::Rng) {
    let n = client.world.number();
    let id = json!(format!("split {n}"));
    let check = crate::ledger::refusal(format!("/soak/split/{n}"));
    client
        .ledger
        .ask(&id, &format!("/soak/split/{n}"), true, check);
    client.world.count("calls asked", 1);
    let text =
        json!({"op": "call_service", "service": format!("/soak/split/{n}"), "id": id}).to_string();
    let (first, rest) = text.as_bytes().split_at(rng.usize(..text.len()));
    append(out, opcode::TEXT, mask(rng), first);
    append(out, LAST | opcode::PING, mask(rng), b"");
    append(out, LAST | opcode::CONTINUATION, mask(rng), rest);
}
