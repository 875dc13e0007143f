//! Messages as CBOR and as CDR: any JSON as a message of any known type, or of none.
//!
//! Asserted: the frame is CBOR that another reader accepts, with the topic. A message of no known type has all members
//! of the JSON. CDR is as long as its bound allows. `tests/protocol` compares messages of known types with their
//! definitions.
//!
//! Input: a byte that chooses the type, the message.

#![no_main]

use libfuzzer_sys::fuzz_target;
use pendularm::protocol::catalog::types;
use pendularm::protocol::ros::cbor;
use pendularm_fuzz::cbor::read;
use pendularm_fuzz::json::Json;
use pendularm_fuzz::limits::{Allowance, READING, hold};
use serde_json::Value;
use serde_json::value::RawValue;

const TOPIC: &str = "/\u{e9}/\"a\"";
/// Bytes of CDR per byte of JSON, and a constant: an entry of an array can be an empty object, which is a whole
/// message.
const GROWTH: usize = 1024;

fuzz_target!(|input: &[u8]| {
    // An entry of a few hundred bytes per byte is read by the others as one value per field.
    let allowance = Allowance {
        time_per_byte: 20 * READING.time_per_byte,
        memory_per_byte: 128 * GROWTH,
        ..READING
    };
    hold(input.len(), allowance, || check(input));
});

fn check(input: &[u8]) {
    let &[kind, ref text @ ..] = input else {
        return;
    };
    let Ok(msg) = serde_json::from_slice::<Value>(text) else {
        return;
    };
    let raw: &RawValue = serde_json::from_slice(text).expect("JSON");
    let known: Vec<&str> = types::all().map(|one| one.name).collect();
    let name = known.get(usize::from(kind)).copied();
    let frame = cbor::publish(TOPIC, name, raw, usize::MAX).expect("room");
    let longer = frame.len() - 1;
    assert_eq!(cbor::publish(TOPIC, name, raw, longer), None);
    assert_ne!(frame.first(), Some(&b'{'));
    let found = read(&frame).expect("CBOR");
    assert_eq!(found.get("op").and_then(Json::text), Some("publish"));
    assert_eq!(found.get("topic").and_then(Json::text), Some(TOPIC));
    let found = found.get("msg").expect("a message");
    let Some(name) = name else {
        return assert!(same(found, &msg), "{found:?} of {msg}");
    };
    check_cdr(name, raw, text.len());
}

/// Whether the message is what it was in JSON.
fn same(found: &Json, msg: &Value) -> bool {
    match (found, msg) {
        (Json::Null, Value::Null) => true,
        (Json::Boolean(found), Value::Bool(value)) => found == value,
        (Json::Number(_), Value::Number(number)) => found.number() == number.as_f64(),
        (Json::Text(found), Value::String(text)) => found.as_deref() == Some(text),
        (Json::Array(found), Value::Array(entries)) => {
            let mut pairs = found.iter().zip(entries);
            found.len() == entries.len() && pairs.all(|(one, other)| same(one, other))
        }
        (Json::Object(found), Value::Object(members)) => {
            // Of repeated names the last member counts.
            let has = |(name, value)| {
                let mut found = found.iter().rev();
                let last = found.find(|(key, _)| key.as_ref() == Some(name));
                last.is_some_and(|(_, one)| same(one, value))
            };
            let is_known = |(key, _): &(Option<String>, Json)| {
                let key = key.as_ref();
                key.is_some_and(|key| members.contains_key(key))
            };
            found.iter().all(is_known) && members.iter().all(has)
        }
        _ => false,
    }
}

fn check_cdr(name: &str, msg: &RawValue, length: usize) {
    let frame = cbor::publish_raw(TOPIC, name, msg, usize::MAX).expect("a known type");
    let found = read(&frame).expect("CBOR");
    let bytes = found.get("msg").and_then(|raw| raw.get("bytes"));
    let Some(Json::Array(bytes)) = bytes else {
        panic!("no bytes in {found:?}");
    };
    let longest = GROWTH * (length + 1);
    assert!(bytes.len() <= longest, "{length} bytes made more");
}
