//! A message as a tree, for other encodings: the same values as `serde_json`'s own, in a few bytes for each byte of
//! text.
//!
//! **Invariant:** the second reader shares no code with the first one, and defines the meaning of repeated names.

use pendularm::protocol::limits::MAX_FRAME;
use pendularm::protocol::ros::tree::{MessageTree, TreeText, VALUE_BYTES};
use proptest::prelude::*;
use proptest::sample::select;
use serde_json::{Value, json};

use crate::json::{any_text, json_of};

/// Converts a value of this crate to one of `serde_json`.
fn value(tree: &MessageTree<'_>) -> Value {
    match tree {
        MessageTree::Null => Value::Null,
        MessageTree::Bool(value) => (*value).into(),
        MessageTree::Number(number) => number.clone().into(),
        MessageTree::Text(text) => text.to_string().into(),
        MessageTree::Array(entries) => entries.iter().map(value).collect(),
        MessageTree::Object(members) => {
            assert!(members.is_sorted_by(|one, next| one.0 < next.0));
            for (TreeText(name), found) in members {
                assert_eq!(tree.get(name), Some(found), "{name} is found too");
            }
            let members = members.iter();
            let members = members.map(|(TreeText(name), one)| (name.to_string(), value(one)));
            Value::Object(members.collect())
        }
    }
}

/// The memory of a value, with what the allocator adds: 8 bytes for each piece, which is a multiple of 16 bytes.
fn allocated(tree: &MessageTree<'_>) -> usize {
    let piece = |values: usize| (8 + VALUE_BYTES * values).next_multiple_of(16);
    match tree {
        MessageTree::Array(entries) if !entries.is_empty() => {
            piece(entries.len()) + entries.iter().map(allocated).sum::<usize>()
        }
        MessageTree::Object(members) if !members.is_empty() => {
            let contents = members.iter().map(|(_, value)| allocated(value));
            piece(2 * members.len()) + contents.sum::<usize>()
        }
        _ => 0,
    }
}

/// Names that are repeated in most objects of a few members, and fields of the runtime's types.
fn name() -> impl Strategy<Value = String> + Clone {
    let known = [
        "",
        "a",
        "\\u0061",
        "b",
        "header",
        "stamp",
        "sec",
        "nanosec",
        "name",
        "position",
        "transforms",
    ];
    prop_oneof![
        11 => select(known.to_vec()).prop_map(|name| format!("\"{name}\"")),
        1 => any_text(),
    ]
}

/// JSON texts, with spaces and with any numbers that a client may send.
fn text() -> impl Strategy<Value = String> {
    let leaf = prop_oneof![
        Just("null".to_owned()),
        any::<bool>().prop_map(|value| value.to_string()),
        any::<i64>().prop_map(|number| number.to_string()),
        any::<u64>().prop_map(|number| number.to_string()),
        any::<u8>().prop_map(|number| number.to_string()),
        any::<f64>().prop_map(|number| json!(number).to_string()),
        (any::<i32>(), -400..400_i32).prop_map(|(digits, power)| format!("{digits}E{power}")),
        Just("-0".to_owned()),
        name(),
    ];
    json_of(leaf, name())
}

proptest! {
    #[test]
    fn both_readers_give_the_same_tree(text in text()) {
        let expected: Result<Value, _> = serde_json::from_str(&text);
        let read = MessageTree::read(text.as_bytes());
        prop_assert_eq!(read.is_ok(), expected.is_ok(), "{}", text);
        if let (Ok(tree), Ok(expected)) = (read, expected) {
            prop_assert_eq!(value(&tree), expected.clone(), "{}", text);
            prop_assert_eq!(&MessageTree::from(&expected), &tree, "{}", text);
        }
    }
}

/// Texts with the largest trees per byte, as long as a frame may be: 16 bytes for one.
#[test]
fn the_longest_message_takes_64_mib_at_worst() {
    let deep = |open: &str, close: &str| open.repeat(50) + &close.repeat(50) + ",";
    for unit in [
        "1,",
        "[],",
        "[1],",
        "{},",
        "\"\",",
        "{\"\":1},",
        &deep("[", "]"),
        &deep("{\"a\":[", "]}"),
    ] {
        let text = format!("[{}0]", unit.repeat((MAX_FRAME - 3) / unit.len()));
        let tree = MessageTree::read(text.as_bytes()).unwrap();
        let taken = allocated(&tree);
        assert!(taken <= 16 * (text.len() + 2), "{unit}: {taken}");
    }
    const { assert!(16 * MAX_FRAME <= 64 * 1024 * 1024) };
}

#[test]
fn a_value_is_found_at_the_end_of_its_way() {
    let tree = MessageTree::read(br#"{"a":[{"0":{"b":7}}],"":8}"#).unwrap();
    let at = |way: &str| tree.pointer(way).map(value);
    assert_eq!(at("/a/0/0/b"), Some(json!(7)));
    assert_eq!(at("/"), Some(json!(8)));
    assert_eq!(at("/a/1"), None);
    assert_eq!(at("/a/0/0/b/c"), None);
}

/// As deep as a frame may be nested. No drop, copy or write recurses deeper.
#[test]
fn a_tree_is_as_deep_as_a_message_may_be() {
    let nested = |levels: usize| "[".repeat(levels) + &"]".repeat(levels);
    assert!(MessageTree::read(nested(127).as_bytes()).is_ok());
    assert!(MessageTree::read(nested(128).as_bytes()).is_err());
    for bad in ["", "1 2", "[1", "{\"a\"}", "1e999", "\"\\ud800\"", "nul"] {
        assert!(MessageTree::read(bad.as_bytes()).is_err(), "{bad}");
    }
}
