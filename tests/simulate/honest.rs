//! A client that follows the protocol, and every frame that it may receive.

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::rc::Rc;
use std::time::Duration;

use pendularm_client::codec::Framing;
use tokio::time::Instant;

use crate::client::Client;
use crate::court::Court;
use crate::pipe::Fate;

/// The required answer of a call.
#[derive(Debug, Clone)]
pub enum Expect {
    /// Success.
    Success,
    /// A refusal.
    Refusal,
    /// Success, with values that have this member.
    Member(&'static str),
    /// A computation, with the number of entries in each column. A short one takes a few turns.
    Computed { entries: usize, is_short: bool },
    /// The answer of another client, or a justified failure: the number of the call.
    Forwarded(u64),
    /// The result of a goal, and whether feedback may come before it.
    Goal { has_feedback: bool },
    /// One answer with any content.
    Anything,
}

/// A call that waits for its answer.
#[derive(Debug, Clone)]
pub struct Call {
    pub what: String,
    pub expect: Expect,
    pub since: Instant,
    pub turns: u64,
    /// Whether it has to be answered at once.
    pub is_light: bool,
    /// The client's frames before it.
    pub order: u64,
    /// It is a goal that this client has cancelled.
    pub is_cancelled: bool,
}

impl Call {
    /// Whether the pool of computations answers it.
    pub fn is_computation(&self) -> bool {
        matches!(self.expect, Expect::Computed { .. })
            || self.what.starts_with("/study/")
            || self.what.starts_with("study/")
            || self.what.contains("arm_sim/integration_step")
    }
}

/// The state of a subscription.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    Asked,
    On,
    /// Ended by the frame with that number.
    Leaving(u64),
}

/// A subscription to a topic of clients.
#[derive(Debug)]
pub struct Subscription {
    /// The topic's absolute name.
    pub topic: String,
    pub phase: Phase,
    pub throttle: Option<Duration>,
    pub is_binary: bool,
    pub is_in_pieces: bool,
    /// By publisher: the messages that may arrive, in order, and whether each must arrive.
    pub pending: BTreeMap<u64, VecDeque<(u64, bool)>>,
    /// The last message that came, and when.
    pub last: Option<(u64, Instant)>,
    /// The publisher of the last message that came.
    pub last_from: Option<u64>,
    /// The last message of each publisher that was sent during the subscription.
    pub newest: BTreeMap<u64, u64>,
}

/// A client, and a record of its requests.
pub struct Honest {
    /// A number that no other client of the seed has.
    pub who: u64,
    pub client: Client,
    pub fate: Rc<Cell<Fate>>,
    pub calls: BTreeMap<String, Call>,
    /// By the spelling of the topic.
    pub subscriptions: BTreeMap<String, Subscription>,
    /// Topics of the runtime that it watches.
    pub watched: BTreeSet<String>,
    pub advertised: BTreeSet<String>,
    /// Messages that it has published: each with the number of its frame.
    pub published: BTreeMap<u64, u64>,
    /// Bytes of frames that are sent with the next one, in one write.
    together: Vec<u8>,
    /// The number of sent frames, and how many of them have certainly been handled.
    pub frames: u64,
    pub handled: u64,
    /// Answers that it has to give as a provider, each with its time and its frame.
    pub due_answers: Vec<(Instant, u64, String)>,
    /// The turn at which its last computation was answered. The next one starts then.
    pub computed: u64,
    /// Received pieces of messages, by id.
    pub pieces: BTreeMap<String, Vec<String>>,
    /// Statuses about its registrations, and how often each is expected.
    pub news: BTreeMap<String, u64>,
    /// Error statuses that are expected.
    pub mistakes: u64,
    /// Its connection is broken, so no answer is required.
    pub is_excused: bool,
    /// It has not read for some time, so messages may arrive late or be dropped.
    pub is_hampered: bool,
    /// When it reads again.
    pub stalled_until: Option<Instant>,
    /// It has shut down its writing side.
    pub has_finished: bool,
}

