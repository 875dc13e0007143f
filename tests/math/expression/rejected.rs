//! Expressions that are rejected, and the reasons that their authors hear.
//!
//! **Invariant:** nothing here is accepted, and every message is checked, its column included.

use pendularm::math::expression::{Expression, ExpressionError};

use super::{assert_rejections, rejection};

#[test]
fn an_empty_function_is_rejected() {
    for text in ["", " ", " \t\r\n"] {
        assert_eq!(Expression::parse(text), Err(ExpressionError::Empty));
        assert_eq!(
            rejection(text),
            "expected an expression in t, found an empty text"
        );
    }
}

#[test]
fn a_parenthesis_that_is_never_closed_is_rejected() {
    assert_rejections(&[
        ("(t", "the ( at column 1 is never closed"),
        ("((t)", "the ( at column 1 is never closed"),
        ("(1+(2*t)", "the ( at column 1 is never closed"),
        ("1+(2*(t)", "the ( at column 3 is never closed"),
        ("sin(t", "the ( at column 4 is never closed"),
        ("sin((t)", "the ( at column 4 is never closed"),
        ("(t)+(t", "the ( at column 5 is never closed"),
    ]);
}

#[test]
fn a_parenthesis_that_closes_nothing_is_rejected() {
    assert_rejections(&[
        ("t)", "the ) at column 2 closes nothing"),
        ("(t))", "the ) at column 4 closes nothing"),
        ("sin(t))", "the ) at column 7 closes nothing"),
        ("(1+2))*3", "the ) at column 6 closes nothing"),
    ]);
}

#[test]
fn empty_parentheses_are_rejected() {
    let message = "expected a number, t, a function, - or ( at column";
    for (text, column) in [
        ("()", 2),
        (")", 1),
        (")(", 1),
        ("sin()", 5),
        ("2*()", 4),
        ("( )", 3),
    ] {
        assert_eq!(rejection(text), format!("{message} {column}, found ')'"));
    }
}

#[test]
fn an_unknown_identifier_is_rejected() {
    let names = "the variable is t, the functions are sin, cos, tan, exp, sqrt, ln and abs";
    for (text, name, column) in [
        ("x", "x", 1),
        ("t+x", "x", 3),
        ("foo(t)", "foo", 1),
        ("2*log(t)", "log", 3),
        ("tt", "tt", 1),
        ("t2", "t2", 1),
        ("_t", "_t", 1),
        ("sint", "sint", 1),
        ("sin2(t)", "sin2", 1),
    ] {
        assert_eq!(
            rejection(text),
            format!("unknown name '{name}' at column {column}: {names}")
        );
    }
}

#[test]
fn names_are_case_sensitive() {
    for text in ["T", "SIN(t)", "Sin(t)", "LN(t)"] {
        assert!(rejection(text).starts_with("unknown name"), "{text}");
    }
}

#[test]
fn there_are_no_named_constants() {
    for text in [
        "pi", "PI", "e", "tau", "inf", "Infinity", "nan", "NaN", "2*pi",
    ] {
        assert!(rejection(text).starts_with("unknown name"), "{text}");
    }
}

#[test]
fn trailing_garbage_is_rejected() {
    assert_rejections(&[
        ("t t", "expected an operator at column 3, found 't'"),
        ("t+1 foo", "expected an operator at column 5, found 'foo'"),
        (
            "sin(t)cos(t)",
            "expected an operator at column 7, found 'cos'",
        ),
        ("t $", "unrecognized character '$' at column 3"),
        ("t;", "unrecognized character ';' at column 2"),
        ("t = 1", "unrecognized character '=' at column 3"),
    ]);
}

#[test]
fn adjacent_tokens_without_an_operator_are_rejected() {
    assert_rejections(&[
        ("1 2", "expected an operator at column 3, found '2'"),
        ("t 2", "expected an operator at column 3, found '2'"),
        ("1.2.3", "expected an operator at column 4, found '.3'"),
        ("1..2", "expected an operator at column 3, found '.2'"),
        ("(1 2)", "expected an operator at column 4, found '2'"),
    ]);
}

#[test]
fn implied_multiplication_is_rejected() {
    assert_rejections(&[
        ("2t", "expected an operator at column 2, found 't'"),
        ("2 t", "expected an operator at column 3, found 't'"),
        ("2(3)", "expected an operator at column 2, found '('"),
        ("t(2)", "expected an operator at column 2, found '('"),
        ("(1)(2)", "expected an operator at column 4, found '('"),
        ("(t)2", "expected an operator at column 4, found '2'"),
        ("2sin(t)", "expected an operator at column 2, found 'sin'"),
        // Not the beginning of an exponent, but a function.
        ("2exp(t)", "expected an operator at column 2, found 'exp'"),
        ("0x10", "expected an operator at column 2, found 'x10'"),
        ("1_000", "expected an operator at column 2, found '_000'"),
        ("1e_3", "expected an operator at column 2, found 'e_3'"),
    ]);
}

