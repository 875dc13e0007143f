//! Messages as CBOR and as CDR: any JSON as a message of any type that the runtime knows, or of none.
//!
//! Asserted: the frame is CBOR that another reader takes, with the topic and all members of the JSON. Of a known type
//! it has every field of the type that was there, in its order. CDR is read to the last byte as the same message, with
//! a zero for a missing field. The reader of this check knows the type by the text of its definition alone.
//!
//! The runtime's own reading of the JSON takes no more memory than it has said before.
//!
//! Input: a byte that chooses the type, the message.

#![no_main]

use libfuzzer_sys::fuzz_target;
use pendularm::protocol::catalog::types;
use pendularm::protocol::ros::cbor;
use pendularm::protocol::ros::tree::MessageTree;
use pendularm_fuzz::cbor::read;
use pendularm_fuzz::cdr::{Definition, Field};
use pendularm_fuzz::json::Json;
use pendularm_fuzz::limits::{Allowance, READING, hold};
use serde_json::Value;

const TOPIC: &str = "/\u{e9}/\"a\"";
/// Bytes of CDR per byte of JSON, and besides: an entry of an array can be an empty object, which is a whole message.
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
    let tree = MessageTree::read(text);
    let Ok(msg) = serde_json::from_slice::<Value>(text) else {
        return assert!(tree.is_err(), "no JSON");
    };
    let tree = tree.expect("JSON");
    assert!(tree.allocated() <= MessageTree::room(text));
    let known: Vec<&str> = types::all().map(|one| one.name).collect();
    let name = known.get(usize::from(kind)).copied();
    let frame = cbor::publish(TOPIC, name, tree.root(), usize::MAX).expect("room");
    let longer = frame.len() - 1;
    assert_eq!(cbor::publish(TOPIC, name, tree.root(), longer), None);
    assert_ne!(frame.first(), Some(&b'{'));
    let found = read(&frame).expect("CBOR");
    assert_eq!(found.get("op").and_then(Json::text), Some("publish"));
    assert_eq!(found.get("topic").and_then(Json::text), Some(TOPIC));
    let found = found.get("msg").expect("a message");
    let Some(name) = name else {
        return assert!(same(found, &msg), "{found:?} of {msg}");
    };
    let definition = Definition::read(&types::full_text(name).expect("a definition"));
    assert!(
        is_message(found, &definition, definition.fields(), &msg),
        "{found:?} of {msg}"
    );
    check_cdr(name, &definition, &msg, &tree, text.len());
}

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

/// Whether all fields of the type that were there are there, in its order, and nothing else.
fn is_message(found: &Json, all: &Definition, fields: &[Field], msg: &Value) -> bool {
    let (Json::Object(found), Value::Object(members)) = (found, msg) else {
        return !msg.is_object() && same(found, msg);
    };
    let there: Vec<&Field> = fields
        .iter()
        .filter(|field| members.contains_key(&field.name))
        .collect();
    let fits = |(field, (key, value)): (&&Field, &(Option<String>, Json))| {
        key.as_ref() == Some(&field.name) && is_field(value, all, field, &members[&field.name])
    };
    there.len() == found.len() && there.iter().zip(found).all(fits)
}

fn is_field(found: &Json, all: &Definition, field: &Field, value: &Value) -> bool {
    let single = |found: &Json, value: &Value| match all.part(&field.kind) {
        Some(fields) => is_message(found, all, fields, value),
        None => same(found, value),
    };
    let (Json::Array(found), Value::Array(entries), true) = (found, value, field.is_many) else {
        return if field.is_many {
            same(found, value)
        } else {
            single(found, value)
        };
    };
    let entry = |(found, value): (&Json, &Value)| match field.kind.as_str() {
        // Arrays of these are packed: a value that is no such number is left out.
        "float64" => found.number() == value.as_f64(),
        "int32" => {
            let number = value.as_i64().and_then(|number| i32::try_from(number).ok());
            found.number() == Some(number.unwrap_or_default().into())
        }
        _ => single(found, value),
    };
    found.len() == entries.len() && found.iter().zip(entries).all(entry)
}

