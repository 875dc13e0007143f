//! Reads every operation except published messages, calls and goals. `providers.rs` reads those of clients that serve.
//!
//! **Invariant:** every number is within its limit, and a binary encoding has no fragment size.

use std::time::Duration;

use serde_json::value::RawValue;

use super::members::Members;
use super::types::{
    Compression, Encoding, MAX_QUEUE_LENGTH, MAX_THROTTLE, Served, Subscribe, Verbosity, duration,
};
use super::{Op, Problem, providers};
use crate::protocol::messages::{ErrorForm, Level};
use crate::protocol::wire::fragments::Piece;
use crate::protocol::wire::json;

/// Any operation except a published message, a call or a goal.
pub(super) fn other(members: &Members<'_>) -> Result<Op, Problem> {
    Ok(match members.op {
        "advertise" => Op::Advertise {
            topic: members.name("topic")?,
            type_name: members.optional_text("type")?,
        },
        "unadvertise" => Op::Unadvertise {
            topic: members.name("topic")?,
        },
        "subscribe" => Op::Subscribe(subscription(members)?),
        "unsubscribe" => Op::Unsubscribe {
            topic: members.name("topic")?,
        },
        "cancel_action_goal" => Op::CancelActionGoal {
            action: members.name("action")?,
        },
        "fragment" => Op::Fragment(piece(members)?),
        "set_level" => Op::SetLevel {
            verbosity: verbosity(members)?,
            errors: error_form(members)?,
        },
        "auth" => auth(members)?,
        op if op.contains("action") => providers::serve(members, Served::Action)?,
        _ => providers::serve(members, Served::Service)?,
    })
}

fn subscription(members: &Members<'_>) -> Result<Subscribe, Problem> {
    members.short("id", members.get("id").map_or("", RawValue::get))?;
    Ok(Subscribe {
        topic: members.name("topic")?,
        type_name: members.optional_text("type")?,
        throttle: throttle(members)?,
        queue_length: queue_length(members)?,
        // Merging with the default removes the fragment size of a binary encoding, which is never split.
        encoding: Encoding::default().merged(Encoding {
            compression: compression(members)?,
            fragment_size: fragment_size(members)?,
            ros1_stamps: false,
        }),
    })
}

fn compression(members: &Members<'_>) -> Result<Compression, Problem> {
    let expected = "none, png, cbor or cbor-raw";
    let compression = members.optional("compression", expected, |raw| {
        match json::text(raw)?.as_ref() {
            "none" | "png" => Some(Compression::None),
            "cbor" => Some(Compression::Cbor),
            "cbor-raw" => Some(Compression::CborRaw),
            _ => None,
        }
    })?;
    Ok(compression.unwrap_or_default())
}

fn fragment_size(members: &Members<'_>) -> Result<Option<usize>, Problem> {
    let size = members.optional("fragment_size", "an integer, at least 1", |raw| {
        match raw.get() {
            "null" => Some(None),
            _ => json::integer(raw).filter(|size| *size > 0).map(Some),
        }
    })?;
    // With only powers of two, a message is split in few ways, for any number of subscribers.
    let size = size.flatten().map(|size| 1 << size.ilog2());
    Ok(size.and_then(|size: u64| usize::try_from(size).ok()))
}

fn throttle(members: &Members<'_>) -> Result<Duration, Problem> {
    let expected = "a number of ms, at least 0";
    let rate = members.optional("throttle_rate", expected, |raw| {
        json::number(raw).filter(|rate| rate.is_finite() && *rate >= 0.0)
    })?;
    Ok(duration(rate.unwrap_or_default() / 1000.0, MAX_THROTTLE))
}

fn queue_length(members: &Members<'_>) -> Result<usize, Problem> {
    let length = members.optional("queue_length", "an integer, at least 0", json::integer)?;
    let length = usize::try_from(length.unwrap_or_default());
    Ok(length.unwrap_or(MAX_QUEUE_LENGTH).min(MAX_QUEUE_LENGTH))
}

fn verbosity(members: &Members<'_>) -> Result<Verbosity, Problem> {
    let expected = "info, warning, error or none";
    members.typed("level", expected, |raw| {
        let name = json::text(raw)?;
        let mut levels = Level::ALL.into_iter();
        let level = levels.find(|level| level.name() == name);
        (level.is_some() || name == "none").then_some(Verbosity(level))
    })
}

fn error_form(members: &Members<'_>) -> Result<Option<ErrorForm>, Problem> {
    members.optional("errors", "object or text", |raw| {
        let name = json::text(raw)?;
        let mut forms = ErrorForm::ALL.into_iter();
        forms.find(|form| form.name() == name)
    })
}

fn piece(members: &Members<'_>) -> Result<Piece, Problem> {
    let id = members.required("id")?;
    members.short("id", id.get())?;
    // `Fragments::take` refuses a number that does not fit.
    let index = |field| {
        let number = members.typed(field, "an integer, at least 0", json::integer)?;
        Ok(usize::try_from(number).unwrap_or(usize::MAX))
    };
    Ok(Piece {
        id: id.get().to_owned(),
        data: members.typed("data", "a string", json::text)?.into_owned(),
        num: index("num")?,
        total: index("total")?,
    })
}

/// Reads a client's token, if there is one. A command of this program marks itself.
fn auth(members: &Members<'_>) -> Result<Op, Problem> {
    let is_command = members.get("command").is_some() && members.boolean("command")?;
    let token = members
        .get("token")
        .map(|raw| secret(members, raw))
        .transpose()?;
    Ok(Op::Auth { token, is_command })
}

/// A token. An error does not repeat it.
fn secret(members: &Members<'_>, raw: &RawValue) -> Result<String, Problem> {
    let token = json::text(raw).ok_or(Problem::Mistyped {
        op: members.op,
        field: "token",
        expected: "a string",
        found: "something else".to_owned(),
    })?;
    members.short("token", &token)?;
    Ok(token.into_owned())
}
