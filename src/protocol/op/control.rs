//! Reads every operation except published messages, calls and goals. `providers.rs` reads those of clients that serve.
//!
//! **Invariant:** every number is within its limit, and a binary encoding has no fragment size.

use std::borrow::Cow;
use std::time::Duration;

use serde_json::value::RawValue;

use super::types::{
    Compression, Encoding, MAX_QUEUE_LENGTH, MAX_THROTTLE, Served, Subscribe, Verbosity, duration,
};
use super::{Incoming, Members, Op, Problem};
use crate::protocol::messages::{ErrorForm, Level};
use crate::protocol::wire::fragments::Piece;
use crate::protocol::wire::json::{self, Payload};

impl<'a> Members<'a> {
    /// Any operation except a published message, a call or a goal.
    pub(super) fn other(&self) -> Result<Op, Problem> {
        Ok(match self.op {
            "advertise" => Op::Advertise {
                topic: self.name("topic")?,
                type_name: self.optional_text("type")?,
            },
            "unadvertise" => Op::Unadvertise {
                topic: self.name("topic")?,
            },
            "subscribe" => Op::Subscribe(self.subscription()?),
            "unsubscribe" => Op::Unsubscribe {
                topic: self.name("topic")?,
            },
            "cancel_action_goal" => Op::CancelActionGoal {
                action: self.name("action")?,
            },
            "fragment" => Op::Fragment(self.piece()?),
            "set_level" => Op::SetLevel {
                verbosity: self.verbosity()?,
                errors: self.error_form()?,
            },
            "auth" => self.auth()?,
            op if op.contains("action") => self.serve(Served::Action)?,
            _ => self.serve(Served::Service)?,
        })
    }

    pub(super) fn required(&self, field: &'static str) -> Result<&'a RawValue, Problem> {
        self.typed(field, "", Some)
    }

    pub(super) fn optional_text(&self, field: &'static str) -> Result<Option<String>, Problem> {
        let text = self.optional(field, "a string", json::text)?;
        self.short(field, text.as_deref().unwrap_or_default())?;
        Ok(text.map(Cow::into_owned))
    }

    pub(super) fn boolean(&self, field: &'static str) -> Result<bool, Problem> {
        self.typed(field, "true or false", json::boolean)
    }

    fn subscription(&self) -> Result<Subscribe, Problem> {
        self.short("id", self.get("id").map_or("", RawValue::get))?;
        Ok(Subscribe {
            topic: self.name("topic")?,
            type_name: self.optional_text("type")?,
            throttle: self.throttle()?,
            queue_length: self.queue_length()?,
            // Merging with the default removes the fragment size of a binary encoding, which is never split.
            encoding: Encoding::default().merged(Encoding {
                compression: self.compression()?,
                fragment_size: self.fragment_size()?,
                ros1_stamps: false,
            }),
        })
    }

    fn compression(&self) -> Result<Compression, Problem> {
        let expected = "none, png, cbor or cbor-raw";
        let compression = self.optional("compression", expected, |raw| {
            match json::text(raw)?.as_ref() {
                "none" | "png" => Some(Compression::None),
                "cbor" => Some(Compression::Cbor),
                "cbor-raw" => Some(Compression::CborRaw),
                _ => None,
            }
        })?;
        Ok(compression.unwrap_or_default())
    }

    fn fragment_size(&self) -> Result<Option<usize>, Problem> {
        let size = self.optional("fragment_size", "an integer, at least 1", |raw| {
            match raw.get() {
                "null" => Some(None),
                _ => json::integer(raw).filter(|size| *size > 0).map(Some),
            }
        })?;
        // With only powers of two, a message is split in few ways, for any number of subscribers.
        let size = size.flatten().map(|size| 1 << size.ilog2());
        Ok(size.and_then(|size: u64| usize::try_from(size).ok()))
    }

    fn throttle(&self) -> Result<Duration, Problem> {
        let expected = "a number of ms, at least 0";
        let rate = self.optional("throttle_rate", expected, |raw| {
            json::number(raw).filter(|rate| rate.is_finite() && *rate >= 0.0)
        })?;
        Ok(duration(rate.unwrap_or_default() / 1000.0, MAX_THROTTLE))
    }

    fn queue_length(&self) -> Result<usize, Problem> {
        let length = self.optional("queue_length", "an integer, at least 0", json::integer)?;
        let length = usize::try_from(length.unwrap_or_default());
        Ok(length.unwrap_or(MAX_QUEUE_LENGTH).min(MAX_QUEUE_LENGTH))
    }

    fn verbosity(&self) -> Result<Verbosity, Problem> {
        let expected = "info, warning, error or none";
        self.typed("level", expected, |raw| {
            let name = json::text(raw)?;
            let mut levels = Level::ALL.into_iter();
            let level = levels.find(|level| level.name() == name);
            (level.is_some() || name == "none").then_some(Verbosity(level))
        })
    }

    fn error_form(&self) -> Result<Option<ErrorForm>, Problem> {
        self.optional("errors", "object or text", |raw| {
            let name = json::text(raw)?;
            let mut forms = ErrorForm::ALL.into_iter();
            forms.find(|form| form.name() == name)
        })
    }

    fn piece(&self) -> Result<Piece, Problem> {
        let id = self.required("id")?;
        self.short("id", id.get())?;
        // `Fragments::take` refuses a number that does not fit.
        let index = |field| {
            let number = self.typed(field, "an integer, at least 0", json::integer)?;
            Ok(usize::try_from(number).unwrap_or(usize::MAX))
        };
        Ok(Piece {
            id: id.get().to_owned(),
            data: self.typed("data", "a string", json::text)?.into_owned(),
            num: index("num")?,
            total: index("total")?,
        })
    }

    /// Reads a client's token, if there is one. A command of this program marks itself.
    fn auth(&self) -> Result<Op, Problem> {
        let is_command = self.get("command").is_some() && self.boolean("command")?;
        let token = self.get("token").map(|raw| self.secret(raw)).transpose()?;
        Ok(Op::Auth { token, is_command })
    }

    /// A token. An error does not repeat it.
    fn secret(&self, raw: &RawValue) -> Result<String, Problem> {
        let token = json::text(raw).ok_or(Problem::Mistyped {
            op: self.op,
            field: "token",
            expected: "a string",
            found: "something else".to_owned(),
        })?;
        self.short("token", &token)?;
        Ok(token.into_owned())
    }
}

impl Incoming {
    /// Gives an error the id of the pieces of its frame. An op, such as a bad answer, keeps its own id.
    #[must_use]
    pub fn under_id(self, id: Option<Payload>) -> Self {
        match self.op {
            Err(_) => Self { id, ..self },
            Ok(_) => self,
        }
    }
}
