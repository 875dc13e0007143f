//! Rejected expressions, and their reasons.
//!
//! **Invariant:** nothing here is accepted, and every message is checked, its column included.

use super::rejection;

/// A row: a text as a JSON string, and its message, in which `{NAMES}` and `{OPERAND}` stand for these texts.
const REJECTED: &str = include_str!("rejected.txt");
const NAMES: &str = ": the variable is t, the functions are sin, cos, tan, exp, sqrt, ln and abs";
const OPERAND: &str = "expected a number, t, a function, - or (";

#[test]
fn every_text_of_the_table_is_rejected_with_its_message() {
    for row in REJECTED.lines().filter(|row| !row.starts_with('#')) {
        let (text, message) = row.split_once(" => ").unwrap();
        let text: String = serde_json::from_str(text).unwrap();
        let expected = message
            .replace("{NAMES}", NAMES)
            .replace("{OPERAND}", OPERAND);
        assert_eq!(rejection(&text), expected, "{row}");
    }
}

#[test]
fn quoted_client_text_is_short() {
    let long = "a".repeat(1_000_000);
    let twenty = "a".repeat(20);
    assert!(rejection(&long).starts_with(&format!("unknown name '{twenty}...' at column 1")));
    let after = rejection(&format!("t {long}"));
    assert_eq!(
        after,
        format!("expected an operator at column 3, found '{twenty}...'")
    );
    let digits = rejection(&format!("{}e", "1".repeat(1_000_000)));
    assert_eq!(
        digits,
        format!(
            "expected a digit at column 1000002, after '{}...'",
            "1".repeat(20)
        )
    );
    assert!(rejection(&"a".repeat(20)).starts_with(&format!("unknown name '{twenty}' at")));
}
