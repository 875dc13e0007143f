//! Everything that one client receives, compared with the required frames.

use super::*;

impl Player {
    pub(super) fn is_owed(&self) -> bool {
        !self.is_excused && !self.has_ended
    }

    pub(super) fn hear(&mut self, line: &str) {
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

    pub(super) fn hear_piece(&mut self, frame: &Json) {
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

    pub(super) fn hear_message(&mut self, frame: &Json) {
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

    /// Records that bytes may contain a message, a call or an answer that the model does not know.
    pub(super) fn note_forgery(&self, bytes: &[u8]) {
        let text = String::from_utf8_lossy(bytes);
        let words = ["publish", "service", "fragment", "\\u"];
        let mut book = self.book.borrow_mut();
        book.is_forged |= words.iter().any(|word| text.contains(word));
    }

    pub(super) fn note(&mut self, topic: &str, from: f64, number: f64) {
        let before = self
            .latest
            .insert((topic.to_owned(), from as u64), number as u64);
        let excused = self.is_excused;
        assert!(
            excused || before.is_none_or(|before| before < number as u64),
            "{number} after {before:?} on {topic}"
        );
    }

    pub(super) fn hear_binary(&mut self, bytes: &[u8]) {
        let frame = cbor::read(bytes).expect("CBOR");
        assert_eq!(frame.get("op").and_then(Json::text), Some("publish"));
        self.hear_message(&frame);
    }
}
