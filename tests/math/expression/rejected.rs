//! Rejected expressions, and their reasons.
//!
//! **Invariant:** nothing here is accepted, and every message is checked, its column included.

use super::rejection;

/// `{NAMES}` and `{OPERAND}` in a message are replaced by these texts.
const NAMES: &str = ": the variable is t, the functions are sin, cos, tan, exp, sqrt, ln and abs";
const OPERAND: &str = "expected a number, t, a function, - or (";

/// A text and its message.
const REJECTED: &[(&str, &str)] = &[
    // Nothing.
    ("", "expected an expression in t, found an empty text"),
    (
        " \t\r\n",
        "expected an expression in t, found an empty text",
    ),
    // A parenthesis that is never closed.
    ("(t", "the ( at column 1 is never closed"),
    ("1+(2*(t)", "the ( at column 3 is never closed"),
    ("sin(t", "the ( at column 4 is never closed"),
    // A parenthesis that closes nothing.
    ("t)", "the ) at column 2 closes nothing"),
    ("(1+2))*3", "the ) at column 6 closes nothing"),
    // Empty parentheses.
    ("()", "{OPERAND} at column 2, found ')'"),
    (")", "{OPERAND} at column 1, found ')'"),
    ("sin()", "{OPERAND} at column 5, found ')'"),
    // An unknown identifier.
    ("x", "unknown name 'x' at column 1{NAMES}"),
    ("foo(t)", "unknown name 'foo' at column 1{NAMES}"),
    ("2*log(t)", "unknown name 'log' at column 3{NAMES}"),
    ("_t", "unknown name '_t' at column 1{NAMES}"),
    ("sint", "unknown name 'sint' at column 1{NAMES}"),
    // Names are case sensitive.
    ("T", "unknown name 'T' at column 1{NAMES}"),
    ("SIN(t)", "unknown name 'SIN' at column 1{NAMES}"),
    ("Sin(t)", "unknown name 'Sin' at column 1{NAMES}"),
    // There are no named constants.
    ("pi", "unknown name 'pi' at column 1{NAMES}"),
    ("e", "unknown name 'e' at column 1{NAMES}"),
    ("inf", "unknown name 'inf' at column 1{NAMES}"),
    ("nan", "unknown name 'nan' at column 1{NAMES}"),
    // Trailing garbage.
    ("t t", "expected an operator at column 3, found 't'"),
    ("t+1 foo", "expected an operator at column 5, found 'foo'"),
    (
        "sin(t)cos(t)",
        "expected an operator at column 7, found 'cos'",
    ),
    ("t $", "unrecognized character '$' at column 3"),
    // Adjacent tokens without an operator.
    ("1 2", "expected an operator at column 3, found '2'"),
    ("t 2", "expected an operator at column 3, found '2'"),
    ("1.2.3", "expected an operator at column 4, found '.3'"),
    // Implied multiplication.
    ("2t", "expected an operator at column 2, found 't'"),
    ("2(3)", "expected an operator at column 2, found '('"),
    ("(1)(2)", "expected an operator at column 4, found '('"),
    ("2sin(t)", "expected an operator at column 2, found 'sin'"),
    ("0x10", "expected an operator at column 2, found 'x10'"),
    ("1e_3", "expected an operator at column 2, found 'e_3'"),
    // An unrecognized character.
    ("$", "unrecognized character '$' at column 1"),
    ("t @ 2", "unrecognized character '@' at column 3"),
    ("2,5", "unrecognized character ',' at column 2"),
    ("\u{2212}t", "unrecognized character '\u{2212}' at column 1"),
    ("sin(é)", "unrecognized character 'é' at column 5"),
    ("t\0", "unrecognized character '\\0' at column 2"),
    ("t\u{b}", "unrecognized character '\\u{b}' at column 2"),
    ("t\u{a0}+ 1", "unrecognized character '\\u{a0}' at column 2"),
    ("t'", "unrecognized character '\\'' at column 2"),
    // An operator without its right operand.
    ("1+", "{OPERAND} at column 3, found the end"),
    ("1 +  ", "{OPERAND} at column 4, found the end"),
    ("(", "{OPERAND} at column 2, found the end"),
    ("sin(", "{OPERAND} at column 5, found the end"),
    ("2**3", "{OPERAND} at column 3, found '*'"),
    ("2^", "{OPERAND} at column 3, found the end"),
    // An operator without its left operand.
    ("*2", "{OPERAND} at column 1, found '*'"),
    ("(*2)", "{OPERAND} at column 2, found '*'"),
    // Unary plus.
    ("+t", "{OPERAND} at column 1, found '+'"),
    ("2*+3", "{OPERAND} at column 3, found '+'"),
    ("(+t)", "{OPERAND} at column 2, found '+'"),
    // A function without a parenthesised argument.
    ("sin", "expected ( after sin at column 4, found the end"),
    ("sin t", "expected ( after sin at column 5, found 't'"),
    (
        "1+sqrt  ",
        "expected ( after sqrt at column 7, found the end",
    ),
    ("sin^2(t)", "expected ( after sin at column 4, found '^'"),
    ("ln)", "expected ( after ln at column 3, found ')'"),
    // A second argument.
    ("sin(t, 2)", "unrecognized character ',' at column 6"),
    // A point without digits.
    (".", "expected a digit at column 2, after '.'"),
    (".e3", "expected a digit at column 2, after '.'"),
    ("1+.t", "expected a digit at column 4, after '.'"),
    // An exponent without digits.
    ("1e", "expected a digit at column 3, after '1e'"),
    ("1e+", "expected a digit at column 4, after '1e+'"),
    ("1e-t", "expected a digit at column 4, after '1e-'"),
    ("1e 3", "expected a digit at column 3, after '1e'"),
    ("1e.5", "expected a digit at column 3, after '1e'"),
    // Columns count characters and not bytes.
    ("t + ∂t", "unrecognized character '∂' at column 5"),
    ("😀", "unrecognized character '😀' at column 1"),
];

#[test]
fn every_text_of_the_table_is_rejected_with_its_message() {
    for (text, message) in REJECTED {
        let expected = message
            .replace("{NAMES}", NAMES)
            .replace("{OPERAND}", OPERAND);
        assert_eq!(rejection(text), expected, "{text:?}");
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
