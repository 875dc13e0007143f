//! Input of numbers is lenient, output of numbers is strict.
//!
//! **Invariant:** everything except numbers that are not finite passes unchanged.

use std::borrow::Cow;
use std::time::{Duration, Instant};

use pendularm::protocol::wire::json::{accept_literals, integer, number, strict, text};
use proptest::prelude::*;
use serde_json::value::RawValue;

fn accepted(text: &str) -> String {
    accept_literals(text.to_owned())
}

fn raw(text: &str) -> Box<RawValue> {
    RawValue::from_string(text.to_owned()).expect("valid JSON")
}

/// A row: a function, a text, and what it returns; `=` is the same text, which is not copied.
const ROWS: &str = include_str!("json.txt");

#[test]
fn every_text_is_read_and_written_as_in_its_row() {
    for row in ROWS.lines().filter(|row| row.contains(" | ")) {
        let [function, text, expected] = row.split(" | ").collect::<Vec<_>>()[..] else {
            panic!("{row}");
        };
        let found = match function {
            "accepted" => accepted(text),
            "strict" => match strict(text) {
                Cow::Borrowed(_) => "=".to_owned(),
                Cow::Owned(text) => text,
            },
            "integer" => format!("{:?}", integer(&raw(text))),
            _ => format!("{:?}", self::text(&raw(text))),
        };
        let is_same = expected == "=" && found == text;
        assert!(is_same || found == expected, "{row}: {found}");
    }
}

/// Halfway between the largest number and the next power of two, to the last digit, in several spellings.
#[test]
fn the_last_digit_decides_whether_a_literal_overflows() {
    let halfway = "179769313486231580793728971405303415079934132710037826936173778980444968292764750946649017977587207096330286416692887910946555547851940402630657488671505820681908902000708383676273854845817711531764475730270069855571366959622842914819860834936475292719074168444365510704342711559699508093042880177904174497792";
    let (start, last) = halfway.split_at(308);
    let below = format!("{start}{}", last.parse::<u8>().unwrap() - 1);
    let spelled = |digits: &str| {
        [
            digits.to_owned(),
            format!("-{digits}.000"),
            format!("{digits}0000e-4"),
            format!("0.000{digits}E+312"),
            format!("{}.{}e308", &digits[..1], &digits[1..]),
            format!("{digits}e-00000000000000000000000"),
        ]
    };
    for (least, greatest) in spelled(halfway).iter().zip(&spelled(&below)) {
        assert_eq!(strict(least), "null", "{least}");
        assert_eq!(strict(greatest), *greatest);
    }
    let nearer = format!("{below}.{}", "9".repeat(1000));
    assert_eq!(strict(&nearer), nearer);
    assert_eq!(strict(&format!("{halfway}.{}1", "0".repeat(1000))), "null");
}

/// The fastest of several readings.
fn time_of(text: &str) -> Duration {
    let once = || {
        let began = Instant::now();
        assert_eq!(strict(text).len(), text.len());
        began.elapsed()
    };
    (0..7).map(|_| once()).min().unwrap()
}

/// Twenty digits near the middle between two doubles, which no conversion reads quickly. They are read as fast as
/// others, within a factor that a busy machine does not reach. A conversion of each would take a hundred times as long.
#[test]
fn a_number_costs_its_bytes_whatever_its_digits_are() {
    let array = |number: &str| format!("[{number}{}]", format!(",{number}").repeat(20_000));
    let usual = time_of(&array("10000000000000001268e-10"));
    let slow = time_of(&array("10000000000000001268e281"));
    assert!(slow < 8 * usual, "{slow:?} against {usual:?}");
}

#[test]
fn an_exponent_of_any_length_is_understood() {
    let (huge, digits) = ("9".repeat(100), "9".repeat(400));
    for text in [
        format!("{digits}e-399"),
        format!("0e{huge}"),
        format!("0.000E+{huge}"),
        format!("123.4e-{huge}"),
    ] {
        assert_eq!(strict(&text), text);
    }
    let infinite = format!("[1e{huge},-0.001e+{huge},{digits},-{digits}.5]");
    assert_eq!(strict(&infinite), "[null,null,null,null]");
    let small = format!("0.{}1e1000", "0".repeat(999));
    assert_eq!(strict(&small), small);
}

