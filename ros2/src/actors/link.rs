//! The TCP connection to the arm: one JSON object per line.
//!
//! **Invariant:** a line is read when the one before it has been taken. Writes wait in bounded buffers.

use std::time::Duration;

use actix::prelude::*;
use serde_json::{Value, json};
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader};
use tokio::net::TcpStream;
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::sync::mpsc;
use tokio::time::timeout;

use crate::report;

/// Time to connect and to be let in.
const OPENING: Duration = Duration::from_secs(5);
/// An arm publishes its clock 60 times a second, paused or not. A silence of this length means that it is gone.
const SILENCE: Duration = Duration::from_secs(10);
/// Longest line that is read; a run of `/study/rollout` with all its samples has some megabytes.
const MAX_LINE: u64 = 64 * 1024 * 1024;
/// Frames that may wait to be written.
const QUEUE: usize = 1024;
/// The id of the first call, whose answer says that the arm lets us in.
const GREETING: &str = "pendularm-ros2";

/// A frame that came.
#[derive(Message)]
#[rtype(result = "()")]
pub(super) struct Came {
    /// The connection that it came by.
    pub(super) link: u64,
    /// The frame.
    pub(super) frame: Value,
}

/// A connection has ended.
#[derive(Message)]
#[rtype(result = "()")]
pub(super) struct Ended {
    /// Which one.
    pub(super) link: u64,
    /// Why.
    pub(super) why: String,
}

/// Connects, is let in, and from then on hands every frame to `came`, and the end to `ended`. A line in the channel
/// is written.
pub(super) async fn open(
    link: u64,
    address: String,
    token: Option<String>,
    came: Recipient<Came>,
    ended: Recipient<Ended>,
) -> Result<mpsc::Sender<String>, String> {
    let connecting = async {
        let stream = TcpStream::connect(&address).await;
        let stream = stream.map_err(|error| error.to_string())?;
        // Frames are small, and each is waited for.
        stream
            .set_nodelay(true)
            .map_err(|error| error.to_string())?;
        let (reader, mut writer) = stream.into_split();
        let mut reader = BufReader::new(reader);
        greet(&mut reader, &mut writer, token).await?;
        Ok::<_, String>((reader, writer))
    };
    let opened = timeout(OPENING, connecting).await;
    let (reader, writer) = opened.map_err(|_| "it does not answer".to_owned())??;
    let (sender, receiver) = mpsc::channel(QUEUE);
    actix_rt::spawn(write(writer, receiver));
    actix_rt::spawn(async move {
        let why = read(link, reader, &came).await;
        ended.do_send(Ended { link, why });
    });
    Ok(sender)
}

/// Shows the token and waits for the answer to a first call.
async fn greet(
    reader: &mut BufReader<OwnedReadHalf>,
    writer: &mut OwnedWriteHalf,
    token: Option<String>,
) -> Result<(), String> {
    let auth = token.map(|token| json!({"op": "auth", "token": token}));
    let call = json!({"op": "call_service", "service": "/rosapi/get_ros_version", "id": GREETING});
    for frame in auth.into_iter().chain([call]) {
        let line = format!("{frame}\n");
        let written = writer.write_all(line.as_bytes()).await;
        written.map_err(|error| error.to_string())?;
    }
    let mut refusal = None;
    loop {
        let frame = match next(reader).await {
            Ok(frame) => frame,
            Err(why) => return Err(refusal.unwrap_or(why)),
        };
        let text = |name| frame.get(name).and_then(Value::as_str);
        match text("op") {
            Some("service_response") if text("id") == Some(GREETING) => return Ok(()),
            Some("status") => refusal = text("msg").map(str::to_owned),
            _ => {}
        }
    }
}

/// Hands over one frame after the other, and says why there are no more.
async fn read(link: u64, mut reader: BufReader<OwnedReadHalf>, came: &Recipient<Came>) -> String {
    loop {
        let frame = match timeout(SILENCE, next(&mut reader)).await {
            Ok(Ok(frame)) => frame,
            Ok(Err(why)) => return why,
            Err(_) => return "it has fallen silent".to_owned(),
        };
        if came.send(Came { link, frame }).await.is_err() {
            return "the gateway is busy".to_owned();
        }
    }
}

/// The next frame.
async fn next(reader: &mut BufReader<OwnedReadHalf>) -> Result<Value, String> {
    let mut line = Vec::new();
    let read = reader.take(MAX_LINE).read_until(b'\n', &mut line).await;
    match read {
        Err(error) => Err(error.to_string()),
        Ok(0) => Err("it has closed the connection".to_owned()),
        Ok(_) if !line.ends_with(b"\n") => Err("it broke off within a line".to_owned()),
        Ok(_) => serde_json::from_slice(&line).map_err(|error| format!("no JSON: {error}")),
    }
}

/// Writes what comes. The reader notices when the connection ends.
async fn write(mut writer: OwnedWriteHalf, mut frames: mpsc::Receiver<String>) {
    while let Some(frame) = frames.recv().await {
        if let Err(error) = writer.write_all(frame.as_bytes()).await {
            report::say(&format!("the arm takes nothing more: {error}"));
            return;
        }
    }
}
