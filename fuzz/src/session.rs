//! Clients that do as a script says, and what must hold of all that they hear.
//!
//! - Every frame is one line of strict JSON (or CBOR, where that was asked for) with an `op` that the runtime sends.
//! - A call gets exactly one response with its `id`, as long as its client stays, reads, and breaks no rule; never two.
//! - Of one client's messages on a topic another hears each at most once, in the order in which they were sent, as they were sent.
//! - A provider hears what its caller asked, and the caller what its provider answered.
//! - In the end, when nobody is in anybody's way, every message and every call between those who are left arrives.
//! - A connection ends when its client has ended, and nothing else ends it but the rules that say so.
//! - When all have left, nothing is counted as held for anybody.
//!
//! All of it holds too where all clients together have little room.

use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};
use std::fmt::Write;
use std::rc::Rc;
use std::time::Duration;

use arbitrary::Arbitrary;
use pendularm::actors::gateway::connection::gate::Gate;
use pendularm::actors::gateway::limits::{LINGER, RESPONSES_OWED, STALL_LIMIT};
use pendularm::actors::resources::budget::Memory;
use pendularm::protocol::catalog::{Rosapi, Service, Topic};
use pendularm::web::serve::TAKE_TIME;
use pendularm_client::websocket;
use tokio::time::sleep;

use crate::book::Book;
use crate::cbor;
use crate::client::{Client, Door, Received};
use crate::json::Json;
use crate::stage::{Manner, Stage, run, run_apart, scarce};

/// Most steps of one execution, and its number of clients.
const MAX_STEPS: usize = 48;
const CLIENTS: usize = 3;
/// Virtual time, in milliseconds, that the arm's clients let pass in one execution, and at a time: an arm of tiny timesteps
/// computes for five milliseconds of the processor's in every one.
const ARM_TIME: u16 = 200;
const ARM_WAIT: u16 = 48;
/// Longest that a caller lets a provider take; all is answered by then.
const LONGEST_TIMEOUT: Duration = Duration::from_secs(66);
/// Every id of a call begins so; garbage must not, or it would be a call.
const ID: &str = "call-";
/// Messages of each client in the end, on a topic that nobody has named before.
const LAST_MESSAGES: u64 = 3;
const LAST_TOPIC: &str = "/in/the/end";

/// One thing that happens.
#[derive(Debug, Arbitrary)]
pub enum Step<'a> {
    /// A client sends a frame.
    Do {
        client: u8,
        style: u8,
        deed: Deed<'a>,
    },
    /// A client sends a frame in pieces of so many bytes.
    InPieces {
        client: u8,
        style: u8,
        size: u8,
        deed: Deed<'a>,
    },
    /// A client sends anything, up to the end of a line or message.
    Garbage { client: u8, bytes: &'a [u8] },
    /// A client sends bytes that need be no message at all.
    Noise { client: u8, bytes: &'a [u8] },
    /// So many milliseconds pass.
    Wait(u16),
    /// A client stops or goes on reading.
    Pause { client: u8, paused: bool },
    /// A client ends, and reads on.
    HalfClose { client: u8 },
    /// A client is gone, and another in its place.
    Replace { client: u8, room: u8, piece: u8 },
    /// The runtime's node treats calls otherwise.
    Behave(u8),
    /// It answers a call that it has kept.
    Release,
    /// It publishes.
    Publish { topic: u8 },
}

/// A frame, roughly.
#[derive(Debug, Arbitrary)]
pub enum Deed<'a> {
    Advertise {
        topic: u8,
    },
    Unadvertise {
        topic: u8,
    },
    Publish {
        topic: u8,
        payload: Payload<'a>,
    },
    Subscribe {
        topic: u8,
        id: Option<u8>,
        throttle_ms: Option<u16>,
        queue_length: u8,
        compression: u8,
        size: Option<u8>,
    },
    Unsubscribe {
        topic: u8,
        id: Option<u8>,
    },
    Provide {
        service: u8,
    },
    Withdraw {
        service: u8,
    },
    Call {
        service: u8,
        timeout: Option<u16>,
        args: Payload<'a>,
    },
    /// As a provider, of a call that came: the one of that number.
    Respond {
        which: u8,
        result: bool,
        values: Payload<'a>,
    },
    Level(u8),
    Goal {
        id: u8,
        args: Payload<'a>,
    },
    Cancel {
        id: u8,
    },
}