/// Linear work takes some tens of milliseconds even unoptimised; quadratic work on four million digits would take hours.
#[test]
fn four_megabytes_of_digits_take_no_time() {
    let started = Instant::now();
    let digits = "9".repeat(4_000_000);
    let tiny = format!("0.{}1", "0".repeat(4_000_000));
    assert!(strict(&digits) == "null");
    assert!(strict(&tiny) == tiny.as_str());
    assert_eq!(number(&raw(&digits)), Some(f64::INFINITY));
    assert_eq!(number(&raw(&tiny)), Some(0.0));
    assert_eq!(integer(&raw(&digits)), None);
    assert!(accepted(&digits) == digits);
    assert!(
        started.elapsed() < Duration::from_secs(10),
        "{:?}",
        started.elapsed()
    );
}

/// A JSON text of these leaves and names, with spaces here and there.
pub(crate) fn json_of(
    leaf: impl Strategy<Value = String> + 'static,
    name: impl Strategy<Value = String> + Clone + 'static,
) -> impl Strategy<Value = String> {
    leaf.prop_recursive(4, 48, 6, move |inner| {
        let space = || proptest::sample::select(vec!["", "", " ", "\t "]);
        let joined = |(entries, space): (Vec<String>, &str)| {
            space.to_owned() + &entries.join(&format!("{space},")) + space
        };
        let member = (name.clone(), space(), inner.clone())
            .prop_map(|(name, space, value)| format!("{name}{space}:{space}{value}"));
        let values = (proptest::collection::vec(inner, 0..6), space()).prop_map(joined);
        let members = (proptest::collection::vec(member, 0..6), space()).prop_map(joined);
        prop_oneof![
            values.prop_map(|values| format!("[{values}]")),
            members.prop_map(|members| format!("{{{members}}}")),
        ]
    })
}

/// Any text as JSON.
pub(crate) fn any_text() -> impl Strategy<Value = String> + Clone {
    any::<String>().prop_map(|text| serde_json::json!(text).to_string())
}

/// Any JSON value; some of its numbers overflow.
fn value() -> impl Strategy<Value = String> {
    let leaf = prop_oneof![
        any::<f64>().prop_map(|number| serde_json::json!(number).to_string()),
        any_text(),
        (any::<bool>(), 1_u32..400, any::<i16>()).prop_map(|(negative, digits, exponent)| {
            let sign = if negative { "-" } else { "" };
            format!("{sign}{}e{exponent}", "7".repeat(digits as usize))
        }),
        Just("null".to_owned()),
        Just("true".to_owned()),
    ];
    json_of(leaf, any_text())
}

proptest! {
    /// The text that a double prints as is read as that double.
    #[test]
    fn every_finite_number_is_read_exactly(value in any::<f64>().prop_filter("finite", |value| value.is_finite())) {
        let read = number(&raw(&serde_json::to_string(&value).unwrap()));
        prop_assert_eq!(read.map(f64::to_bits), Some(value.to_bits()));
    }

    /// `serde_json` refuses numbers that overflow, so that parsing shows that none is left.
    #[test]
    fn what_goes_out_always_parses(value in value()) {
        let out = strict(&value).into_owned();
        prop_assert!(serde_json::from_str::<serde_json::Value>(&out).is_ok(), "{}", out);
        prop_assert_eq!(strict(&out), out.as_str());
    }

    #[test]
    fn valid_json_comes_in_unchanged(value in value()) {
        prop_assert_eq!(accepted(&value), value);
    }

    #[test]
    fn no_text_makes_the_conversions_panic(text in r#"[NanInfity0-9eE"\\\[\]{},:.+ é-]{0,80}"#) {
        let _ = strict(&accepted(&text));
    }
}
