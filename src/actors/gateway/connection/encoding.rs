//! Topic messages that wait to be encoded for the client, one after the other, on another thread.
//!
//! **Invariant:** a client's topic messages keep their order: what comes behind one that is being encoded waits for
//! it. At most
//! [`MAX_TOPIC_BYTES`] wait, and the oldest are dropped.

use std::collections::VecDeque;
use std::rc::{Rc, Weak};

use tokio::time::sleep;

use super::outgoing::Outgoing;
use crate::actors::gateway::limits::{FREE_FRAMES, LOOK_AGAIN};
use crate::actors::gateway::messages::{Deliver, Frames};
use crate::actors::gateway::turns;
use crate::protocol::outbox::{MAX_TOPIC_BYTES, PLACE_BYTES};

/// While more bytes of topic messages than this wait for the client, nothing more is encoded for it: it might be
/// dropped unread.
const ENOUGH: usize = MAX_TOPIC_BYTES / 2;

/// The messages of one connection that wait.
#[derive(Default)]
pub(super) struct Encoding {
    waiting: VecDeque<Deliver>,
    /// Their bytes, as they came.
    bytes: usize,
    /// Whether there is a task at work.
    at_work: bool,
}

impl Encoding {
    /// Adds a message; gives how many had to go for it.
    fn push(&mut self, message: Deliver) -> u64 {
        self.bytes += message.frames.plain_length();
        self.waiting.push_back(message);
        self.keep(MAX_TOPIC_BYTES)
    }

    /// Drops the oldest messages until those that are left, and their places, take no more than `most` bytes; gives
    /// how many went.
    pub(super) fn keep(&mut self, most: usize) -> u64 {
        let mut dropped = 0;
        while self.bytes + self.waiting.len() * PLACE_BYTES > most && self.pop().is_some() {
            dropped += 1;
        }
        dropped
    }

    /// How many messages wait, and their bytes.
    pub(super) fn size(&self) -> (usize, usize) {
        (self.waiting.len(), self.bytes)
    }

    fn pop(&mut self) -> Option<Deliver> {
        let message = self.waiting.pop_front()?;
        self.bytes -= message.frames.plain_length();
        Some(message)
    }
}

impl Outgoing {
    /// Takes topic messages for the client: into the outbox if they are ready and nothing waits to be encoded, else
    /// behind what does.
    pub(super) fn accept(self: &Rc<Self>, message: Deliver) {
        if !self.is_encoding() && self.pass(&message) {
            return;
        }
        let mut encoding = self.encoding.borrow_mut();
        self.count_dropped(encoding.push(message));
        if !std::mem::replace(&mut encoding.at_work, true) {
            actix_rt::spawn(Work(Rc::downgrade(self)).run());
        }
    }

    /// Whether messages wait to be encoded.
    pub(super) fn is_encoding(&self) -> bool {
        self.encoding.borrow().at_work
    }

    /// Puts messages that are ready into the outbox; returns false if these are not.
    fn pass(&self, message: &Deliver) -> bool {
        match &message.frames {
            Frames::Plain(frame) => self.push(&message.topic, frame.clone()),
            Frames::Encoded(encoded, newest) => {
                let Some(frames) = encoded.at_hand() else {
                    return false;
                };
                // The first may be due; all others but the newest would be replaced by those.
                let last = newest.map_or(0, |newest| frames.len().saturating_sub(newest));
                let wanted = frames.iter().enumerate();
                for (_, frame) in wanted.filter(|(at, _)| *at == 0 || *at >= last) {
                    self.push(&message.topic, frame.clone());
                }
            }
        }
        true
    }
}

/// The task; the connection may end before it.
struct Work(Weak<Outgoing>);

impl Drop for Work {
    fn drop(&mut self) {
        if let Some(outgoing) = self.0.upgrade() {
            outgoing.encoding.borrow_mut().at_work = false;
            // The writer may have waited for this to end.
            outgoing.tell();
        }
    }
}

impl Work {
    async fn run(self) {
        while let Some(outgoing) = self.0.upgrade() {
            let next = outgoing.encoding.borrow_mut().pop();
            let Some(message) = next else {
                return;
            };
            drop(outgoing);
            if let Frames::Encoded(encoded, newest) = &message.frames {
                // Throttling keeps the newest: it has to see all of them.
                while newest.is_none() && encoded.at_hand().is_none() && self.has_enough() {
                    sleep(LOOK_AGAIN).await;
                }
                if encoded.messages().await.len() > FREE_FRAMES {
                    // Many clients may have as many to go through.
                    turns::read().await;
                }
            }
            if let Some(outgoing) = self.0.upgrade() {
                let _ = outgoing.pass(&message);
                outgoing.tell();
            }
            tokio::task::yield_now().await;
        }
    }

    fn has_enough(&self) -> bool {
        let outgoing = self.0.upgrade();
        outgoing.is_some_and(|outgoing| outgoing.topic_bytes() > ENOUGH)
    }
}
