//! Clients that follow a script, and checks of everything that they receive.
//!
//! - Every frame is one line of strict JSON (or CBOR, where that was asked for) with an `op` that the runtime sends.
//! - A call gets exactly one response with its `id`, as long as its client stays, reads, and breaks no rule; never two.
//! - A client receives each message of another client on a topic at most once, in order, and unchanged.
//! - A provider receives its caller's arguments, and the caller receives the provider's answer.
//! - In the end, without other load, every message and every call between the remaining clients arrives.
//! - A connection ends only when its client has ended, or by a rule of the protocol.
//! - When all clients have disconnected, no memory is counted for any of them.
//!
//! All of this also holds if all clients together have little memory.

mod ending;
mod frames;
mod player;
mod script;
mod text;

pub use script::{Deed, Payload, Step};

use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};
use std::fmt::Write;
use std::rc::Rc;
use std::time::Duration;

use arbitrary::Arbitrary;
use pendularm::actors::gateway::connection::admission::Admission;
use pendularm::actors::gateway::limits::{LINGER, RESPONSES_TIME, STALL_LIMIT};
use pendularm::actors::resources::memory::Memory;
use pendularm::protocol::catalog::{Rosapi, Service, Topic};
use pendularm::web::stream::ANSWER_TIME;
use pendularm_client::codec::{Event, Framing};
use pendularm_client::websocket;
use tokio::time::sleep;

use crate::book::Book;
use crate::cbor;
use crate::client::Client;
use crate::json::Json;
use crate::stage::{Manner, Stage, run, run_apart};
use text::{TOPICS, VALUES, fitting, put, quoted, service_name, service_of, topic_of};

/// Most steps of one execution, and its number of clients.
const MAX_STEPS: usize = 48;
const CLIENTS: usize = 3;
/// Virtual time, in milliseconds, that the arm's clients let pass in one execution, and at a time. An arm with tiny
/// timesteps uses five milliseconds of processor time in each.
const ARM_TIME: u16 = 200;
const ARM_WAIT: u16 = 48;
/// Longest timeout of a call. Every call is answered by then.
const LONGEST_TIMEOUT: Duration = Duration::from_secs(66);
/// Every id of a call begins so; garbage must not, or it would be a call.
const ID: &str = "call-";
/// Messages of each client in the end, on a topic that no client has named before.
const LAST_MESSAGES: u64 = 3;
const LAST_TOPIC: &str = "/in/the/end";

