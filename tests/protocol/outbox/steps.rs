//! Throttled topics, messages that wait for a long time, and bounded queues, step by step.
//!
//! The message `a1` is on the topic `/a`. Times are in ms.

use std::time::Duration;

use bytes::Bytes;

use super::Bench;
use pendularm::protocol::catalog::Topic;
use pendularm::protocol::outbox::{MAX_MESSAGE, Room, Throttle};

/// The steps of one test, in order. Each acts on the outbox, or compares it.
struct Steps(Bench);

/// The topic with this letter.
fn topic(letter: &str) -> String {
    format!("/{letter}")
}

impl Steps {
    fn new() -> Self {
        Self(Bench::new())
    }

    // ---- acts -------------------------------------------------------------------------------------------------------

    /// Messages, each on the topic of its first letter.
    fn push(mut self, messages: &[&'static str]) -> Self {
        for message in messages {
            self.0.push(&topic(&message[..1]), Bytes::from(*message));
        }
        self
    }

    fn feedback(mut self, text: &'static str) -> Self {
        self.0.outbox.push_feedback(text.into(), self.0.now);
        self
    }

    fn too_long_feedback(mut self) -> Self {
        let long = vec![b'x'; MAX_MESSAGE + 1].into();
        self.0.outbox.push_feedback(long, self.0.now);
        self
    }

    fn goal_end(mut self, text: &'static str) -> Self {
        self.0.push(Topic::IkResult.name(), Bytes::from(text));
        self
    }

    fn response(mut self, text: &'static str) -> Self {
        self.0.respond(text, &[]);
        self
    }

    /// A response that outdates what is held of a topic.
    fn outdating_response(mut self, text: &'static str, letter: &str) -> Self {
        self.0.respond(text, &[topic(letter).as_str()]);
        self
    }

    /// An interval, and the number of messages that are held back.
    fn throttle(mut self, letter: &str, interval: u64, held_back: usize) -> Self {
        self.0.throttle(&topic(letter), interval, held_back);
        self
    }

    fn queue_length(mut self, letter: &str, most: usize) -> Self {
        let queue_length = Some(most);
        let throttle = Throttle {
            queue_length,
            ..Throttle::NONE
        };
        let topic = topic(letter).into();
        self.0.outbox.configure(&topic, Some(throttle));
        self
    }

    fn unsubscribe(mut self, letter: &str) -> Self {
        self.0.outbox.configure(&topic(letter).into(), None);
        self
    }

    /// A slow client with room for these bytes, and the age up to which a message is fresh.
    fn room(mut self, bytes: u64, fresh: u64) -> Self {
        let fresh = Duration::from_millis(fresh);
        self.0.outbox.allow(Room::Bytes(bytes), fresh);
        self
    }

    fn pass(mut self, time: u64) -> Self {
        self.0.advance(time);
        self
    }

    fn written(mut self, bytes: usize) -> Self {
        self.0.outbox.note_written(bytes);
        self
    }

    // ---- comparisons ------------------------------------------------------------------------------------------------

    /// Takes all frames that may leave.
    fn takes(self, frames: &[&str]) -> Self {
        self.takes_at_most(usize::MAX, frames)
    }

    fn takes_at_most(mut self, bytes: usize, frames: &[&str]) -> Self {
        assert_eq!(self.0.take(usize::MAX, bytes), frames);
        self
    }

    fn takes_one(mut self, frame: &str) -> Self {
        assert_eq!(self.0.take(1, usize::MAX), [frame]);
        self
    }

    /// The time until the next release.
    fn due_in(self, time: u64) -> Self {
        let due = self.0.now + Duration::from_millis(time);
        assert_eq!(self.0.outbox.next_release(), Some(due));
        self
    }

    fn nothing_due(self) -> Self {
        assert_eq!(self.0.outbox.next_release(), None);
        self
    }

    fn counted_bytes(self, bytes: usize) -> Self {
        assert_eq!(self.0.outbox.topic_bytes(), bytes);
        self
    }

    fn waiting(self, messages: usize) -> Self {
        assert_eq!(self.0.outbox.topic_count(), messages);
        self
    }

    fn dropped(self, messages: u64) -> Self {
        assert_eq!(self.0.outbox.dropped(), messages);
        self
    }
}

#[test]
fn the_newest_messages_are_held_and_one_leaves_per_interval() {
    Steps::new()
        .throttle("a", 100, 2)
        .push(&["a1", "a2", "a3", "a4"])
        .counted_bytes(6)
        .takes(&["a1"])
        .counted_bytes(4)
        .due_in(100)
        .pass(99)
        .takes(&[])
        .due_in(1)
        .pass(1)
        .takes(&["a3"])
        .due_in(100)
        .pass(100)
        .takes(&["a4"])
        .nothing_due()
        .counted_bytes(0)
        .dropped(0);
}

#[test]
fn an_interval_counts_from_the_last_release_also_from_a_late_one() {
    Steps::new()
        .throttle("a", 100, 2)
        .push(&["a1"])
        .takes(&["a1"])
        .pass(100)
        .push(&["a2"])
        .nothing_due()
        .takes(&["a2"])
        .push(&["a3", "a4"])
        .takes(&[])
        .pass(350)
        .takes(&["a3"])
        .due_in(100)
        .pass(99)
        .takes(&[])
        .pass(1)
        .takes(&["a4"]);
}

#[test]
fn topics_are_throttled_apart_and_the_earliest_is_released_first() {
    Steps::new()
        .throttle("a", 100, 1)
        .throttle("b", 30, 1)
        .push(&["a1", "b1", "a2", "b2"])
        .takes(&["a1", "b1"])
        .due_in(30)
        .pass(30)
        .takes(&["b2"])
        .due_in(70)
        .pass(70)
        .takes(&["a2"]);
}

#[test]
fn a_message_enters_the_order_when_it_is_released() {
    Steps::new()
        .throttle("a", 100, 1)
        .push(&["a1"])
        .takes(&["a1"])
        .push(&["a2", "b1"])
        .response("r1")
        .pass(100)
        .push(&["b2"])
        .takes(&["b1", "r1", "a2", "b2"]);
}

#[test]
fn a_response_outdates_what_is_held_of_its_topic() {
    Steps::new()
        .throttle("a", 100, 2)
        .throttle("b", 100, 2)
        .push(&["a1", "b1", "a2", "b2"])
        .takes(&["a1", "b1"])
        .outdating_response("r1", "a")
        .counted_bytes(2)
        .takes(&["r1"])
        .pass(100)
        .takes(&["b2"])
        .dropped(0);
}

#[test]
fn an_unsubscription_discards_what_is_held_and_the_throttle() {
    Steps::new()
        .throttle("a", 100, 2)
        .push(&["a1", "a2"])
        .takes(&["a1"])
        .unsubscribe("a")
        .nothing_due()
        .counted_bytes(0)
        .push(&["a3", "a4"])
        .takes(&["a3", "a4"])
        .throttle("a", 100, 2)
        .push(&["a5"])
        .takes(&["a5"])
        .dropped(0);
}

#[test]
fn the_end_of_a_throttle_releases_what_is_held_behind_what_waits() {
    Steps::new()
        .throttle("a", 100, 2)
        .push(&["a1", "a2", "a3"])
        .takes(&["a1"])
        .push(&["b1"])
        .throttle("a", 0, 1)
        .nothing_due()
        .takes(&["b1", "a2", "a3"])
        .push(&["a4", "a5"])
        .takes(&["a4", "a5"]);
}

#[test]
fn a_shorter_queue_keeps_the_newest_message() {
    Steps::new()
        .throttle("a", 100, 3)
        .push(&["a1", "a2", "a3", "a4"])
        .takes(&["a1"])
        .throttle("a", 100, 1)
        .counted_bytes(2)
        .pass(100)
        .takes(&["a4"])
        .dropped(0);
}

#[test]
fn another_interval_counts_from_the_last_release_too() {
    Steps::new()
        .throttle("a", 100, 1)
        .push(&["a1"])
        .takes(&["a1"])
        .pass(10)
        .throttle("a", 50, 1)
        .push(&["a2"])
        .due_in(40)
        .pass(40)
        .takes(&["a2"]);
}

#[test]
fn a_message_older_than_a_second_is_dropped_unless_it_is_the_newest_of_its_topic() {
    Steps::new()
        .push(&["a1", "b1", "a2", "a3"])
        .response("r1")
        .pass(999)
        .takes_one("a1")
        .pass(1)
        .takes_one("b1")
        .dropped(0)
        .pass(1)
        .takes(&["a3", "r1"])
        .dropped(1)
        .counted_bytes(0);
}

#[test]
fn an_old_message_is_removed_as_soon_as_its_topic_has_a_newer_one() {
    Steps::new()
        .push(&["a1", "b1"])
        .pass(1001)
        .push(&["c1"])
        .waiting(3)
        .push(&["a2"])
        .dropped(1)
        .waiting(3)
        .takes_at_most(6, &["b1", "c1", "a2"]);
}

#[test]
fn after_an_old_message_is_dropped_half_a_second_is_too_old_until_the_queue_is_empty() {
    Steps::new()
        .push(&["a1", "a2"])
        .pass(1001)
        .push(&["a3", "a4"])
        .dropped(2)
        .takes_one("a3")
        .push(&["a5"])
        .pass(501)
        .takes(&["a5"])
        .dropped(3)
        .push(&["a6", "a7"])
        .pass(501)
        .takes(&["a6", "a7"])
        .push(&["b1"])
        .pass(1001)
        .push(&["a8", "a9"])
        .pass(501)
        .takes(&["b1", "a8", "a9"])
        .dropped(3);
}

#[test]
fn the_end_of_a_goal_is_never_too_old() {
    Steps::new()
        .goal_end("g1")
        .goal_end("g2")
        .push(&["a1", "a2"])
        .pass(1001)
        .goal_end("g3")
        .pass(1001)
        .push(&["a3"])
        .dropped(2)
        .takes(&["g1", "g2", "g3", "a3"])
        .dropped(2)
        .goal_end("g4")
        .response("r1")
        .pass(300)
        .goal_end("g5")
        .room(0, 200)
        .takes(&["g4", "r1"])
        .room(9, 0)
        .takes(&["g5"]);
}

#[test]
fn the_age_of_a_message_counts_from_its_release_by_the_throttle() {
    Steps::new()
        .throttle("a", 5000, 2)
        .push(&["a1", "a2", "a3"])
        .takes(&["a1"])
        .pass(5000)
        .takes(&["a2"])
        .pass(5000)
        .takes(&["a3"])
        .dropped(0);
}

#[test]
fn a_queue_length_bounds_the_queue_of_a_slow_client_which_has_been_offered_a_message() {
    Steps::new()
        .queue_length("a", 2)
        .push(&["a1", "a2", "a3"])
        .takes_one("a1")
        .push(&["a4", "b4", "a5", "b5"])
        .dropped(2)
        .written(2)
        .takes(&["a4", "b4", "a5", "b5"])
        .throttle("a", 100, 1)
        .push(&["a6", "a7"])
        .takes(&["a6"]);
}

#[test]
fn a_queue_length_counts_no_other_topics_old_message() {
    Steps::new()
        .push(&["c1", "b1"])
        .pass(1001)
        .queue_length("a", 1)
        .push(&["a1", "a2", "a3"])
        .takes_one("c1")
        .push(&["a4"])
        .dropped(3)
        .takes(&["b1", "a4"]);
}

#[test]
fn a_full_socket_takes_only_fresh_messages_ahead_of_a_response() {
    Steps::new()
        .push(&["a1", "b1"])
        .pass(300)
        .push(&["a2"])
        .room(0, 200)
        .takes(&[])
        .response("r1")
        .push(&["a3"])
        .takes(&["b1", "a2", "r1"])
        .room(1, 0)
        .takes(&["a3"]);
}

#[test]
fn feedback_is_not_throttled_and_replaces_no_message_of_a_topic_with_the_actions_name() {
    Steps::new()
        .throttle("a", 1000, 1)
        .push(&["a1", "a2"])
        .feedback("f3")
        .feedback("f4")
        .too_long_feedback()
        .dropped(1)
        .takes(&["a1", "f3", "f4"])
        .pass(1000)
        .takes(&["a2"]);
}