impl Honest {
    pub fn new(who: u64, client: Client, fate: Rc<Cell<Fate>>) -> Self {
        let mut honest = Self {
            who,
            client,
            fate,
            calls: BTreeMap::new(),
            subscriptions: BTreeMap::new(),
            watched: BTreeSet::new(),
            advertised: BTreeSet::new(),
            published: BTreeMap::new(),
            together: Vec::new(),
            frames: 0,
            handled: 0,
            due_answers: Vec::new(),
            computed: 0,
            pieces: BTreeMap::new(),
            news: BTreeMap::new(),
            mistakes: 0,
            is_excused: false,
            is_hampered: false,
            stalled_until: None,
            has_finished: false,
        };
        honest.send("{\"op\":\"set_level\",\"level\":\"info\"}", 0);
        honest
    }

    /// Sends a frame. `style` selects how it is split and ended.
    pub fn send(&mut self, frame: &str, style: u8) {
        self.frames += 1;
        // Without a line end, every later frame would wait for the next one.
        let style = if self.client.framing() == Framing::Lines && style % 4 == 2 {
            0
        } else {
            style
        };
        self.flush();
        self.client.send(frame, style);
    }

    /// Sends a frame in one write with the frames after it.
    pub fn send_with_next(&mut self, frame: &str) {
        self.frames += 1;
        self.together.extend(self.client.encode(frame, 0));
    }

    /// No frame follows these.
    pub fn flush(&mut self) {
        if !self.together.is_empty() {
            self.client.send_bytes(std::mem::take(&mut self.together));
        }
    }

    /// Sends a frame as fragments of about `size` bytes.
    pub fn send_pieces(&mut self, frame: &str, size: usize, style: u8) {
        let characters: Vec<char> = frame.chars().collect();
        let pieces: Vec<String> = characters
            .chunks(size)
            .map(|piece| piece.iter().collect())
            .collect();
        let (total, id) = (pieces.len(), self.frames);
        for (num, piece) in pieces.into_iter().enumerate() {
            let data = serde_json::Value::from(piece);
            let piece = format!(
                "{{\"op\":\"fragment\",\"id\":\"piece-{id}\",\"data\":{data},\"num\":{num},\"total\":{total}}}"
            );
            self.send(&piece, style);
        }
    }

    /// Expects a status about a frame that was sent.
    pub fn await_news(&mut self, of: String) {
        *self.news.entry(of).or_default() += 1;
    }

    /// Removes an expected status. Returns false if none was expected.
    pub fn has_news(&mut self, of: &str) -> bool {
        let Some(left) = self.news.get_mut(of) else {
            return false;
        };
        *left -= 1;
        if *left == 0 {
            self.news.remove(of);
        }
        true
    }

    /// Whether it can still send.
    pub fn is_active(&self) -> bool {
        !self.is_excused && !self.has_finished && !self.client.has_ended()
    }

    /// Records a call that has just been sent under `id`, as JSON. An empty `id` means none.
    pub fn note_call(
        &mut self,
        id: &str,
        what: &str,
        expect: Expect,
        is_light: bool,
        court: &Court,
    ) {
        let call = Call {
            what: what.to_owned(),
            expect,
            since: Instant::now(),
            turns: court.turns.get(),
            is_light,
            order: self.frames,
            is_cancelled: false,
        };
        self.calls.insert(id.to_owned(), call);
    }

    /// No answer is required any more, and its last frames may not have arrived.
    pub fn excuse(&mut self) {
        self.is_excused = true;
        self.calls.clear();
        self.due_answers.clear();
    }

    /// An answer has come: all frames before its call have been handled.
    pub fn handled_before(&mut self, order: u64) {
        self.handled = self.handled.max(order);
        // Messages that wait to be encoded for a client that does not read arrive after later answers.
        let (handled, is_late) = (self.handled, self.is_hampered);
        self.subscriptions.retain(
            |_, one| !matches!(one.phase, Phase::Leaving(left) if left < handled && !is_late),
        );
    }
}
