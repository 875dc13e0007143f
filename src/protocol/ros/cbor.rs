//! Messages as binary: `cbor` (the message itself) and `cbor-raw` (its CDR bytes), for subscribers over WebSocket.
//!
//! Arrays of numbers are typed arrays (RFC 8746), little-endian, which clients read without parsing each entry. A
//! number that is not finite is `null` in JSON, and NaN here if the type says that it is a number.
//!
//! **Invariant:** no JSON frame begins with the first byte of a frame here.

use serde_json::Number;

use super::cdr;
use super::sink::Sink;
use super::stamps::member;
use super::tree::{MessageTree, TreeText};
use crate::protocol::catalog::Field;
use crate::protocol::catalog::types;
use crate::protocol::catalog::types::{Count, Type};

/// Major types of CBOR (RFC 8949), in the upper three bits.
const UNSIGNED: u8 = 0x00;
const NEGATIVE: u8 = 0x20;
const BYTES: u8 = 0x40;
const TEXT: u8 = 0x60;
const ARRAY: u8 = 0x80;
const MAP: u8 = 0xa0;
const TAG: u8 = 0xc0;
const FALSE: u8 = 0xf4;
const TRUE: u8 = 0xf5;
const NULL: u8 = 0xf6;
const FLOAT64: u8 = 0xfb;
/// Typed arrays, little-endian.
const FLOAT64_ARRAY: u64 = 86;
const INT32_ARRAY: u64 = 78;

/// A whole `publish` frame with the message in CBOR; `None` if it has more than `most` bytes. `type_name` is the
/// message's type, if it is known.
#[must_use]
pub fn publish(
    topic: &str,
    type_name: Option<&str>,
    msg: &MessageTree<'_>,
    most: usize,
) -> Option<Vec<u8>> {
    let mut out = head(topic, most);
    match type_name.and_then(types::find) {
        Some(one) => message(&mut out, one, msg),
        None => untyped(&mut out, msg),
    }
    out.finish()
}

/// A whole `publish` frame with the message in CDR; `None` if its type is not known, or if it has more than `most`
/// bytes.
#[must_use]
pub fn publish_raw(
    topic: &str,
    type_name: &str,
    msg: &MessageTree<'_>,
    most: usize,
) -> Option<Vec<u8>> {
    let one = types::find(type_name)?;
    let (secs, nsecs) = stamp(msg);
    let mut out = head(topic, most);
    length(&mut out, MAP, 3);
    text(&mut out, "secs");
    length(&mut out, UNSIGNED, secs);
    text(&mut out, "nsecs");
    length(&mut out, UNSIGNED, nsecs);
    text(&mut out, "bytes");
    let bytes = cdr::encode_within(one, msg, most)?;
    length(&mut out, BYTES, bytes.len() as u64);
    out.extend(&bytes);
    out.finish()
}

/// The time in the message's header; 0 if it has none.
fn stamp(msg: &MessageTree<'_>) -> (u64, u64) {
    let places = [
        "/header/stamp",
        "/stamp",
        "/clock",
        "/transforms/0/header/stamp",
    ];
    let found = places.into_iter().find_map(|place| msg.pointer(place));
    let part = |name: &str| found.and_then(|one| member(one, name)?.number()?.as_u64());
    (
        part("sec").unwrap_or_default(),
        part("nanosec").unwrap_or_default(),
    )
}

fn head(topic: &str, most: usize) -> Sink {
    let mut out = Sink::new(most);
    length(&mut out, MAP, 3);
    text(&mut out, "op");
    text(&mut out, "publish");
    text(&mut out, "topic");
    text(&mut out, topic);
    text(&mut out, "msg");
    out
}

/// A head: the major type and a number, in as few bytes as possible.
#[allow(
    clippy::cast_possible_truncation,
    reason = "each arm has just seen that the number fits"
)]
fn length(out: &mut Sink, major: u8, number: u64) {
    match number {
        0..=23 => out.push(major + number as u8),
        24..=0xff => out.extend(&[major + 24, number as u8]),
        0x100..=0xffff => {
            out.push(major + 25);
            out.extend(&(number as u16).to_be_bytes());
        }
        0x1_0000..=0xffff_ffff => {
            out.push(major + 26);
            out.extend(&(number as u32).to_be_bytes());
        }
        _ => {
            out.push(major + 27);
            out.extend(&number.to_be_bytes());
        }
    }
}

