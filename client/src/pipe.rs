//! A client on an asynchronous stream, such as an in-memory pipe, for tests in virtual time.

use std::time::Duration;

use serde_json::{Value, json};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::time::timeout;

use crate::codec::{Codec, Event, Framing};
use crate::websocket::{LAST, append, handshake, opcode};
use crate::{Error, call, is_response_to, values};

/// The mask of control frames.
const MASK: [u8; 4] = [1, 2, 3, 4];

/// A client.
#[derive(Debug)]
pub struct Client<S> {
    stream: S,
    codec: Codec,
    patience: Duration,
    chunk: Vec<u8>,
    calls: u64,
    /// Every received frame, the oldest first, if the client stores them.
    pub received: Vec<Value>,
    remembers: bool,
}

impl<S: AsyncRead + AsyncWrite + Unpin> Client<S> {
    /// A client by line at this end of a pipe, with `patience` as the limit of every wait.
    #[must_use]
    pub fn on(stream: S, patience: Duration) -> Self {
        Self::with(Framing::Lines, stream, patience)
    }

    /// The same by WebSocket.
    ///
    /// # Panics
    /// As all methods below: if the expected event does not happen in time.
    pub async fn web_on(stream: S, patience: Duration) -> Self {
        let mut client = Self::with(Framing::WebSocket, stream, patience);
        let request = handshake("127.0.0.1:9095", "/", "");
        client.send_bytes(request.as_bytes()).await;
        while !client.codec.is_open() {
            // The runtime sends nothing before a request of the client.
            let next = client.codec.next_event();
            assert!(matches!(next, Ok(None)), "{next:?}");
            if !client.codec.is_open() {
                client.read().await.expect("an answer to the handshake");
            }
        }
        client
    }

    fn with(framing: Framing, stream: S, patience: Duration) -> Self {
        Self {
            stream,
            codec: Codec::new(framing),
            patience,
            chunk: vec![0; 8192],
            calls: 0,
            received: Vec::new(),
            remembers: false,
        }
    }

    /// The same, storing every frame in [`Client::received`].
    #[must_use]
    pub fn remembering(self) -> Self {
        Self {
            remembers: true,
            ..self
        }
    }

    /// The stream, for violations of the protocol. It no longer has bytes that the client has read but not returned.
    pub fn stream(&mut self) -> &mut S {
        &mut self.stream
    }

    /// Returns only the stream.
    #[must_use]
    pub fn into_stream(self) -> S {
        self.stream
    }

    /// Sends a frame.
    pub async fn send(&mut self, frame: &Value) {
        self.send_text(&frame.to_string()).await;
    }

    /// Sends a frame as text.
    pub async fn send_text(&mut self, frame: &str) {
        let mut bytes = Vec::new();
        self.codec.write(frame, &mut bytes);
        self.send_bytes(&bytes).await;
    }

    /// Sends bytes unchanged.
    pub async fn send_bytes(&mut self, bytes: &[u8]) {
        self.stream.write_all(bytes).await.expect("an open pipe");
    }

    /// Stops sending. Waiting answers still arrive.
    pub async fn finish(&mut self) {
        self.stream.shutdown().await.expect("an open pipe");
    }

    async fn read(&mut self) -> Result<(), Error> {
        let reading = timeout(self.patience, self.stream.read(&mut self.chunk));
        match reading.await.map_err(|_| Error::Late)? {
            Ok(0) => Err(Error::Ended),
            Ok(read) => {
                self.codec.push(&self.chunk[..read]);
                Ok(())
            }
            Err(error) => Err(Error::Socket(error)),
        }
    }

    /// The next message or control frame. Pings are answered. The end of the stream is an error.
    ///
    /// # Errors
    /// If none arrives, or if no server may send it.
    pub async fn next_event(&mut self) -> Result<Event, Error> {
        loop {
            if let Some(event) = self.codec.next_event()? {
                if let Event::Ping(payload) = &event {
                    let mut pong = Vec::new();
                    append(&mut pong, LAST | opcode::PONG, MASK, payload);
                    self.stream.write_all(&pong).await.map_err(Error::Socket)?;
                }
                return Ok(event);
            }
            self.read().await?;
        }
    }

