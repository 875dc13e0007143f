//! YAML: written text is read as the same value, by `--json` on one line, and other text is refused.

use proptest::collection::{btree_map, vec};
use proptest::prelude::*;
use proptest::sample::select;
use serde_json::value::to_raw_value;
use serde_json::{Value, json};

use pendularm::command::values::{WORDS, json_line, read, write_yaml};
use serde_json::value::RawValue;

const NO_TEXTS: [&str; 8] = [
    "1e3",
    ".5",
    "0x1",
    "2014-12-31",
    "- a",
    "a: b",
    "a #",
    "---",
];

/// Whether a character acts on a terminal, as far as the tests make such characters.
fn acts(one: char) -> bool {
    one.is_control() || "\u{202e}\u{2028}\u{2029}".contains(one)
}

fn values() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        any::<i64>().prop_map(Value::from),
        any::<f64>()
            .prop_filter("JSON has no others", |one| one.is_finite())
            .prop_map(Value::from),
        "\\PC{0,12}|[ -~\\s\\x00-\\x1f\u{80}-\u{9f}]{0,12}".prop_map(Value::from),
        select([&WORDS[..], &NO_TEXTS].concat()).prop_map(Value::from),
    ];
    leaf.prop_recursive(4, 32, 4, |inner| {
        prop_oneof![
            vec(inner.clone(), 0..4).prop_map(Value::from),
            btree_map(".{0,8}", inner, 0..4)
                .prop_map(|members| Value::Object(members.into_iter().collect())),
        ]
    })
}

proptest! {
    #[test]
    fn a_value_written_as_yaml_is_read_as_the_same_value(value in values()) {
        let mut text = Vec::new();
        write_yaml(&to_raw_value(&value).unwrap(), "", &mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        prop_assert!(!text.contains(|one| one != '\n' && acts(one)), "{text:?}");
        // With a comment it is no JSON.
        prop_assert_eq!(read(&format!("# YAML\n{text}")).unwrap(), value, "{}", text);
    }
}

#[test]
fn numbers_are_such_as_python_reads_too() {
    for (json, expected) in [
        ("1.50", "1.50\n"),
        ("1e-7", "1.0e-7\n"),
        ("2.5e300", "2.5e+300\n"),
        ("1E+16", "1.0e+16\n"),
    ] {
        let mut text = Vec::new();
        let raw = RawValue::from_string(json.to_owned()).unwrap();
        write_yaml(&raw, "", &mut text).unwrap();
        assert_eq!(String::from_utf8(text).unwrap(), expected);
    }
}

#[test]
fn a_line_of_json_is_one_line_and_keeps_what_it_says() {
    let text = "{\"a\":\t\"\u{9b}31m\u{202e}\u{7f}\",\r\n\"b\": 1.50}";
    assert_eq!(
        json_line(text),
        "{\"a\": \"\\u009b31m\\u202e\\u007f\",  \"b\": 1.50}"
    );
}

#[test]
fn arguments_are_read_as_json_has_them_and_else_as_yaml_has() {
    for (text, value) in [
        ("", json!(null)),
        (
            "{x: 1, y: 0.5, on: off}",
            json!({"x": 1, "y": 0.5, "on": "off"}),
        ),
        (
            "{\"a\": \"\\ud83d\\ude00\", \"b\": 18446744073709551615}",
            json!({"a": "\u{1f600}", "b": u64::MAX}),
        ),
        (
            "a: [0x10, 1e3, ~]\nb: &x [16, .5]",
            json!({"a": [16, 1000.0, null], "b": [16, 0.5]}),
        ),
        ("1: one", json!({"1": "one"})),
    ] {
        assert_eq!(read(text).unwrap(), value, "{text}");
    }
    for text in [
        "{",
        "a: 1\n---\na: 2",
        "[.inf]",
        "{[1]: 2}",
        "*x",
        "!!float abc",
    ] {
        assert!(read(text).is_err(), "{text}");
    }
}
