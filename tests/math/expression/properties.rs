//! Any expression is printed and read again, and any text is read or rejected.

use pendularm::math::expression::Expression;
use proptest::prelude::*;

/// Any literal: a float without sign, infinity included.
fn any_literal() -> impl Strategy<Value = String> {
    prop_oneof![
        3 => (0_u32..1000).prop_map(|number| number.to_string()),
        3 => (0.0..10.0_f64).prop_map(|number| number.to_string()),
        1 => any::<f64>().prop_map(|number| format!("{:?}", number.abs()))
            .prop_filter("a literal", |text| text.starts_with(|one: char| one.is_ascii_digit())),
        1 => Just("1e999".to_owned()),
    ]
}

/// With a parenthesis around everything, which needs no precedence to be read.
fn any_expression() -> impl Strategy<Value = String> {
    let leaf = prop_oneof![Just("t".to_owned()), any_literal()];
    leaf.prop_recursive(8, 128, 2, |inner| {
        let inner = inner.boxed();
        let pair = (inner.clone(), "[-+*/^]", inner.clone());
        let function = "sin|cos|tan|exp|sqrt|ln|abs";
        prop_oneof![
            1 => inner.clone().prop_map(|a| format!("-({a})")),
            3 => pair.prop_map(|(a, operator, b)| format!("({a}){operator}({b})")),
            1 => (function, inner).prop_map(|(name, a)| format!("{name}({a})")),
        ]
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn a_printed_expression_parses_to_itself(text in any_expression()) {
        let expression = Expression::parse(&text).unwrap();
        let printed = expression.to_string();
        prop_assert_eq!(&Expression::parse(&printed).unwrap(), &expression, "{}", printed);
    }

    #[test]
    fn any_text_is_read_or_rejected_with_a_printable_message(text in "[ -~]{0,24}|.{0,40}") {
        match Expression::parse(&text) {
            Ok(expression) => {
                let again = Expression::parse(&expression.to_string());
                prop_assert_eq!(again, Ok(expression), "{}", text);
            }
            Err(error) => {
                let message = error.to_string();
                prop_assert!(message.chars().count() <= 400, "{}", message);
                prop_assert!(!message.contains(char::is_control), "{:?}", message);
            }
        }
    }
}