fn text(out: &mut Sink, text: &str) {
    length(out, TEXT, text.len() as u64);
    out.extend(text.as_bytes());
}

fn float(out: &mut Sink, value: f64) {
    out.push(FLOAT64);
    out.extend(&value.to_be_bytes());
}

/// Writes every present field, in the type's order. Members that the type does not have are omitted, except the ROS 1
/// names of stamps.
fn message(out: &mut Sink, one: Type, msg: &MessageTree<'_>) {
    let has = |name: &str| msg.get(name).is_some();
    if msg.members().is_none() || (has("sec") && has("secs")) {
        return untyped(out, msg);
    }
    let found = |field: &'static Field| Some((field, member(msg, field.name)?));
    let there = one.fields.iter().filter_map(found);
    length(out, MAP, there.clone().count() as u64);
    for (field, value) in there {
        text(out, field.name);
        let (kind, count) = field.element();
        // The type is looked up once for all entries.
        let inner = cdr::message_type(kind);
        match count {
            Count::One => single(out, kind, inner, value),
            Count::Any | Count::Exactly(_) => many(out, kind, inner, value),
        }
    }
}

/// A value of type `kind`. If it is a message, `inner` is its type.
fn single(out: &mut Sink, kind: &str, inner: Option<Type>, value: &MessageTree<'_>) {
    match (kind, value) {
        ("float64" | "float32", MessageTree::Null) => float(out, f64::NAN),
        ("float64" | "float32", MessageTree::Number(number)) => {
            float(out, number.as_f64().unwrap_or(f64::NAN));
        }
        _ => match inner {
            Some(one) => message(out, one, value),
            None => untyped(out, value),
        },
    }
}

fn many(out: &mut Sink, kind: &str, inner: Option<Type>, value: &MessageTree<'_>) {
    let Some(entries) = value.entries() else {
        return untyped(out, value);
    };
    match kind {
        "float64" => {
            length(out, TAG, FLOAT64_ARRAY);
            length(out, BYTES, entries.len() as u64 * 8);
            for entry in entries {
                let entry = entry.number().and_then(Number::as_f64);
                out.extend(&entry.unwrap_or(f64::NAN).to_le_bytes());
            }
        }
        "int32" => {
            length(out, TAG, INT32_ARRAY);
            length(out, BYTES, entries.len() as u64 * 4);
            for entry in entries {
                let entry = entry.number().and_then(Number::as_i64);
                let entry = entry.and_then(|entry| i32::try_from(entry).ok());
                out.extend(&entry.unwrap_or_default().to_le_bytes());
            }
        }
        _ => {
            length(out, ARRAY, entries.len() as u64);
            for entry in entries {
                single(out, kind, inner, entry);
            }
        }
    }
}

/// Writes any JSON value. The recursion is as deep as a frame may be nested, which the frame's reader has checked.
fn untyped(out: &mut Sink, value: &MessageTree<'_>) {
    match value {
        MessageTree::Null => out.push(NULL),
        MessageTree::Bool(false) => out.push(FALSE),
        MessageTree::Bool(true) => out.push(TRUE),
        MessageTree::Number(number) => match (number.as_u64(), number.as_i64()) {
            (Some(number), _) => length(out, UNSIGNED, number),
            // CBOR writes -1 - n for n; the complement of a negative number is that n.
            (None, Some(number)) => length(out, NEGATIVE, (!number).unsigned_abs()),
            (None, None) => float(out, number.as_f64().unwrap_or(f64::NAN)),
        },
        MessageTree::Text(string) => text(out, string),
        MessageTree::Array(entries) => {
            length(out, ARRAY, entries.len() as u64);
            for entry in entries {
                untyped(out, entry);
            }
        }
        MessageTree::Object(members) => {
            length(out, MAP, members.len() as u64);
            for (TreeText(name), value) in members {
                text(out, name);
                untyped(out, value);
            }
        }
    }
}
