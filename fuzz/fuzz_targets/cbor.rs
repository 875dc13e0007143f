//! Messages as CBOR and as CDR: any JSON as a message of any type that the runtime knows, or of none.
//!
//! What holds: the frame is CBOR that another reader takes, with the topic and, of a message of no known type, all that was
//! in the JSON; CDR is aligned, bounded by what it was made of, and made of anything.
//!
//! Input: a byte that chooses the type, the message.

#![no_main]

use libfuzzer_sys::fuzz_target;
use pendularm::protocol::catalog::types;
use pendularm::protocol::cbor;
use pendularm_fuzz::cbor::read;
use pendularm_fuzz::json::Json;
use serde_json::Value;

const TOPIC: &str = "/\u{e9}/\"a\"";
/// Bytes of CDR per byte of JSON, and besides: an entry of an array can be an empty object, which is a whole message.
const GROWTH: usize = 1024;

fuzz_target!(|input: &[u8]| {
    let &[kind, ref text @ ..] = input else {
        return;
    };
    let Ok(msg) = serde_json::from_slice::<Value>(text) else {
        return;
    };
    let known: Vec<&str> = types::all().map(|one| one.name).collect();
    let name = known.get(usize::from(kind)).copied();
    let frame = cbor::publish(TOPIC, name, &msg);
    assert_ne!(frame.first(), Some(&b'{'));
    let found = read(&frame).expect("CBOR");
    assert_eq!(found.get("op").and_then(Json::text), Some("publish"));
    assert_eq!(found.get("topic").and_then(Json::text), Some(TOPIC));
    let found = found.get("msg").expect("a message");
    match name {
        None => assert!(same(found, &msg), "{found:?} of {msg}"),
        Some(name) => {
            check_fields(found, name, &msg);
            check_cdr(name, &msg, text.len());
        }
    }
});

/// Whether the message is what it was in JSON.
fn same(found: &Json, msg: &Value) -> bool {
    match (found, msg) {
        (Json::Null, Value::Null) => true,
        (Json::Boolean(found), Value::Bool(value)) => found == value,
        (Json::Number(_), Value::Number(number)) => found.number() == number.as_f64(),
        (Json::Text(found), Value::String(text)) => found.as_deref() == Some(text),
        (Json::Array(found), Value::Array(entries)) => {
            found.len() == entries.len()
                && found
                    .iter()
                    .zip(entries)
                    .all(|(one, other)| same(one, other))
        }
        (Json::Object(found), Value::Object(members)) => {
            let has = |(name, value)| {
                found
                    .iter()
                    .any(|(key, one)| key.as_ref() == Some(name) && same(one, value))
            };
            found.len() == members.len() && members.iter().all(has)
        }
        _ => false,
    }
}

/// The fields that are there are those of the type that were there, in its order.
fn check_fields(found: &Json, name: &str, msg: &Value) {
    let Value::Object(members) = msg else {
        return assert!(same(found, msg));
    };
    let one = types::find(name).expect("a known type");
    let fields = one.fields.iter().map(|field| field.name);
    let expected: Vec<&str> = fields
        .filter(|field| members.contains_key(*field))
        .collect();
    let Json::Object(found) = found else {
        panic!("{found:?} of {msg}");
    };
    let keys: Vec<&str> = found.iter().filter_map(|(key, _)| key.as_deref()).collect();
    assert_eq!(keys, expected);
}

fn check_cdr(name: &str, msg: &Value, length: usize) {
    let frame = cbor::publish_raw(TOPIC, name, msg).expect("a known type");
    let found = read(&frame).expect("CBOR");
    let Some(Json::Array(bytes)) = found.get("msg").and_then(|msg| msg.get("bytes")) else {
        panic!("no bytes in {found:?}");
    };
    assert!(
        bytes.len() >= 4 && bytes.len() <= GROWTH * (length + 1),
        "{} bytes of {length}",
        bytes.len()
    );
    let header = ["0", "1", "0", "0"].map(|byte| Json::Number(byte.to_owned()));
    assert_eq!(bytes[..4], header);
}