/// A JSON value, roughly.
#[derive(Debug, Arbitrary)]
pub enum Payload<'a> {
    Absent,
    Known(u8),
    Text(&'a str),
    Number(f64),
    Numbers(Vec<f64>),
    Long(u16),
    Deep(u8),
    /// To a call: every field with a value of its kind, but for those whose bit is set.
    Fitting([f64; 4], u8),
}

const TOPICS: [&str; 10] = [
    "/a",
    "a",
    "/b/c",
    "/\u{e9}",
    "/joint_trajectory",
    "/joint_states",
    "clock",
    "/tf_static",
    "/rosout",
    "//a",
];
const SERVICES: [&str; 6] = ["/s", "s", "/t/u", "/nobody", "/arm_sim/pause", "/rosapi/x"];
const VALUES: [&str; 12] = [
    "{}",
    "null",
    "[]",
    "{\"data\":true}",
    "[1,2,3]",
    "{\"a\":1e999,\"b\":[NaN,-Infinity]}",
    "{\"x\":18446744073709551616,\"y\":-0.0}",
    "\"\\ud83d\\ude00\\n\"",
    "7",
    "{\"points\":[{\"positions\":[0.1,0.2]}]}",
    "{\"header\":{\"stamp\":{\"sec\":1,\"nanosec\":5}},\"position\":[1,null]}",
    "{\"function\":\"t\",\"x0\":0,\"dt\":1,\"steps\":1,\"integrator\":\"rk4\"}",
];

