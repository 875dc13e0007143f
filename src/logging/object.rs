//! Log lines as JSON objects, for programs that read them.
//!
//! **Invariant:** a line is one object with `timestamp`, `level`, `target` and `message`, of bounded length, and
//! nothing on it acts on a terminal, whatever the event's text.

use std::fmt::{self, Write as _};

use tracing::Level;
use tracing::field::{Field, Visit};
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::time::{FormatTime, SystemTime};

use crate::protocol::wire::text::push_quoted;

/// An object that is being written. A text that leads beyond the limit is cut, and members after it are left out.
pub(super) struct LogObject {
    text: String,
    /// \[bytes\].
    limit: usize,
}

impl LogObject {
    pub(super) fn new(level: Level, target: &str, limit: usize) -> Self {
        let mut time = String::new();
        // Only a clock beyond all years fails; the line then goes without.
        let _ = SystemTime.format_time(&mut Writer::new(&mut time));
        let mut object = Self {
            text: String::from("{"),
            limit,
        };
        object.member("timestamp", &time);
        object.member("level", level.as_str());
        object.member("target", target);
        object
    }

    pub(super) fn member(&mut self, name: &str, text: &str) {
        if !self.name(name) {
            return;
        }
        self.text.push('"');
        for character in text.chars() {
            if self.text.len() >= self.limit {
                self.text.push_str("...");
                break;
            }
            push_quoted(&mut self.text, character);
        }
        self.text.push('"');
    }

    /// Begins a member, if there is room.
    fn name(&mut self, name: &str) -> bool {
        // An event has its message, however long the members before it are.
        let has_room = self.text.len() < self.limit || name == "message";
        if has_room {
            if self.text.len() > 1 {
                self.text.push(',');
            }
            let _ = write!(self.text, "\"{name}\":");
        }
        has_room
    }

    fn literal(&mut self, name: &str, value: impl fmt::Display) {
        if self.name(name) {
            let _ = write!(self.text, "{value}");
        }
    }

    pub(super) fn line(mut self) -> Vec<u8> {
        self.text.push_str("}\n");
        self.text.into_bytes()
    }
}

impl Visit for LogObject {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        self.member(field.name(), &format!("{value:?}"));
    }

    fn record_str(&mut self, field: &Field, value: &str) {
        self.member(field.name(), value);
    }

    fn record_i64(&mut self, field: &Field, value: i64) {
        self.literal(field.name(), value);
    }

    fn record_u64(&mut self, field: &Field, value: u64) {
        self.literal(field.name(), value);
    }

    fn record_bool(&mut self, field: &Field, value: bool) {
        self.literal(field.name(), value);
    }
}