#[test]
fn an_unrecognized_character_is_rejected() {
    for (text, found, column) in [
        ("$", "$", 1),
        ("t @ 2", "@", 3),
        ("t % 2", "%", 3),
        ("2,5", ",", 2),
        ("[t]", "[", 1),
        ("t!", "!", 2),
        ("\u{2212}t", "\u{2212}", 1),
        ("2\u{d7}t", "\u{d7}", 2),
        ("sin(é)", "é", 5),
        ("t\0", "\\0", 2),
        ("t\u{b}", "\\u{b}", 2),
        ("t\u{a0}+ 1", "\\u{a0}", 2),
        ("t'", "\\'", 2),
    ] {
        let message = format!("unrecognized character '{found}' at column {column}");
        assert_eq!(rejection(text), message);
    }
}

#[test]
fn an_operator_without_its_right_operand_is_rejected() {
    let message = "expected a number, t, a function, - or ( at column";
    for (text, column, found) in [
        ("1+", 3, "the end"),
        ("1 +  ", 4, "the end"),
        ("-", 2, "the end"),
        ("(", 2, "the end"),
        ("sin(", 5, "the end"),
        ("1+*2", 3, "'*'"),
        ("(1+)", 4, "')'"),
        ("2**3", 3, "'*'"),
        ("2^", 3, "the end"),
        ("2//3", 3, "'/'"),
    ] {
        assert_eq!(
            rejection(text),
            format!("{message} {column}, found {found}"),
            "{text}"
        );
    }
}

#[test]
fn an_operator_without_its_left_operand_is_rejected() {
    let message = "expected a number, t, a function, - or ( at column";
    for (text, column, found) in [
        ("*2", 1, '*'),
        ("/t", 1, '/'),
        ("^2", 1, '^'),
        ("(*2)", 2, '*'),
    ] {
        assert_eq!(
            rejection(text),
            format!("{message} {column}, found '{found}'"),
            "{text}"
        );
    }
}

#[test]
fn unary_plus_is_rejected() {
    let message = "expected a number, t, a function, - or ( at column";
    for (text, column) in [("+t", 1), ("1++1", 3), ("2*+3", 3), ("-+t", 2), ("(+t)", 2)] {
        assert_eq!(
            rejection(text),
            format!("{message} {column}, found '+'"),
            "{text}"
        );
    }
}

#[test]
fn a_function_without_a_parenthesised_argument_is_rejected() {
    assert_rejections(&[
        ("sin", "expected ( after sin at column 4, found the end"),
        ("sin t", "expected ( after sin at column 5, found 't'"),
        ("sin 2", "expected ( after sin at column 5, found '2'"),
        ("cos-t", "expected ( after cos at column 4, found '-'"),
        (
            "1+sqrt  ",
            "expected ( after sqrt at column 7, found the end",
        ),
        ("sin^2(t)", "expected ( after sin at column 4, found '^'"),
        ("ln)", "expected ( after ln at column 3, found ')'"),
    ]);
}

#[test]
fn a_second_argument_is_rejected() {
    assert_rejections(&[("sin(t, 2)", "unrecognized character ',' at column 6")]);
}

#[test]
fn a_point_without_digits_is_rejected() {
    assert_rejections(&[
        (".", "expected a digit at column 2, after '.'"),
        ("t+.", "expected a digit at column 4, after '.'"),
        (".e3", "expected a digit at column 2, after '.'"),
        ("1+.t", "expected a digit at column 4, after '.'"),
    ]);
}

#[test]
fn an_exponent_without_digits_is_rejected() {
    assert_rejections(&[
        ("1e", "expected a digit at column 3, after '1e'"),
        ("1e+", "expected a digit at column 4, after '1e+'"),
        ("1e-t", "expected a digit at column 4, after '1e-'"),
        ("1e*2", "expected a digit at column 3, after '1e'"),
        ("1e 3", "expected a digit at column 3, after '1e'"),
        ("1e--3", "expected a digit at column 4, after '1e-'"),
        ("1e.5", "expected a digit at column 3, after '1e'"),
    ]);
}

#[test]
fn columns_count_characters_and_not_bytes() {
    // The reader stops at the first character that it does not know, so only that one can be wide.
    assert_rejections(&[
        ("t + ∂t", "unrecognized character '∂' at column 5"),
        ("😀", "unrecognized character '😀' at column 1"),
    ]);
}

#[test]
fn what_a_message_repeats_is_short() {
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
