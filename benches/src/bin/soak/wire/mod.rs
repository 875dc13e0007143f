//! One client on the wire, over raw TCP or WebSocket, that reads while it writes and checks every response it gets.
//!
//! It reads and writes frames as `pendularm-client` does. The socket is its own: it is deaf, sips, resets, and takes in
//! what comes while it sends, which a client that waits for one thing at a time cannot.
//!
//! **Invariant:** no response passes unchecked: the ledger sees each frame before its reader.

mod reading;
mod sending;

use std::rc::Rc;
use std::time::Instant;

use pendularm_client::codec::{Codec, Framing};
use pendularm_client::websocket::handshake;
use serde_json::{Value, json};
use tokio::net::{TcpSocket, TcpStream};

use crate::ledger::Ledger;
use crate::recent::Recent;
use crate::world::{Fault, PATIENCE, World};

/// Bytes that are read at a time.
const CHUNK: usize = 16 * 1024;

/// The door that the client came through.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Door {
    /// One JSON object per line.
    Tcp,
    /// One per message.
    Web,
}

impl Door {
    /// Mostly the first.
    pub fn any(rng: &mut fastrand::Rng) -> Self {
        if rng.u8(..) < 90 {
            Self::Web
        } else {
            Self::Tcp
        }
    }
}

/// Something that came.
pub enum Came {
    /// A response, which was the right one.
    Answer(Value),
    /// Anything else.
    Other(Value),
    /// A binary message.
    Binary,
    /// The stream has ended, orderly or not.
    End,
    /// Nothing in the time given.
    Nothing,
}

/// A client.
pub struct Client {
    /// The client's name, for reports.
    pub name: String,
    /// The world, shared with all.
    pub world: Rc<World>,
    /// Its calls.
    pub ledger: Ledger,
    stream: TcpStream,
    door: Door,
    codec: Codec,
    chunk: Vec<u8>,
    /// Bytes that go with the next [`Client::flush`].
    out: Vec<u8>,
    ended: bool,
    sent: Recent,
    came: Recent,
}

impl Client {
    /// Connects. Over WebSocket it asks for every status, as there are over TCP.
    pub async fn connect(world: &Rc<World>, kind: &str, door: Door) -> Result<Self, Fault> {
        Self::with_buffer(world, kind, door, None).await
    }

    /// The same, with a receive buffer of about so many bytes.
    pub async fn with_buffer(
        world: &Rc<World>,
        kind: &str,
        door: Door,
        buffer: Option<u32>,
    ) -> Result<Self, Fault> {
        let name = format!("{kind} {}", world.number());
        let connecting = async {
            let socket = TcpSocket::new_v4()?;
            if let Some(size) = buffer {
                socket.set_recv_buffer_size(size)?;
            }
            let stream = socket.connect(world.address).await?;
            stream.set_nodelay(true)?;
            Ok::<_, std::io::Error>(stream)
        };
        let stream = tokio::time::timeout(PATIENCE, connecting)
            .await
            .map_err(|_| Fault::of(&name, "not accepted in time"))?
            .map_err(|error| Fault::of(&name, format!("not accepted: {error}")))?;
        world.count("connections", 1);
        let mut client = Self {
            name,
            world: Rc::clone(world),
            ledger: Ledger::default(),
            stream,
            door,
            codec: Codec::new(match door {
                Door::Tcp => Framing::Lines,
                Door::Web => Framing::WebSocket,
            }),
            chunk: vec![0; CHUNK],
            out: Vec::new(),
            ended: false,
            sent: Recent::default(),
            came: Recent::default(),
        };
        if door == Door::Web {
            client.shake_hands().await?;
        }
        Ok(client)
    }

    async fn shake_hands(&mut self) -> Result<(), Fault> {
        let hello = handshake(&self.world.address.to_string(), "/", "");
        self.send_bytes(hello.as_bytes()).await?;
        let deadline = Instant::now() + PATIENCE;
        loop {
            // Nothing comes before the client has asked for it.
            let next = self.codec.next_event();
            next.map_err(|why| self.fault(why.to_string()))?;
            if self.codec.is_open() {
                break;
            }
            if self.ended || !self.wait_readable(deadline).await? {
                return Err(self.fault("the handshake is not answered"));
            }
        }
        self.world.count("connections over WebSocket", 1);
        self.push(&json!({"op": "set_level", "level": "info"}));
        Ok(())
    }

    /// The door that it came through.
    pub fn door(&self) -> Door {
        self.door
    }

    /// A fault of this client, with what went before it.
    pub fn fault(&self, what: impl Into<String>) -> Fault {
        Fault {
            client: self.name.clone(),
            what: what.into(),
            sent: self.sent.frames(),
            came: self.came.frames(),
        }
    }
}