    /// The next frame, without pings and pongs.
    ///
    /// # Errors
    /// If none arrives, or if it is not a frame.
    pub async fn next_frame(&mut self) -> Result<Value, Error> {
        loop {
            let Some(frame) = self.next_event().await?.into_frame()? else {
                continue;
            };
            if self.remembers {
                self.received.push(frame.clone());
            }
            return Ok(frame);
        }
    }

    /// The next frame.
    pub async fn receive(&mut self) -> Value {
        match self.next_frame().await {
            Ok(frame) => frame,
            Err(error) => panic!("a frame is awaited: {error}"),
        }
    }

    /// The next frame for which `wanted` is true.
    pub async fn receive_where(&mut self, wanted: impl Fn(&Value) -> bool) -> Value {
        loop {
            let frame = self.receive().await;
            if wanted(&frame) {
                return frame;
            }
        }
    }

    /// Whether nothing arrives in this time, not even the end.
    pub async fn receives_nothing_for(&mut self, time: Duration) -> bool {
        if !self.codec.pending().is_empty() {
            return false;
        }
        let Ok(read) = timeout(time, self.stream.read(&mut self.chunk)).await else {
            return true;
        };
        self.codec.push(&self.chunk[..read.unwrap_or(0)]);
        false
    }

    /// Calls a service and returns the whole response.
    pub async fn call(&mut self, service: &str, args: Value) -> Value {
        self.calls += 1;
        let id = json!(self.calls);
        self.send(&call(service, &args, &id)).await;
        self.receive_where(|frame| is_response_to(frame, &id)).await
    }

    /// Calls a service that must succeed and returns its values.
    pub async fn ask(&mut self, service: &str, args: Value) -> Value {
        values(self.call(service, args).await)
    }

    /// Subscribes and waits for the confirmation.
    pub async fn subscribe(&mut self, topic: &str) {
        self.send(&json!({"op": "subscribe", "topic": topic})).await;
        let status = self.receive_where(|frame| frame["op"] == "status").await;
        assert_eq!(status["level"], "info", "{status}");
    }

    /// Ends all subscriptions to `topic`.
    pub async fn unsubscribe(&mut self, topic: &str) {
        self.send(&json!({"op": "unsubscribe", "topic": topic}))
            .await;
        self.settle().await;
    }

    /// Publishes a message, which the runtime has then handled. Error statuses are ignored.
    async fn publish(&mut self, topic: &str, msg: Value) {
        self.send(&json!({"op": "publish", "topic": topic, "msg": msg}))
            .await;
        self.settle().await;
    }

    /// Publishes a setpoint.
    pub async fn publish_trajectory(&mut self, positions: Value) {
        let points = json!([{ "positions": positions }]);
        self.publish("/joint_trajectory", json!({"points": points}))
            .await;
    }

    /// Commands an effort, which the runtime refuses if the controller is on.
    pub async fn command_effort(&mut self, effort: Value) {
        self.publish("/effort_controller/commands", json!({"data": effort}))
            .await;
    }

    /// Turns the controller on.
    pub async fn enable(&mut self) {
        self.ask("/pid_controller/enable", json!({"data": true}))
            .await;
    }

    /// Waits until the runtime has handled all sent frames, because a call is answered in order. The answer is not
    /// stored.
    pub async fn settle(&mut self) {
        self.ask("/arm_sim/set_params", json!({})).await;
        self.received.pop();
    }

    /// Lets `time` pass, and returns the stored messages on `topic` of that time.
    pub async fn messages_for(&mut self, time: Duration, topic: &str) -> Vec<Value> {
        let before = self.received.len();
        let listen = async {
            loop {
                self.receive().await;
            }
        };
        let _: Result<(), _> = timeout(time, listen).await;
        messages(&self.received[before..], topic)
    }

    /// The stored messages on `topic` so far.
    #[must_use]
    pub fn messages(&self, topic: &str) -> Vec<Value> {
        messages(&self.received, topic)
    }
}

fn messages(frames: &[Value], topic: &str) -> Vec<Value> {
    let on_topic = frames.iter().filter(|frame| frame["topic"] == topic);
    on_topic.map(|frame| frame["msg"].clone()).collect()
}
