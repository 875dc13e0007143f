//! Texts of a megabyte.
//!
//! **Invariant:** a test's thread has a stack of 2 MiB, so that anything that recursed on these would abort the run.

use super::{parse, rejection, value};

const MEGABYTE: usize = 1_000_000;

/// A megabyte of `open`, then `t`, then as many `close`.
fn nested(open: &str, close: &str) -> String {
    let times = MEGABYTE / (open.len() + close.len());
    format!("{}t{}", open.repeat(times), close.repeat(times))
}

#[test]
fn a_megabyte_of_any_shape_is_parsed_evaluated_printed_and_dropped() {
    for (open, close, expected) in [
        ("(", ")", 1.0),
        // An even number of signs.
        ("-", "", 1.0),
        // 500,000 ones and t; 1 less 499,999 ones less t.
        ("1+", "", 500_001.0),
        ("1-", "", -499_999.0),
        ("1*", "", 1.0),
        ("1/", "", 1.0),
        ("1^", "", 1.0),
        ("t^", "", 1.0),
        // 333,333 signs: odd.
        ("t*-", "", -1.0),
        ("abs(", ")", 1.0),
        ("sqrt(", ")", 1.0),
        ("-abs(-", ")", -1.0),
        ("1+(", ")", 250_001.0),
        ("(1+", ")", 250_001.0),
        ("(", "+1)", 250_001.0),
        (" ", "", 1.0),
    ] {
        let text = nested(open, close);
        let expression = parse(&text);
        let result = expression.evaluate(1.0);
        assert_eq!(result, expected, "{open}");
        assert!(expression == parse(&expression.to_string()), "{open}");
    }
}

#[test]
fn a_megabyte_of_digits_is_one_literal() {
    assert_eq!(value(&format!("0.{}", "3".repeat(MEGABYTE))), 1.0 / 3.0);
    assert_eq!(value(&"9".repeat(MEGABYTE)), f64::INFINITY);
}

#[test]
fn a_megabyte_of_nonsense_is_rejected() {
    for (text, message) in [
        ("(".repeat(MEGABYTE), "at column 1000001, found the end"),
        (
            format!("{}t", "(".repeat(MEGABYTE)),
            "the ( at column 1000000 is never closed",
        ),
        (
            format!("t{}", ")".repeat(MEGABYTE)),
            "the ) at column 2 closes nothing",
        ),
        (
            format!("{}$", "t+".repeat(MEGABYTE / 2)),
            "unrecognized character '$' at column 1000001",
        ),
        (" ".repeat(MEGABYTE), "found an empty text"),
    ] {
        let found = rejection(&text);
        assert!(found.ends_with(message), "{found}");
    }
}
