//! The parser against routes that share no code with it: trees evaluated by recursion, and a reader written straight
//! from the grammar, one function for each level.
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

/// A recursive reader. It says nothing about what is wrong.
struct Reader<'a> {
    rest: &'a str,
}

impl<'a> Reader<'a> {
    fn read(text: &'a str) -> Option<Tree> {
        let mut reader = Self { rest: text };
        let tree = reader.sum()?;
        reader.peek().is_none().then_some(tree)
    }

    fn sum(&mut self) -> Option<Tree> {
        let mut left = self.product()?;
        while let Some(operator @ ('+' | '-')) = self.peek() {
            self.take(1);
            left = Tree::Binary(operator, Box::new(left), Box::new(self.product()?));
        }
        Some(left)
    }

    fn product(&mut self) -> Option<Tree> {
        let mut left = self.power()?;
        while let Some(operator @ ('*' | '/')) = self.peek() {
            self.take(1);
            left = Tree::Binary(operator, Box::new(left), Box::new(self.power()?));
        }
        Some(left)
    }

    fn power(&mut self) -> Option<Tree> {
        let base = self.negation()?;
        if self.peek() != Some('^') {
            return Some(base);
        }
        self.take(1);
        Some(Tree::Binary('^', Box::new(base), Box::new(self.power()?)))
    }

    fn negation(&mut self) -> Option<Tree> {
        if self.peek() != Some('-') {
            return self.atom();
        }
        self.take(1);
        Some(Tree::Negate(Box::new(self.negation()?)))
    }

    fn atom(&mut self) -> Option<Tree> {
        match self.peek()? {
            '(' => self.parenthesised(),
            '0'..='9' | '.' => {
                // The longest beginning that the standard library takes for a number.
                let length = (1..=self.rest.len()).rev().find(|&length| {
                    let number = self.rest.get(..length);
                    number.is_some_and(|number| number.parse::<f64>().is_ok())
                })?;
                self.take(length).parse().ok().map(Tree::Number)
            }
            _ => {
                let end = self
                    .rest
                    .find(|c: char| !c.is_ascii_alphanumeric() && c != '_');
                let name = self.take(end.unwrap_or(self.rest.len()));
                if name == "t" {
                    return Some(Tree::T);
                }
                let name = FUNCTIONS.into_iter().find(|function| *function == name)?;
                Some(Tree::Call(name, Box::new(self.parenthesised()?)))
            }
        }
    }

    fn parenthesised(&mut self) -> Option<Tree> {
        if self.peek() != Some('(') {
            return None;
        }
        self.take(1);
        let tree = self.sum()?;
        if self.peek() != Some(')') {
            return None;
        }
        self.take(1);
        Some(tree)
    }

    fn peek(&mut self) -> Option<char> {
        self.rest = self.rest.trim_ascii_start();
        self.rest.chars().next()
    }

    fn take(&mut self, length: usize) -> &'a str {
        let (taken, rest) = self.rest.split_at(length);
        self.rest = rest;
        taken
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

/// Tokens in any order: few are expressions, most are nearly one.
fn any_tokens() -> impl Strategy<Value = String> {
    let tokens = vec![
        "t", "t", "t", "1", "2.5", ".5", "5.", "1e3", "1e", ".", "+", "-", "-", "*", "/", "^", "(",
        "(", ")", ")", "sin(", "abs", "ln(", " ", "\n", "x", "_", "E",
    ];
    prop::collection::vec(prop::sample::select(tokens), 0..12).prop_map(|tokens| tokens.concat())
}

/// Values and operators by turns, with signs and parentheses thrown in: unlike loose tokens, often an expression.
fn any_alternation() -> impl Strategy<Value = String> {
    let before = prop::sample::select(vec!["", "", "", "-", "--", "(", "-(", "sin(", "abs(-("]);
    let value = prop::sample::select(vec!["t", "2", "3", "0.5", "1e-1"]);
    let after = prop::sample::select(vec!["", "", "", "", ")", "))"]);
    let operator = prop::sample::select(vec!["+", "-", "*", "/", "^", "^"]);
    prop::collection::vec((before, value, after, operator), 1..8).prop_map(|parts| {
        let mut text = String::new();
        for (index, (before, value, after, operator)) in parts.into_iter().enumerate() {
            if index > 0 {
                text.push_str(operator);
            }
            text.extend([before, value, after]);
        }
        let open = text.matches('(').count();
        let close = text.matches(')').count();
        // Unclosed parentheses would outnumber everything else.
        text.push_str(&")".repeat(open.saturating_sub(close)));
        text
    })
}

/// Accepts what the recursive reader accepts, with the same value; rejects the rest with a printable message.
fn compare(text: &str) -> Result<(), TestCaseError> {
    match (Expression::parse(text), Reader::read(text)) {
        (Ok(expression), Some(tree)) => {
            prop_assert_eq!(expression.nodes(), tree.nodes());
            for t in [0.0, 0.7, -1.3, 2e9] {
                let (a, b) = (expression.evaluate(t), tree.value(t));
                prop_assert!(same(a, b), "{} at {}: {} and {}", text, t, a, b);
            }
        }
        (Err(error), None) => {
            let message = error.to_string();
            prop_assert!(message.chars().count() <= 400, "{}", message);
            prop_assert!(!message.contains(char::is_control), "{:?}", message);
        }
        (parsed, tree) => prop_assert!(false, "{:?}: {:?}, but {:?}", text, parsed, tree),
    }
    Ok(())
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
        // The other reader agrees on what the printed text means.
        prop_assert_eq!(Reader::read(&printed), Some(tree), "{}", printed);
    }

    #[test]
    fn any_tokens_are_read_as_the_grammar_says(text in any_tokens()) {
        compare(&text)?;
    }

    #[test]
    fn any_alternation_of_values_and_operators_is_read_as_the_grammar_says(
        text in any_alternation(),
    ) {
        compare(&text)?;
    }

    #[test]
    fn any_text_is_read_as_the_grammar_says(
        characters in prop::collection::vec(any::<char>(), 0..40),
    ) {
        compare(&characters.into_iter().collect::<String>())?;
    }

    #[test]
    fn any_printable_ascii_is_read_as_the_grammar_says(text in "[ -~]{0,24}") {
        compare(&text)?;
    }
}
