//! The TCP connection to the arm: one JSON object per line.
//!
//! **Invariant:** a line is read after the previous one has been handled. Writes wait in bounded
//! buffers.

use std::time::Duration;

use actix::prelude::*;
use serde_json::{Value, json};
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader};
use tokio::net::TcpStream;
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::sync::mpsc;
use tokio::time::timeout;

use crate::report;

/// Time to connect and to authenticate.
const OPENING: Duration = Duration::from_secs(5);
/// An arm publishes its clock 60 times a second, paused or not. After this time without a message it counts as
/// disconnected.
const SILENCE: Duration = Duration::from_secs(10);
/// Longest line that is read. A run of `/study/rollout` with all its samples has some megabytes.
const MAX_LINE: u64 = 64 * 1024 * 1024;
/// Most frames that wait to be written.
const QUEUE: usize = 1024;
/// The id of the first call, whose answer shows that the arm accepts the client.
const GREETING: &str = "pendularm-ros2";

/// A received frame.
#[derive(Message)]
#[rtype(result = "()")]
pub(super) struct FrameReceived {
    /// Its connection.
    pub(super) link: u64,
    /// The frame.
    pub(super) frame: Value,
}

/// A connection has ended.
#[derive(Message)]
#[rtype(result = "()")]
pub(super) struct Ended {
    /// The connection.
    pub(super) link: u64,
    /// The reason.
    pub(super) why: String,
}

/// Connects and authenticates. From then on every frame is passed to `received`, and the end to `ended`. Lines in the
/// channel are written.
pub(super) async fn open(
    link: u64,
    address: String,
    token: Option<String>,
    received: Recipient<FrameReceived>,
    ended: Recipient<Ended>,
) -> Result<mpsc::Sender<String>, String> {
    let connecting = async {
        let stream = TcpStream::connect(&address).await;
        let stream = stream.map_err(|error| error.to_string())?;
        // Frames are small, and each one is awaited.
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
        let why = read(link, reader, &received).await;
        ended.do_send(Ended { link, why });
    });
    Ok(sender)
}

/// Sends the token and waits for the answer to a first call.
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

/// Passes on frames, and returns the reason for the end.
async fn read(
    link: u64,
    mut reader: BufReader<OwnedReadHalf>,
    received: &Recipient<FrameReceived>,
) -> String {
    loop {
        let frame = match timeout(SILENCE, next(&mut reader)).await {
            Ok(Ok(frame)) => frame,
            Ok(Err(why)) => return why,
            Err(_) => return "it sends nothing more".to_owned(),
        };
        if received.send(FrameReceived { link, frame }).await.is_err() {
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
        Ok(_) if !line.ends_with(b"\n") => Err("it closed the connection within a line".to_owned()),
        Ok(_) => serde_json::from_slice(&line).map_err(|error| format!("no JSON: {error}")),
    }
}

/// Writes queued lines. The reader detects the end of the connection.
async fn write(mut writer: OwnedWriteHalf, mut frames: mpsc::Receiver<String>) {
    while let Some(frame) = frames.recv().await {
        if let Err(error) = writer.write_all(frame.as_bytes()).await {
            report::say(&format!("the arm accepts nothing more: {error}"));
            return;
        }
    }
}