/// Plays a script with clients of one kind. One node serves everything. With `has_arm`, the runtime's own nodes serve,
/// in less virtual time, because an arm with tiny timesteps uses its whole budget.
pub fn play(framing: Framing, is_scarce: bool, has_arm: bool, steps: &[Step<'_>]) {
    let memory = if is_scarce {
        // A few clients can fill it in one execution.
        Memory::of(1, 1 << 20)
    } else {
        Memory::default()
    };
    let session = async {
        let stage = Stage::new(Admission::default(), memory, has_arm).await;
        let session = Session::new(framing, has_arm, is_scarce, stage);
        session.perform_all(steps).await;
    };
    if has_arm {
        run_apart(session);
    } else {
        run(session);
    }
}

struct Session {
    framing: Framing,
    has_arm: bool,
    stage: Stage,
    players: Vec<Player>,
    /// Milliseconds left of [`ARM_TIME`].
    left: u16,
    /// The number of calls and messages so far, which identifies each of them.
    calls: u64,
    messages: u64,
    /// All sent frames, shared by all clients.
    book: Rc<RefCell<Book>>,
    is_scarce: bool,
}

/// A client, and what it may expect.
struct Player {
    client: Client,
    /// How often each of its calls was answered.
    answered: BTreeMap<String, u32>,
    /// Calls that it received as a provider: id, service, and the caller's own id.
    forwarded: Vec<(String, String, String)>,
    /// The messages that it received in the end, with their senders.
    last: Vec<(u64, u64)>,
    book: Rc<RefCell<Book>>,
    /// The last message of each topic and sender.
    latest: HashMap<(String, u64), u64>,
    /// Fragments of a message, by its id.
    pieces: HashMap<String, Vec<String>>,
    /// It has broken a rule or disconnected, so nothing is expected for it, and the runtime may end it.
    is_excused: bool,
    has_ended: bool,
    /// The time since it last read.
    idle: Duration,
}

impl Session {
    fn new(framing: Framing, has_arm: bool, is_scarce: bool, stage: Stage) -> Self {
        let mut session = Self {
            framing,
            has_arm,
            stage,
            players: Vec::new(),
            left: ARM_TIME,
            calls: 0,
            messages: 0,
            book: Rc::default(),
            is_scarce,
        };
        for _ in 0..CLIENTS {
            let player = session.enter(2, 255);
            session.players.push(player);
        }
        session
    }

    fn enter(&self, room: u8, piece: u8) -> Player {
        let room = [64, 1024, 16 * 1024, 1 << 20][usize::from(room) % 4];
        let piece = if piece == 255 {
            1 << 20
        } else {
            usize::from(piece)
        };
        let client = Client::new(self.framing, self.stage.connect(room), piece);
        // So later bytes cannot begin like another protocol.
        client.send("{\"op\":\"set_level\",\"level\":\"info\"}", 0);
        Player {
            client,
            answered: BTreeMap::new(),
            forwarded: Vec::new(),
            last: Vec::new(),
            book: Rc::clone(&self.book),
            latest: HashMap::new(),
            pieces: HashMap::new(),
            is_excused: false,
            has_ended: false,
            idle: Duration::ZERO,
        }
    }

    async fn perform_all(mut self, steps: &[Step<'_>]) {
        for step in steps.iter().take(MAX_STEPS) {
            self.perform(step).await;
            self.hear();
        }
        self.end().await;
    }

    async fn perform(&mut self, step: &Step<'_>) {
        match step {
            Step::Do {
                client,
                style,
                deed,
            } => {
                if let Some(frame) = self.frame(*client, deed) {
                    self.player(*client).client.send(&frame, *style);
                }
            }
            Step::InPieces {
                client,
                style,
                size,
                deed,
            } => {
                if let Some(frame) = self.frame(*client, deed) {
                    self.send_pieces(*client, *style, (*size).max(8).into(), &frame);
                }
            }
            Step::Garbage { client, bytes } => self.send_garbage(*client, bytes),
            Step::Noise { client, bytes } => {
                let framing = self.framing;
                let player = self.player(*client);
                // An unfinished line would contain the next frame, and a frame may be a close frame.
                player.is_excused = true;
                player.note_forgery(bytes);
                player.client.send_bytes(bytes.to_vec());
                if framing == Framing::Lines {
                    player.client.send_bytes(b"\n".to_vec());
                }
            }
            Step::Wait(milliseconds) => {
                let milliseconds = if self.has_arm {
                    (milliseconds % ARM_WAIT).min(self.left)
                } else {
                    *milliseconds
                };
                self.left -= milliseconds.min(self.left);
                self.pass(Duration::from_millis(milliseconds.into())).await;
            }
            Step::Pause { client, paused } => self.player(*client).client.pause(*paused),
            Step::HalfClose { client } => {
                let player = self.player(*client);
                player.client.finish();
                player.is_excused = true;
            }
            Step::Replace {
                client,
                room,
                piece,
            } => {
                let player = self.enter(*room, *piece);
                let place = usize::from(*client) % CLIENTS;
                self.players[place] = player;
            }
            Step::Behave(manner) => {
                let manners = [
                    Manner::Prompt,
                    Manner::Holding,
                    Manner::Late,
                    Manner::Forgetful,
                ];
                self.stage.behave(manners[usize::from(*manner) % 4]);
            }
            Step::Release => self.stage.release(),
            Step::Publish { topic } => {
                self.messages += 1;
                let topic = Topic::ALL[usize::from(*topic) % Topic::ALL.len()];
                self.stage.publish(topic, self.messages);
            }
        }
        for _ in 0..4 {
            tokio::task::yield_now().await;
        }
    }

    fn player(&mut self, client: u8) -> &mut Player {
        &mut self.players[usize::from(client) % CLIENTS]
    }

    /// Lets time pass, in which clients answer pings.
    async fn pass(&mut self, time: Duration) {
        let mut left = time;
        while !left.is_zero() {
            let step = left.min(Duration::from_secs(5));
            sleep(step).await;
            left -= step;
            for player in &mut self.players {
                if player.client.is_paused() {
                    player.idle += step;
                }
            }
            self.hear();
            // A client that reads again has now read everything and answered pings, so it has not stalled.
            for player in &mut self.players {
                if !player.client.is_paused() {
                    player.idle = Duration::ZERO;
                }
            }
        }
    }

    /// Checks all received frames.
    fn hear(&mut self) {
        for player in &mut self.players {
            for received in player.client.take() {
                match received {
                    Event::Text(line) => player.hear(&line),
                    Event::Binary(bytes) => player.hear_binary(&bytes),
                    Event::Ping(_) | Event::Pong(_) | Event::Close(..) => {}
                }
            }
            if player.client.has_ended() && !player.has_ended {
                player.has_ended = true;
                let patience = if player.client.is_greeted() {
                    STALL_LIMIT
                } else {
                    ANSWER_TIME
                };
                let stalled = player.idle >= patience;
                assert!(
                    player.is_excused || stalled,
                    "ended for no reason: {}",
                    player.client.rest()
                );
                assert!(
                    stalled || player.client.ended_in_order(),
                    "ended within a frame: {}",
                    player.client.rest()
                );
            }
        }
    }
}
