//! A record of everything sent in a session, to compare received frames with it.

use std::collections::HashMap;

use pendularm::protocol::wire::json::accept_literals;

use crate::json::Json;

/// Everything that clients have sent.
#[derive(Debug, Default)]
pub struct Book {
    /// Messages by number.
    messages: HashMap<u64, Message>,
    /// Arguments of calls to clients' services, by call.
    arguments: HashMap<String, Json>,
    /// Answers that providers gave, by call.
    answers: HashMap<String, (bool, Json)>,
    /// Whether a client may have sent something that is not recorded here.
    pub is_forged: bool,
}

#[derive(Debug)]
struct Message {
    from: u64,
    topic: String,
    payload: Json,
}

impl Book {
    /// Records a published message.
    pub fn publish(&mut self, number: u64, from: u64, topic: &str, payload: &str) {
        let message = Message {
            from,
            topic: slashed(topic),
            payload: value(payload),
        };
        self.messages.insert(number, message);
    }

    /// Records a call of another client's service.
    pub fn call(&mut self, id: &str, payload: &str) {
        self.arguments.insert(id.to_owned(), value(payload));
    }

    /// Records a provider's answer.
    pub fn answer(&mut self, id: &str, result: bool, payload: &str) {
        self.answers.insert(id.to_owned(), (result, value(payload)));
    }

    /// Asserts that a message is the published one, on its topic.
    pub fn check_message(&self, number: u64, from: u64, topic: &str, payload: Option<&Json>) {
        if self.is_forged {
            return;
        }
        let sent = self.messages.get(&number);
        let sent = sent.unwrap_or_else(|| panic!("message {number} was never sent"));
        assert_eq!(sent.from, from, "the sender of message {number}");
        assert_eq!(sent.topic, slashed(topic), "the topic of message {number}");
        check(&sent.payload, payload, "message", &number);
    }

    /// Asserts that a provider gets the arguments of the call.
    pub fn check_call(&self, id: &str, payload: Option<&Json>) {
        if let Some(sent) = self.arguments.get(id).filter(|_| !self.is_forged) {
            check(sent, payload, "call", &id);
        }
    }

    /// Asserts that the caller `id` gets the answer of its call's provider.
    pub fn check_answer(&self, id: &str, said_of: &str, result: bool, payload: Option<&Json>) {
        if self.is_forged {
            return;
        }
        assert_eq!(said_of, id, "the answer to another call");
        let said = self.answers.get(id);
        let (good, sent) = said.unwrap_or_else(|| panic!("nobody has answered {id}"));
        assert_eq!(*good, result, "the result of {id}");
        check(sent, payload, "answer", &id);
    }
}

fn check(sent: &Json, received: Option<&Json>, what: &str, which: &dyn std::fmt::Debug) {
    let same_number = |sent: &Json, received: &Json| sent.number() == received.number();
    let is_same = received.is_some_and(|received| sent.becomes(received, same_number));
    assert!(is_same, "{what} {which:?}: {sent:?} became {received:?}");
}

/// A name with its slash.
fn slashed(topic: &str) -> String {
    if topic.starts_with('/') {
        topic.to_owned()
    } else {
        format!("/{topic}")
    }
}

/// A value in Python's JSON. The frame target compares how `NaN` and `Infinity` are read.
fn value(text: &str) -> Json {
    let strict = accept_literals(text.to_owned());
    Json::read(&strict).unwrap_or_else(|| panic!("a session sends JSON: {strict}"))
}
