//! Messages as binary: `cbor` (the message itself) and `cbor-raw` (its CDR bytes), for subscribers over WebSocket.
//!
//! Arrays of numbers are typed arrays (RFC 8746), little-endian, which clients read without parsing each entry. A
//! number that is not finite is `null` in JSON, and NaN here if the type says that it is a number. A string that is not
//! valid text has no encoding.
//!
//! **Invariant:** no JSON frame begins with the first byte of a frame here.

use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_json::value::RawValue;

use super::cdr;
use super::sink::Sink;
use super::stamps::members;
use crate::protocol::catalog::types;
use crate::protocol::catalog::types::{Count, Type};
use crate::protocol::wire::json;

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
/// Added to the major type of an array or a map without a count, and the mark at its end.
const ANY_NUMBER: u8 = 0x1f;
const END: u8 = 0xff;
/// Typed arrays, little-endian.
const FLOAT64_ARRAY: u64 = 86;
const INT32_ARRAY: u64 = 78;

/// A whole `publish` frame with the message in CBOR; `None` if it has more than `most` bytes. `type_name` is the
/// message's type, if it is known.
#[must_use]
pub fn publish(
    topic: &str,
    type_name: Option<&str>,
    msg: &RawValue,
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
pub fn publish_raw(topic: &str, type_name: &str, msg: &RawValue, most: usize) -> Option<Vec<u8>> {
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
fn stamp(msg: &RawValue) -> (u64, u64) {
    let names = ["header", "stamp", "clock", "transforms"];
    let [header, stamp, clock, transforms] = json::members(msg.get(), &names).unwrap_or_default();
    let first = transforms.and_then(|all| json::entries(all, 1)?.first.pop());
    let found = member(header, "stamp").or(stamp).or(clock);
    let found = found.or_else(|| member(member(first, "header"), "stamp"));
    let part = |name, ros1_name| {
        let part = member(found, name).or_else(|| member(found, ros1_name));
        part.and_then(|part| part.get().parse().ok())
    };
    (
        part("sec", "secs").unwrap_or_default(),
        part("nanosec", "nsecs").unwrap_or_default(),
    )
}

fn member<'a>(object: Option<&'a RawValue>, name: &str) -> Option<&'a RawValue> {
    let [value] = json::members(object?.get(), &[name]).ok()?;
    value
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
fn message(out: &mut Sink, one: Type, msg: &RawValue) {
    let has_both = |[own, ros1]: &[Option<&RawValue>; 2]| own.is_some() && ros1.is_some();
    let Some(members) = members(one, msg).filter(|members| !members.iter().any(has_both)) else {
        return untyped(out, msg);
    };
    let values = members.iter().map(|[own, ros1]| own.or(*ros1));
    let fields = one.fields.iter().zip(values);
    let there = fields.filter_map(|(field, value)| Some((field, value?)));
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
fn single(out: &mut Sink, kind: &str, inner: Option<Type>, value: &RawValue) {
    let number = match value.get() {
        "null" => Some(f64::NAN),
        _ => json::number(value),
    };
    match (kind, inner, number) {
        ("float64" | "float32", _, Some(number)) => float(out, number),
        (_, Some(one), _) => message(out, one, value),
        _ => untyped(out, value),
    }
}

fn many(out: &mut Sink, kind: &str, inner: Option<Type>, value: &RawValue) {
    let Some(count) = json::entries(value, 0).map(|entries| entries.count as u64) else {
        return untyped(out, value);
    };
    match kind {
        "float64" => {
            length(out, TAG, FLOAT64_ARRAY);
            length(out, BYTES, count * 8);
        }
        "int32" => {
            length(out, TAG, INT32_ARRAY);
            length(out, BYTES, count * 4);
        }
        _ => length(out, ARRAY, count),
    }
    json::for_each(value, |entry| match kind {
        "float64" => out.extend(&json::number(entry).unwrap_or(f64::NAN).to_le_bytes()),
        "int32" => out.extend(&entry.get().parse::<i32>().unwrap_or_default().to_le_bytes()),
        _ => single(out, kind, inner, entry),
    });
}

/// Writes any JSON value in one pass, so its arrays and objects end with a mark instead of beginning with a count.
fn untyped(out: &mut Sink, value: &RawValue) {
    if value.deserialize_any(Untyped(out)).is_err() {
        out.fail();
    }
}

struct Untyped<'out>(&'out mut Sink);

impl<'a> DeserializeSeed<'a> for Untyped<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'a>>(self, reader: D) -> Result<(), D::Error> {
        reader.deserialize_any(self)
    }
}

impl<'a> Visitor<'a> for Untyped<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_unit<E>(self) -> Result<(), E> {
        self.0.push(NULL);
        Ok(())
    }

    fn visit_bool<E>(self, value: bool) -> Result<(), E> {
        self.0.push(if value { TRUE } else { FALSE });
        Ok(())
    }

    fn visit_u64<E>(self, value: u64) -> Result<(), E> {
        length(self.0, UNSIGNED, value);
        Ok(())
    }

    fn visit_i64<E>(self, value: i64) -> Result<(), E> {
        // CBOR writes -1 - n for n; the complement of a negative number is that n.
        length(self.0, NEGATIVE, (!value).unsigned_abs());
        Ok(())
    }

    fn visit_f64<E>(self, value: f64) -> Result<(), E> {
        float(self.0, value);
        Ok(())
    }

    fn visit_str<E>(self, value: &str) -> Result<(), E> {
        text(self.0, value);
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'a>>(self, mut entries: A) -> Result<(), A::Error> {
        self.0.push(ARRAY + ANY_NUMBER);
        while entries.next_element_seed(Untyped(self.0))?.is_some() {}
        self.0.push(END);
        Ok(())
    }

    fn visit_map<A: MapAccess<'a>>(self, mut members: A) -> Result<(), A::Error> {
        self.0.push(MAP + ANY_NUMBER);
        while members.next_key_seed(Untyped(self.0))?.is_some() {
            members.next_value_seed(Untyped(self.0))?;
        }
        self.0.push(END);
        Ok(())
    }
}
