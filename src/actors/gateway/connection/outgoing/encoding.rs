//! Topic messages that wait to be encoded for the client, one after the other, on another thread.
//!
//! **Invariant:** the messages of a topic keep their order: behind one that is being encoded they wait for it. Other
//! topics wait only where they have to be encoded too, and answers never wait. So a client that asks for long messages
//! in another form still hears of the arm in time.

use std::rc::{Rc, Weak};

use tokio::time::sleep;

use super::Outgoing;
use crate::actors::gateway::limits::{FREE_FRAMES, LOOK_AGAIN};
use crate::actors::gateway::messages::{Deliver, Frames};
use crate::actors::gateway::turns;
use crate::protocol::outbox::MAX_TOPIC_BYTES;

/// While more bytes of topic messages than this are ready to be written, nothing more is encoded for the client: it
/// might be dropped unread. Messages that a throttle holds back do not count: they may be for hours.
const ENOUGH: usize = MAX_TOPIC_BYTES / 2;

impl Outgoing {
    /// Takes topic messages for the client: into the outbox if they are ready and none of their topic waits to be
    /// encoded, else behind what does. Feedback of a goal is always ready.
    pub(crate) fn accept(self: &Rc<Self>, message: Deliver) {
        let waits = self.unencoded.borrow().has(&message.topic)
            && !matches!(message.frames, Frames::Feedback(_));
        let left = if waits {
            Some(message)
        } else {
            self.pass(message)
        };
        let Some(message) = left else {
            return;
        };
        let mut unencoded = self.unencoded.borrow_mut();
        self.charge.count_dropped(unencoded.push(message));
        if !std::mem::replace(&mut unencoded.at_work, true) {
            actix_rt::spawn(EncodingTask(Rc::downgrade(self)).run());
        }
    }

    /// Whether messages wait to be encoded.
    pub(crate) fn is_encoding(&self) -> bool {
        self.unencoded.borrow().at_work
    }

    /// Puts messages that are ready into the outbox; gives them back if they are not.
    fn pass(&self, message: Deliver) -> Option<Deliver> {
        match message.frames {
            Frames::Plain(frame) => self.push(&message.topic, frame),
            Frames::Feedback(frame) => self.push_feedback(frame),
            Frames::Encoded(ref encoded, newest) => {
                let Some(made) = encoded.at_hand() else {
                    return Some(message);
                };
                self.charge.count_dropped(made.lost);
                let frames = &made.messages;
                // The first may be due. The newest would replace all others, which are left out.
                let last = newest.map_or(0, |newest| frames.len().saturating_sub(newest));
                let wanted = frames.iter().enumerate();
                for (_, frame) in wanted.filter(|(at, _)| *at == 0 || *at >= last) {
                    self.push(&message.topic, frame.clone());
                }
            }
        }
        None
    }
}

/// The task that encodes. The connection may end before it.
struct EncodingTask(Weak<Outgoing>);

impl Drop for EncodingTask {
    fn drop(&mut self) {
        if let Some(outgoing) = self.0.upgrade() {
            outgoing.unencoded.borrow_mut().at_work = false;
            // The writer may have waited for this to end.
            outgoing.wake_writer();
        }
    }
}

impl EncodingTask {
    async fn run(self) {
        while let Some(outgoing) = self.0.upgrade() {
            let next = outgoing.unencoded.borrow_mut().begin();
            let Some((number, message)) = next else {
                return;
            };
            drop(outgoing);
            if let Frames::Encoded(encoded, newest) = &message.frames {
                // Throttling keeps the newest, so it has to see all of them.
                if newest.is_none() && encoded.at_hand().is_none() {
                    self.wait_for_room().await;
                }
                if encoded.messages().await.messages.len() > FREE_FRAMES {
                    // Many other clients may have as many messages to go through.
                    turns::read().await;
                }
            }
            if let Some(outgoing) = self.0.upgrade() {
                let mut unencoded = outgoing.unencoded.borrow_mut();
                unencoded.end(&message.topic);
                let is_wanted = unencoded.is_wanted(number, &message.topic);
                drop(unencoded);
                if is_wanted {
                    let _ = outgoing.pass(message);
                    outgoing.turn.note_encoded();
                }
                outgoing.wake_writer();
            }
            tokio::task::yield_now().await;
        }
    }

    /// Waits while enough waits for the client, unless other topics bring more than it takes: then this message has its
    /// place among theirs.
    async fn wait_for_room(&self) {
        let mut dropped = None;
        while let Some(outgoing) = self.0.upgrade() {
            let now = outgoing.outbox.borrow().dropped();
            let goes_on = *dropped.get_or_insert(now) == now && outgoing.queued_bytes() > ENOUGH;
            drop(outgoing);
            if !goes_on {
                return;
            }
            sleep(LOOK_AGAIN).await;
        }
    }
}