/// Plays a script with clients of one kind, and one node that serves everything.
pub fn play(door: Door, is_scarce: bool, steps: &[Step<'_>]) {
    run(async {
        let stage = Stage::new(Gate::default(), memory(is_scarce)).await;
        Session::new(door, Cast::Stub, is_scarce, stage)
            .perform_all(steps)
            .await;
    });
}

/// Plays a script with the runtime's own nodes. In less time: an arm of tiny timesteps computes for as long as it may.
pub fn play_with_arm(door: Door, is_scarce: bool, steps: &[Step<'_>]) {
    run_apart(async {
        let stage = Stage::with_arm(Gate::default(), memory(is_scarce)).await;
        Session::new(door, Cast::Arm, is_scarce, stage)
            .perform_all(steps)
            .await;
    });
}

fn memory(is_scarce: bool) -> Memory {
    if is_scarce {
        scarce()
    } else {
        Memory::default()
    }
}

/// Who serves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Cast {
    Stub,
    Arm,
}

struct Session {
    door: Door,
    cast: Cast,
    stage: Stage,
    players: Vec<Player>,
    /// Milliseconds left of [`ARM_TIME`].
    left: u16,
    /// Calls and messages so far: their numbers tell them apart.
    calls: u64,
    messages: u64,
    /// All that clients say, for all to look up.
    book: Rc<RefCell<Book>>,
    is_scarce: bool,
}

/// A client, and what it may expect.
struct Player {
    client: Client,
    /// How often each of its calls was answered.
    answered: BTreeMap<String, u32>,
    /// Calls that came for it as a provider: id, service, and the caller's own id.
    forwarded: Vec<(String, String, String)>,
    /// The messages that it heard in the end: whose, and which.
    last: Vec<(u64, u64)>,
    book: Rc<RefCell<Book>>,
    /// The last message of each topic and sender.
    latest: HashMap<(String, u64), u64>,
    /// Fragments of a message, by its id.
    pieces: HashMap<String, Vec<String>>,
    /// It has broken a rule, or left: the runtime owes it nothing and may end it.
    is_excused: bool,
    has_ended: bool,
    /// How long it has not been reading, in a row.
    idle: Duration,
}

impl Player {
    fn new(client: Client, book: Rc<RefCell<Book>>) -> Self {
        Self {
            client,
            answered: BTreeMap::new(),
            forwarded: Vec::new(),
            last: Vec::new(),
            book,
            latest: HashMap::new(),
            pieces: HashMap::new(),
            is_excused: false,
            has_ended: false,
            idle: Duration::ZERO,
        }
    }
}

impl Session {
    fn new(door: Door, cast: Cast, is_scarce: bool, stage: Stage) -> Self {
        let mut session = Self {
            door,
            cast,
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
        let client = Client::new(self.door, self.stage.connect(room), piece);
        // So that nothing that follows opens like another protocol.
        client.send("{\"op\":\"set_level\",\"level\":\"info\"}", 0);
        Player::new(client, Rc::clone(&self.book))
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
                let door = self.door;
                let player = self.player(*client);
                // A line that is not ended would swallow what follows, and a frame may be a close frame.
                player.is_excused = true;
                player.note_forgery(bytes);
                player.client.send_bytes(bytes.to_vec());
                if door == Door::Plain {
                    player.client.send_bytes(b"\n".to_vec());
                }
            }
            Step::Wait(milliseconds) => {
                let milliseconds = match self.cast {
                    Cast::Stub => *milliseconds,
                    Cast::Arm => (milliseconds % ARM_WAIT).min(self.left),
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
            // A client that reads again has taken all there was by now, and given its signs of life: it has not stalled.
            for player in &mut self.players {
                if !player.client.is_paused() {
                    player.idle = Duration::ZERO;
                }
            }
        }
    }

    /// Pieces of a frame, in order, as frames of their own.
    fn send_pieces(&mut self, client: u8, style: u8, size: usize, frame: &str) {
        self.messages += 1;
        let id = self.messages;
        let characters: Vec<char> = frame.chars().collect();
        let pieces = characters.chunks(size);
        let total = pieces.len();
        for (num, piece) in pieces.enumerate() {
            let data = quoted(&piece.iter().collect::<String>());
            let piece = format!(
                "{{\"op\":\"fragment\",\"id\":\"piece-{id}\",\"data\":{data},\"num\":{num},\"total\":{total}}}"
            );
            self.player(client).client.send(&piece, style);
        }
    }

    /// Anything, up to the end of a line or message: what follows is read as ever.
    fn send_garbage(&mut self, client: u8, bytes: &[u8]) {
        let door = self.door;
        let player = self.player(client);
        let text = String::from_utf8_lossy(bytes);
        // It may change what statuses, fragments or calls there are; that is not to be told from here.
        let meddles = ["call", "fragment", "piece", "\\u"]
            .iter()
            .any(|word| text.contains(word));
        player.is_excused |= meddles;
        player.note_forgery(bytes);
        match door {
            Door::Plain => player.client.send_bytes([bytes, b"\n"].concat()),
            Door::Socket => {
                let mut message = Vec::new();
                let kind = websocket::opcode::BINARY;
                websocket::append_message(&mut message, kind, [1, 2, 3, 4], 0, bytes);
                player.client.send_bytes(message);
            }
        }
    }

    /// The text of a frame, noted if an answer is owed for it.
    fn frame(&mut self, client: u8, deed: &Deed<'_>) -> Option<String> {
        let place = u64::from(client) % CLIENTS as u64;
        Some(match deed {
            Deed::Advertise { topic } => {
                format!("{{\"op\":\"advertise\",\"topic\":{}}}", topic_of(*topic))
            }
            Deed::Unadvertise { topic } => {
                format!("{{\"op\":\"unadvertise\",\"topic\":{}}}", topic_of(*topic))
            }
            Deed::Publish { topic, payload } => {
                self.messages += 1;
                let number = self.messages;
                let more = payload.json().unwrap_or("0".to_owned());
                let name = TOPICS[usize::from(*topic) % TOPICS.len()];
                self.book.borrow_mut().publish(number, place, name, &more);
                let topic = topic_of(*topic);
                format!(
                    "{{\"op\":\"publish\",\"topic\":{topic},\"msg\":{{\"from\":{place},\"number\":{number},\"more\":{more}}}}}"
                )
            }
            Deed::Subscribe {
                topic,
                id,
                throttle_ms,
                queue_length,
                compression,
                size,
            } => {
                let mut frame = format!(
                    "{{\"op\":\"subscribe\",\"topic\":{},\"queue_length\":{queue_length}",
                    topic_of(*topic)
                );
                let compression =
                    ["none", "png", "cbor", "cbor-raw"][usize::from(*compression) % 4];
                put(&mut frame, "id", id.as_ref());
                put(&mut frame, "throttle_rate", throttle_ms.as_ref());
                put(&mut frame, "fragment_size", size.as_ref());
                put(&mut frame, "compression", Some(&quoted(compression)));
                frame + "}"
            }
            Deed::Unsubscribe { topic, id } => {
                let mut frame = format!("{{\"op\":\"unsubscribe\",\"topic\":{}", topic_of(*topic));
                put(&mut frame, "id", id.as_ref());
                frame + "}"
            }
            Deed::Provide { service } => format!(
                "{{\"op\":\"advertise_service\",\"service\":{}}}",
                service_of(*service)
            ),
            Deed::Withdraw { service } => format!(
                "{{\"op\":\"unadvertise_service\",\"service\":{}}}",
                service_of(*service)
            ),
            Deed::Call {
                service,
                timeout,
                args,
            } => self.call(client, *service, *timeout, args),
            Deed::Respond {
                which,
                result,
                values,
            } => {
                let forwarded = &mut self.player(client).forwarded;
                if forwarded.is_empty() {
                    return None;
                }
                let call = forwarded.remove(usize::from(*which) % forwarded.len());
                self.response(&call, *result, values.json().as_deref().unwrap_or("{}"))
            }
            Deed::Level(level) => {
                let level = ["info", "warning", "error", "none", "loud"][usize::from(*level) % 5];
                format!("{{\"op\":\"set_level\",\"level\":\"{level}\"}}")
            }
            Deed::Goal { id, args } => {
                let args = args.json().unwrap_or("{}".to_owned());
                format!(
                    "{{\"op\":\"send_action_goal\",\"action\":\"/ik_action\",\"id\":{id},\"args\":{args},\"feedback\":true}}"
                )
            }
            Deed::Cancel { id } => {
                format!("{{\"op\":\"cancel_action_goal\",\"action\":\"/ik_action\",\"id\":{id}}}")
            }
        })
    }

    fn call(
        &mut self,
        client: u8,
        service: u8,
        timeout: Option<u16>,
        args: &Payload<'_>,
    ) -> String {
        self.calls += 1;
        let id = format!("{ID}{}", self.calls);
        self.player(client).answered.insert(id.clone(), 0);
        let mut frame = format!(
            "{{\"op\":\"call_service\",\"service\":{},\"id\":\"{id}\"",
            service_of(service)
        );
        let timeout = match self.cast {
            Cast::Stub => timeout,
            Cast::Arm => Some(timeout.unwrap_or_default() % ARM_WAIT),
        };
        let seconds = timeout.map(|ms| f64::from(ms) / 1000.0);
        put(&mut frame, "timeout", seconds.as_ref());
        let args = match args {
            Payload::Fitting(numbers, more) => Some(fitting(service_name(service), numbers, *more)),
            args => args.json(),
        };
        let args = if Service::from_name(service_name(service)).is_some() {
            args
        } else {
            let more = args.unwrap_or("0".to_owned());
            self.book.borrow_mut().call(&id, &more);
            Some(format!("{{\"call\":\"{id}\",\"more\":{more}}}"))
        };
        put(&mut frame, "args", args.as_ref());
        frame + "}"
    }

    /// A provider's answer to a call, noted.
    fn response(&self, call: &(String, String, String), result: bool, more: &str) -> String {
        let (id, service, caller) = call;
        self.book.borrow_mut().answer(caller, result, more);
        let (id, service, caller) = (quoted(id), quoted(service), quoted(caller));
        format!(
            "{{\"op\":\"service_response\",\"service\":{service},\"id\":{id},\"values\":{{\"call\":{caller},\"more\":{more}}},\"result\":{result}}}"
        )
    }

    /// Looks at all that came.
    fn hear(&mut self) {
        // Where room is scarce, whoever holds most is cut off.
        let someone_gave_way = self.stage.gauges.memory().cut_off() > 0;
        for player in &mut self.players {
            for received in player.client.take() {
                match received {
                    Received::Json(line) => player.hear(&line),
                    Received::Binary(bytes) => player.hear_binary(&bytes),
                }
            }
            if player.client.has_ended() && !player.has_ended {
                player.has_ended = true;
                let patience = if player.client.is_greeted() {
                    STALL_LIMIT
                } else {
                    TAKE_TIME
                };
                let stalled = player.idle >= patience || someone_gave_way;
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

    /// Everybody reads, every call is answered, everybody leaves.
    async fn end(&mut self) {
        for player in &self.players {
            player.client.pause(false);
        }
        // A client that has not been reading for long finds here that it was given up; from then on it is owed nothing.
        self.pass(Duration::from_millis(5)).await;
        self.stage.release_all();
        let mut waited = Duration::ZERO;
        while waited < LONGEST_TIMEOUT + Duration::from_secs(5) && !self.all_answered() {
            let step = self.patience(1000, waited);
            self.pass(step).await;
            self.stage.release_all();
            self.hear();
            waited += step;
        }
        for player in &self.players {
            if player.is_owed() {
                let unanswered = player.answered.iter().find(|(_, count)| **count != 1);
                assert_eq!(unanswered, None, "a call and its answers");
            }
        }
        if !self.is_scarce {
            self.exchange().await;
        }
        for player in &self.players {
            player.client.finish();
        }
        // A client that leaves is owed the rest, and answers need not come.
        let limit = STALL_LIMIT + RESPONSES_OWED + 2 * LINGER + Duration::from_secs(5);
        let mut waited = Duration::ZERO;
        while waited < limit && !self.has_emptied() {
            let step = self.patience(250, waited);
            sleep(step).await;
            waited += step;
        }
        for player in &mut self.players {
            player.is_excused = true;
        }
        self.hear();
        let left = (self.stage.gauges.connections(), self.stage.gauges.memory());
        assert!(self.has_emptied(), "left when all have left: {left:?}");
    }

    /// Lets the clients that are left tell one another and ask one another something, and nothing of that may be lost: all of them
    /// read, and have done what they wanted to.
    async fn exchange(&mut self) {
        let left: Vec<u8> = (0..CLIENTS as u8)
            .filter(|client| self.player(*client).is_owed())
            .collect();
        let topic = quoted(LAST_TOPIC);
        for &client in &left {
            let player = self.player(client);
            player.forwarded.clear();
            for frame in [
                format!("{{\"op\":\"subscribe\",\"topic\":{topic}}}"),
                format!("{{\"op\":\"advertise\",\"topic\":{topic}}}"),
                format!("{{\"op\":\"advertise_service\",\"service\":\"{LAST_TOPIC}/{client}\"}}"),
            ] {
                player.client.send(&frame, 0);
            }
        }
        self.pass(Duration::from_millis(5)).await;
        for &client in &left {
            for _ in 0..LAST_MESSAGES {
                self.messages += 1;
                let number = self.messages;
                let more = VALUES[number as usize % VALUES.len()];
                let from = u64::from(client);
                self.book
                    .borrow_mut()
                    .publish(number, from, LAST_TOPIC, more);
                let frame = format!(
                    "{{\"op\":\"publish\",\"topic\":{topic},\"msg\":{{\"from\":{from},\"number\":{number},\"more\":{more}}}}}"
                );
                self.player(client).client.send(&frame, 0);
            }
            for &provider in &left {
                self.calls += 1;
                let id = format!("{ID}{}", self.calls);
                let more = VALUES[self.calls as usize % VALUES.len()];
                self.book.borrow_mut().call(&id, more);
                self.player(client).answered.insert(id.clone(), 0);
                let frame = format!(
                    "{{\"op\":\"call_service\",\"service\":\"{LAST_TOPIC}/{provider}\",\"id\":\"{id}\",\"args\":{{\"call\":\"{id}\",\"more\":{more}}}}}"
                );
                self.player(client).client.send(&frame, 0);
            }
        }
        // A client waits for its answer before its next frame is looked at, so they come one after the other.
        for _ in 0..2 * CLIENTS {
            self.pass(Duration::from_millis(5)).await;
            for &client in &left {
                for call in std::mem::take(&mut self.player(client).forwarded) {
                    let frame = self.response(&call, true, VALUES[call.0.len() % VALUES.len()]);
                    self.player(client).client.send(&frame, 0);
                }
            }
        }
        self.pass(Duration::from_millis(5)).await;
        let is_forged = self.book.borrow().is_forged;
        for &client in left.iter().filter(|_| !is_forged) {
            let player = self.player(client);
            let rest = player.client.rest();
            assert!(player.is_owed(), "{client} has ended: {rest}");
            let unanswered = player.answered.iter().find(|(_, count)| **count != 1);
            assert_eq!(unanswered, None, "a call in the end and its answers");
            for &from in &left {
                let heard = player
                    .last
                    .iter()
                    .filter(|(one, _)| *one == u64::from(from));
                assert_eq!(
                    heard.count() as u64,
                    LAST_MESSAGES,
                    "what {client} heard of {from}"
                );
            }
        }
    }

    /// How long to wait before looking again.
    fn patience(&self, milliseconds: u64, waited: Duration) -> Duration {
        let soon = waited.is_zero() || self.cast == Cast::Arm;
        Duration::from_millis(if soon { 10 } else { milliseconds })
    }

    fn has_emptied(&self) -> bool {
        let mut players = self.players.iter();
        self.stage.is_empty() && players.all(|player| player.client.has_ended())
    }

    fn all_answered(&self) -> bool {
        let mut owed = self.players.iter().filter(|player| player.is_owed());
        owed.all(|player| player.answered.values().all(|count| *count == 1))
    }
}

impl Player {
    fn is_owed(&self) -> bool {
        !self.is_excused && !self.has_ended
    }

    fn hear(&mut self, line: &str) {
        let frame = Json::read(line).unwrap_or_else(|| panic!("no JSON: {line:?}"));
        assert!(!frame.overflows(), "{line:?}");
        let text = |name: &str| frame.get(name).and_then(Json::text);
        match text("op").expect("an op") {
            "status" => assert!(text("msg").is_some() && text("level").is_some(), "{line}"),
            "publish" => self.hear_message(&frame),
            "service_response" => {
                assert!(
                    matches!(frame.get("result"), Some(Json::Boolean(_))),
                    "{line}"
                );
                assert!(frame.get("values").is_some(), "{line}");
                let is_own = text("service").and_then(Service::from_name).is_some();
                let is_good = frame.get("result") == Some(&Json::Boolean(true));
                assert!(!is_own || is_good == (text("status") == Some("")), "{line}");
                if let Some(count) = text("id").and_then(|id| self.answered.get_mut(id)) {
                    *count += 1;
                    assert_eq!(*count, 1, "answered again: {line}");
                    let said = |name: &str| frame.get("values").and_then(|values| values.get(name));
                    if let (Some(id), Some(call)) = (text("id"), said("call").and_then(Json::text))
                    {
                        let book = self.book.borrow();
                        book.check_answer(id, call, is_good, said("more"));
                    }
                } else {
                    let is_ours = text("id").is_some_and(|id| id.starts_with(ID));
                    assert!(
                        !is_ours || self.is_excused,
                        "the answer to another's call: {line}"
                    );
                }
            }
            "call_service" => {
                let call = (
                    text("id").expect("an id"),
                    text("service").expect("a service"),
                );
                let asked = |name: &str| frame.get("args").and_then(|args| args.get(name));
                let caller = asked("call").and_then(Json::text).unwrap_or_default();
                self.book.borrow().check_call(caller, asked("more"));
                let (id, service) = (call.0.to_owned(), call.1.to_owned());
                self.forwarded.push((id, service, caller.to_owned()));
            }
            "fragment" => self.hear_piece(&frame),
            "action_result" | "action_feedback" => {
                assert!(
                    text("action").is_some() && frame.get("values").is_some(),
                    "{line}"
                );
            }
            other => panic!("the runtime does not send {other}: {line}"),
        }
    }

    fn hear_piece(&mut self, frame: &Json) {
        let text = |name: &str| {
            frame
                .get(name)
                .and_then(Json::text)
                .expect("a text")
                .to_owned()
        };
        let number = |name: &str| frame.get(name).and_then(Json::number).expect("a number");
        let id = text("id");
        let pieces = self.pieces.entry(id.clone()).or_default();
        assert_eq!(number("num"), pieces.len() as f64, "pieces come in order");
        pieces.push(text("data"));
        if number("total") == pieces.len() as f64 {
            let whole = self.pieces.remove(&id).unwrap_or_default().concat();
            self.hear(&whole);
        }
    }

    fn hear_message(&mut self, frame: &Json) {
        let topic = frame.get("topic").and_then(Json::text).expect("a topic");
        let msg = frame.get("msg").expect("a message");
        if let ("/joint_states", Some(Json::Array(names))) = (topic, msg.get("name")) {
            for field in ["position", "velocity"] {
                let Some(Json::Array(entries)) = msg.get(field) else {
                    panic!("no {field} in {msg:?}");
                };
                let numbers = entries.iter().filter(|entry| entry.number().is_some());
                assert_eq!(numbers.count(), names.len(), "{msg:?}");
            }
        }
        let number = |name: &str| msg.get(name).and_then(Json::number);
        if let (Some(from), Some(number)) = (number("from"), number("number")) {
            self.note(topic, from, number);
            let (from, number) = (from as u64, number as u64);
            let book = self.book.borrow();
            book.check_message(number, from, topic, msg.get("more"));
            if topic == LAST_TOPIC {
                self.last.push((from, number));
            }
        }
    }

    /// Notes bytes that may be a message, a call or an answer that is in no book.
    fn note_forgery(&self, bytes: &[u8]) {
        let text = String::from_utf8_lossy(bytes);
        let words = ["publish", "service", "fragment", "\\u"];
        let mut book = self.book.borrow_mut();
        book.is_forged |= words.iter().any(|word| text.contains(word));
    }

    fn note(&mut self, topic: &str, from: f64, number: f64) {
        let before = self
            .latest
            .insert((topic.to_owned(), from as u64), number as u64);
        let excused = self.is_excused;
        assert!(
            excused || before.is_none_or(|before| before < number as u64),
            "{number} after {before:?} on {topic}"
        );
    }

    fn hear_binary(&mut self, bytes: &[u8]) {
        let frame = cbor::read(bytes).expect("CBOR");
        assert_eq!(frame.get("op").and_then(Json::text), Some("publish"));
        self.hear_message(&frame);
    }
}

impl Payload<'_> {
    fn json(&self) -> Option<String> {
        Some(match self {
            Self::Absent => return None,
            Self::Known(number) => VALUES[usize::from(*number) % VALUES.len()].to_owned(),
            Self::Text(text) => quoted(text),
            Self::Number(number) => python(*number),
            Self::Numbers(numbers) => {
                let numbers: Vec<String> = numbers.iter().copied().map(python).collect();
                format!("{{\"position\":[{}]}}", numbers.join(","))
            }
            Self::Long(length) => quoted(&"x\u{e9}".repeat(usize::from(*length) / 8)),
            Self::Fitting(numbers, _) => python(numbers[0]),
            Self::Deep(levels) => {
                let levels = usize::from(*levels) % 100;
                "[".repeat(levels) + "1" + &"]".repeat(levels)
            }
        })
    }
}

/// A number as Python's `json` writes it.
fn python(number: f64) -> String {
    if number.is_nan() {
        "NaN".to_owned()
    } else if number.is_infinite() {
        if number > 0.0 {
            "Infinity"
        } else {
            "-Infinity"
        }
        .to_owned()
    } else {
        format!("{number:e}")
    }
}

/// A text as JSON.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for character in text.chars() {
        match character {
            '"' | '\\' => quoted.extend(['\\', character]),
            '\0'..=' ' if character != ' ' => {
                let _ = write!(quoted, "\\u{:04x}", u32::from(character));
            }
            _ => quoted.push(character),
        }
    }
    quoted + "\""
}

fn put(frame: &mut String, key: &str, value: Option<&impl std::fmt::Display>) {
    if let Some(value) = value {
        let _ = write!(frame, ",\"{key}\":{value}");
    }
}

fn topic_of(number: u8) -> String {
    quoted(TOPICS[usize::from(number) % TOPICS.len()])
}

/// A client's service, or one of the runtime's.
fn service_name(number: u8) -> &'static str {
    let number = usize::from(number);
    let rosapi = Rosapi::ALL.into_iter().map(Service::Rosapi);
    let mut own = Service::ALL.into_iter().chain(rosapi).map(Service::name);
    match number {
        0..128 => SERVICES[number % SERVICES.len()],
        _ => own.nth(number - 128).unwrap_or(SERVICES[0]),
    }
}

fn service_of(number: u8) -> String {
    quoted(service_name(number))
}

/// Arguments that a service could take.
fn fitting(service: &str, numbers: &[f64; 4], without: u8) -> String {
    const TEXTS: [&str; 8] = [
        "rk4",
        "euler",
        "verlet",
        "/a",
        "timestep",
        "std_msgs/Header",
        "/ik_action",
        "0.01",
    ];
    let fields = Service::from_name(service).map_or(&[][..], Service::fields);
    let mut args = String::from("{\"unknown\":null");
    for (index, field) in fields.iter().enumerate() {
        if index < 8 && without >> index & 1 == 1 {
            continue;
        }
        let number = python(numbers[index % 4]);
        let value = match field.kind {
            "float64" => number,
            "float64[]" => format!("[{number},{}]", python(numbers[(index + 1) % 4])),
            "bool" => (numbers[index % 4] > 0.0).to_string(),
            "uint64" => (numbers[index % 4].abs() % 300.0).floor().to_string(),
            "string" => quoted(TEXTS[usize::from(without ^ index as u8) % TEXTS.len()]),
            _ => format!("{{\"kp\":[{number},{number}],\"gravity\":{number}}}"),
        };
        put(&mut args, field.name, Some(&value));
    }
    args + "}"
}
