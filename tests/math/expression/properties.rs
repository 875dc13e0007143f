//! The parser against trees that are evaluated by recursion, which share no code with it.
//!
//! **Invariant:** values are compared bit by bit, except that any NaN equals any other.

use pendularm::math::expression::Expression;
use proptest::prelude::*;

/// An expression as a tree.
#[derive(Debug, Clone, PartialEq)]
enum Tree {
    Number(f64),
    T,
    Negate(Box<Tree>),
    Binary(char, Box<Tree>, Box<Tree>),
    Call(&'static str, Box<Tree>),
}

const FUNCTIONS: [&str; 7] = ["sin", "cos", "tan", "exp", "sqrt", "ln", "abs"];

impl Tree {
    fn value(&self, t: f64) -> f64 {
        match self {
            Self::Number(value) => *value,
            Self::T => t,
            Self::Negate(a) => -a.value(t),
            Self::Binary(operator, a, b) => {
                let (a, b) = (a.value(t), b.value(t));
                match operator {
                    '+' => a + b,
                    '-' => a - b,
                    '*' => a * b,
                    '/' => a / b,
                    _ => a.powf(b),
                }
            }
            Self::Call(name, a) => {
                let a = a.value(t);
                match *name {
                    "sin" => a.sin(),
                    "cos" => a.cos(),
                    "tan" => a.tan(),
                    "exp" => a.exp(),
                    "sqrt" => a.sqrt(),
                    "ln" => a.ln(),
                    _ => a.abs(),
                }
            }
        }
    }

    fn nodes(&self) -> usize {
        match self {
            Self::Number(_) | Self::T => 1,
            Self::Negate(a) | Self::Call(_, a) => 1 + a.nodes(),
            Self::Binary(_, a, b) => 1 + a.nodes() + b.nodes(),
        }
    }

    /// The text with a parenthesis around everything, which needs no precedence to be read.
    fn text(&self) -> String {
        match self {
            Self::Number(value) if value.is_infinite() => "1e999".to_owned(),
            Self::Number(value) => format!("{value:?}"),
            Self::T => "t".to_owned(),
            Self::Negate(a) => format!("-({})", a.text()),
            Self::Binary(operator, a, b) => format!("({}){operator}({})", a.text(), b.text()),
            Self::Call(name, a) => format!("{name}({})", a.text()),
        }
    }
}

fn same(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan())
}

/// Any literal: a float without sign, infinity included.
fn any_literal() -> impl Strategy<Value = f64> {
    prop_oneof![
        3 => (0_u32..1000).prop_map(f64::from),
        3 => 0.0..10.0_f64,
        1 => any::<f64>().prop_filter("no literal is NaN", |x| !x.is_nan()).prop_map(f64::abs),
        1 => Just(f64::INFINITY),
    ]
}

fn any_tree() -> impl Strategy<Value = Tree> {
    let leaf = prop_oneof![Just(Tree::T), any_literal().prop_map(Tree::Number)];
    leaf.prop_recursive(8, 128, 2, |inner| {
        let boxed = inner.prop_map(Box::new).boxed();
        let operator = prop::sample::select(vec!['+', '-', '*', '/', '^']);
        prop_oneof![
            1 => boxed.clone().prop_map(Tree::Negate),
            3 => (operator, boxed.clone(), boxed.clone())
                .prop_map(|(operator, a, b)| Tree::Binary(operator, a, b)),
            1 => (prop::sample::select(FUNCTIONS.to_vec()), boxed)
                .prop_map(|(name, a)| Tree::Call(name, a)),
        ]
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn a_tree_written_with_every_parenthesis_has_the_value_of_the_tree(
        tree in any_tree(),
        t in -10.0..10.0_f64,
    ) {
        let expression = Expression::parse(&tree.text()).unwrap();
        prop_assert_eq!(expression.nodes(), tree.nodes());
        let (a, b) = (expression.evaluate(t), tree.value(t));
        prop_assert!(same(a, b), "{}: {} and {}", tree.text(), a, b);
    }

    #[test]
    fn a_printed_expression_parses_to_itself(tree in any_tree()) {
        let expression = Expression::parse(&tree.text()).unwrap();
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
