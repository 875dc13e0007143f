//! Expressions that are accepted: their values, and how expressions are printed.
//!
//! **Invariant:** nothing here is rejected.

use super::{T, parse, value};

#[test]
fn every_text_of_the_table_has_its_value() {
    let table = [
        // Every function and operator, at t = 1.75.
        ("sin(t)", T.sin()),
        ("cos(t)", T.cos()),
        ("tan(t)", T.tan()),
        ("exp(t)", T.exp()),
        ("sqrt(t)", T.sqrt()),
        ("ln(t)", T.ln()),
        ("abs(-t)", T),
        ("t^2 - 3*t/2 + 1", 1.4375),
        (
            "(t+1)*(3-t)/(t^(2-t)-2)",
            2.75 * 1.25 / (T.powf(0.25) - 2.0),
        ),
        // The left operand first, the higher operator first, but a power from the right, and a sign before it.
        ("10-4-3", 3.0),
        ("16/4/2", 2.0),
        ("2-6/2*3+1", -6.0),
        ("2^3^2", 512.0),
        ("2*3^2", 18.0),
        ("-3^2", 9.0),
        ("2^-1--2*-t", -3.0),
        ("8^(1/3)*0-1/0", f64::NEG_INFINITY),
        // Rounding tells the groupings apart: (0.1 + 0.2) + 0.3 is one ulp above 0.1 + (0.2 + 0.3).
        ("0.1+0.2+0.3", 0.600_000_000_000_000_1),
        // Literals may leave out either side of the point.
        ("0", 0.0),
        ("7", 7.0),
        ("007", 7.0),
        ("2.5", 2.5),
        (".5", 0.5),
        ("5.", 5.0),
        // Literals may have an exponent.
        ("1e3", 1000.0),
        ("2.5E-2", 0.025),
        ("1e+3", 1000.0),
        (".5e1", 5.0),
        ("5.e3", 5000.0),
        ("1e003", 1000.0),
        // The sign belongs to the exponent, the next one does not.
        ("1e-1-1", 0.1 - 1.0),
        // Literals are rounded to the nearest float.
        ("0.1", 0.1),
        ("9007199254740993", 9_007_199_254_740_992.0),
        ("2.2250738585072011e-308", 2.225_073_858_507_201e-308),
        ("5e-324", f64::from_bits(1)),
        ("1e-400", 0.0),
        // A literal too large for a float is infinity.
        ("1e999", f64::INFINITY),
        ("-1e999", f64::NEG_INFINITY),
        ("1e99999999999999999999999999", f64::INFINITY),
        ("0e99999999999999999999999999", 0.0),
        ("1e-99999999999999999999999999", 0.0),
    ];
    for (text, expected) in table {
        assert_eq!(value(text), expected, "{text}");
    }
    assert!(value("sqrt(0-t)").is_nan());
    assert_eq!(parse("-sin(t)*(2^t)").nodes(), 7);
}

#[test]
fn white_space_is_allowed_between_any_two_tokens() {
    let spaced = parse(" \t- t\r\n^ 2 +sin (\tt )* ( 3 ) ");
    assert_eq!(spaced, parse("-t^2+sin(t)*(3)"));
}

#[test]
fn printing_leaves_out_the_parentheses_that_change_nothing() {
    for (text, printed) in [
        ("(((t)))", "t"),
        ("(t^2)+((3*t))-1", "t^2 + 3*t - 1"),
        ("10-(4-3)", "10 - (4 - 3)"),
        ("(10-4)-3", "10 - 4 - 3"),
        ("24/(4/2)", "24/(4/2)"),
        ("(24/4)*2/(t)", "24/4*2/t"),
        ("24/(4*2)", "24/(4*2)"),
        ("(2^3)^2", "(2^3)^2"),
        ("2^(3^2)", "2^3^2"),
        ("(-2)^2", "-2^2"),
        ("-(2^2)", "-(2^2)"),
        ("2^(-3)", "2^-3"),
        ("-(-t)", "--t"),
        ("-(t+1)", "-(t + 1)"),
        ("(1+2)*(t-1)", "(1 + 2)*(t - 1)"),
        ("sin((t))", "sin(t)"),
        ("-(sin(t))", "-sin(t)"),
        (".50", "0.5"),
        ("5.", "5"),
        ("0.0", "0"),
        ("1e300", "1e300"),
        ("0.00000025", "2.5e-7"),
        ("1e9999", "1e999"),
    ] {
        assert_eq!(parse(text).to_string(), printed, "{text}");
    }
}