fn check_cdr(
    name: &str,
    definition: &Definition,
    msg: &Value,
    tree: &MessageTree<'_>,
    length: usize,
) {
    let frame = cbor::publish_raw(TOPIC, name, tree.root(), usize::MAX).expect("a known type");
    let found = read(&frame).expect("CBOR");
    let raw = found.get("msg").expect("a message");
    let Some(Json::Array(bytes)) = raw.get("bytes") else {
        panic!("no bytes in {found:?}");
    };
    assert!(
        bytes.len() <= GROWTH * (length + 1),
        "{} bytes of {length}",
        bytes.len()
    );
    let bytes: Option<Vec<u8>> = bytes
        .iter()
        .map(|byte| match byte {
            Json::Number(text) => text.parse().ok(),
            _ => None,
        })
        .collect();
    let decoded = definition.decode(&bytes.expect("bytes")).expect("CDR");
    is_decoded(&decoded, definition, definition.fields(), Some(msg));
    if let Some(stamp) = msg.pointer("/header/stamp") {
        for (part, name) in [("secs", "sec"), ("nsecs", "nanosec")] {
            let number = stamp.get(name).and_then(Value::as_u64).unwrap_or_default();
            assert_eq!(raw.get(part), Some(&Json::Number(number.to_string())));
        }
    }
}

/// Asserts that a message is decoded as it was, with zeros for what was absent or of another type.
fn is_decoded(found: &Json, all: &Definition, fields: &[Field], msg: Option<&Value>) {
    let Json::Object(members) = found else {
        panic!("{found:?} is no message");
    };
    for (field, (name, found)) in fields.iter().zip(members) {
        assert_eq!(name.as_ref(), Some(&field.name));
        let value = msg.and_then(|msg| msg.get(&field.name));
        if !field.is_many {
            is_single(found, all, &field.kind, value);
            continue;
        }
        let entries = value
            .and_then(Value::as_array)
            .map(Vec::as_slice)
            .unwrap_or_default();
        let Json::Array(found) = found else {
            panic!("{found:?} of {value:?}");
        };
        assert_eq!(found.len(), field.length.unwrap_or(entries.len()));
        for (at, found) in found.iter().enumerate() {
            is_single(found, all, &field.kind, entries.get(at));
        }
    }
}

fn is_single(found: &Json, all: &Definition, kind: &str, value: Option<&Value>) {
    if let Some(fields) = all.part(kind) {
        return is_decoded(found, all, fields, value);
    }
    let unsigned = |most: u64| value.and_then(Value::as_u64).unwrap_or_default().min(most);
    let signed = value.and_then(Value::as_i64).unwrap_or_default();
    let number = |text: String| Json::Number(text);
    let expected = match kind {
        "bool" => Json::Boolean(value == Some(&Value::Bool(true))),
        "string" => Json::Text(
            value
                .and_then(Value::as_str)
                .or(Some(""))
                .map(str::to_owned),
        ),
        "byte" | "char" | "uint8" => number(unsigned(255).to_string()),
        "uint16" => number(unsigned(u16::MAX.into()).to_string()),
        "uint32" => number(unsigned(u32::MAX.into()).to_string()),
        "uint64" => number(unsigned(u64::MAX).to_string()),
        "int8" => number(i8::try_from(signed).unwrap_or_default().to_string()),
        "int32" => number(i32::try_from(signed).unwrap_or_default().to_string()),
        "int64" => number(signed.to_string()),
        "float64" | "float32" => {
            let float = value.and_then(Value::as_f64).unwrap_or_default();
            let is_null = value == Some(&Value::Null);
            let overflows = kind == "float32" && (float as f32).is_infinite();
            let float = if kind == "float32" {
                (float as f32).into()
            } else {
                float
            };
            let expected = (!is_null && !overflows).then_some(float);
            return assert_eq!(found.number(), expected, "{kind} of {value:?}");
        }
        other => panic!("the definition has no {other}"),
    };
    assert_eq!(*found, expected, "{kind} of {value:?}");
}
