//! Expressions against a second reading that makes a tree and walks it.
//!
//! Asserted: both readings accept the same texts; an accepted one has the same value to the bit at every time, and as
//! many nodes; printed and read again it is the very same expression, and prints alike.
//!
//! Input: the text itself; behind a `#`, one token of the grammar per byte.

#![no_main]

use libfuzzer_sys::fuzz_target;
use pendularm::math::expression::Expression;
use pendularm_fuzz::limits::{READING, hold};

/// Longer texts would only exhaust the stack of the second reading, which recurses.
const LONGEST: usize = 4096;

fuzz_target!(|input: &[u8]| hold(input.len(), READING, || examine(input)));

fn examine(input: &[u8]) {
    let text = match input {
        [b'#', tokens @ ..] => written(tokens),
        _ => String::from_utf8_lossy(input).into_owned(),
    };
    if text.len() > LONGEST {
        return;
    }
    let found = Expression::parse(&text);
    let expected = Reading::of(&text);
    let (expression, tree) = match (found, expected) {
        (Ok(expression), Some(tree)) => (expression, tree),
        (Err(error), None) => {
            assert!(error.to_string().len() < 256, "{error}");
            return;
        }
        (found, expected) => panic!("{text:?}: {found:?}, and the other reading: {expected:?}"),
    };
    assert_eq!(expression.nodes(), tree.nodes(), "{text:?}");

    let printed = expression.to_string();
    let again = Expression::parse(&printed).expect("what is printed can be read");
    assert_eq!(again, expression, "{text:?} printed as {printed:?}");
    assert_eq!(again.to_string(), printed);
    for time in times(input) {
        let value = expression.evaluate(time);
        let same =
            |other: f64| other.to_bits() == value.to_bits() || other.is_nan() && value.is_nan();
        assert!(same(tree.value(time)), "{text:?} at {time:?}: {value:?}");
        assert!(
            same(again.evaluate(time)),
            "{text:?} at {time:?}: {value:?}"
        );
    }
}

/// Times at which functions have their edges, and one that depends on the input.
fn times(input: &[u8]) -> [f64; 8] {
    let bits = input.iter().fold(1, |bits: u64, byte| {
        bits.wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(7) ^ u64::from(*byte)
    });
    let any = f64::from_bits(bits);
    [0.0, -0.0, 1.0, -2.5, 1e308, f64::INFINITY, f64::NAN, any]
}

/// Tokens by number, with what is open closed in the end: most of these are expressions.
fn written(tokens: &[u8]) -> String {
    const TOKENS: [&str; 32] = [
        "t",
        "1",
        "2",
        "0",
        ".5",
        "5.",
        "1e3",
        "2.5E-2",
        "1e999",
        "1e-320",
        "3",
        "(",
        "(",
        ")",
        ")",
        "+",
        "-",
        "*",
        "/",
        "^",
        "^",
        "-",
        " ",
        "sin(",
        "cos(",
        "tan (",
        "exp(",
        "sqrt(",
        "ln(",
        "abs(",
        "0.1",
        "9007199254740993",
    ];
    let mut text = String::new();
    let mut open = 0;
    for token in tokens {
        let token = TOKENS[usize::from(*token) % TOKENS.len()];
        match token {
            ")" if open == 0 => continue,
            ")" => open -= 1,
            _ if token.ends_with('(') => open += 1,
            _ => {}
        }
        text.push_str(token);
    }
    text + &")".repeat(open)
}

#[derive(Debug)]
enum Tree {
    Number(f64),
    Time,
    Negative(Box<Tree>),
    Binary(char, Box<Tree>, Box<Tree>),
    Call(&'static str, Box<Tree>),
}

impl Tree {
    fn nodes(&self) -> usize {
        match self {
            Self::Number(_) | Self::Time => 1,
            Self::Negative(one) | Self::Call(_, one) => 1 + one.nodes(),
            Self::Binary(_, left, right) => 1 + left.nodes() + right.nodes(),
        }
    }

    fn value(&self, time: f64) -> f64 {
        match self {
            Self::Number(value) => *value,
            Self::Time => time,
            Self::Negative(one) => -one.value(time),
            Self::Binary(sign, left, right) => {
                let (left, right) = (left.value(time), right.value(time));
                match sign {
                    '+' => left + right,
                    '-' => left - right,
                    '*' => left * right,
                    '/' => left / right,
                    _ => left.powf(right),
                }
            }
            Self::Call(name, one) => {
                let value = one.value(time);
                match *name {
                    "sin" => value.sin(),
                    "cos" => value.cos(),
                    "tan" => value.tan(),
                    "exp" => value.exp(),
                    "sqrt" => value.sqrt(),
                    "ln" => value.ln(),
                    _ => value.abs(),
                }
            }
        }
    }
}

/// Recursive descent over the characters, one function per level of the grammar; `None` where the text is none.
struct Reading<'a>(&'a [u8]);

impl Reading<'_> {
    fn of(text: &str) -> Option<Tree> {
        let mut reading = Reading(text.as_bytes());
        let tree = reading.sum()?;
        reading.skip_space();
        reading.0.is_empty().then_some(tree)
    }

    fn skip_space(&mut self) {
        self.0 = self.0.trim_ascii_start();
    }

    /// Takes one of these signs, if one is next.
    fn sign(&mut self, signs: &str) -> Option<char> {
        self.skip_space();
        let (first, rest) = self.0.split_first()?;
        let sign = char::from(*first);
        signs.contains(sign).then(|| {
            self.0 = rest;
            sign
        })
    }

    fn sum(&mut self) -> Option<Tree> {
        let mut tree = self.product()?;
        while let Some(sign) = self.sign("+-") {
            tree = Tree::Binary(sign, tree.into(), self.product()?.into());
        }
        Some(tree)
    }

    fn product(&mut self) -> Option<Tree> {
        let mut tree = self.power()?;
        while let Some(sign) = self.sign("*/") {
            tree = Tree::Binary(sign, tree.into(), self.power()?.into());
        }
        Some(tree)
    }

    fn power(&mut self) -> Option<Tree> {
        let base = self.negation()?;
        match self.sign("^") {
            Some(sign) => Some(Tree::Binary(sign, base.into(), self.power()?.into())),
            None => Some(base),
        }
    }

    fn negation(&mut self) -> Option<Tree> {
        match self.sign("-") {
            Some(_) => Some(Tree::Negative(self.negation()?.into())),
            None => self.atom(),
        }
    }

    fn atom(&mut self) -> Option<Tree> {
        if self.sign("(").is_some() {
            return self.closed();
        }
        match self.0.first()? {
            b'0'..=b'9' | b'.' => self.number(),
            _ => self.name(),
        }
    }

    /// The expression in a parenthesis that is open.
    fn closed(&mut self) -> Option<Tree> {
        let tree = self.sum()?;
        self.sign(")").map(|_| tree)
    }

    fn name(&mut self) -> Option<Tree> {
        let length = self.run(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
        let (name, rest) = self.0.split_at(length);
        self.0 = rest;
        if name == b"t" {
            return Some(Tree::Time);
        }
        let functions = ["sin", "cos", "tan", "exp", "sqrt", "ln", "abs"];
        let function = functions.into_iter().find(|one| one.as_bytes() == name)?;
        self.sign("(")?;
        Some(Tree::Call(function, self.closed()?.into()))
    }

    fn run(&self, wanted: impl Fn(u8) -> bool) -> usize {
        let end = self.0.iter().position(|byte| !wanted(*byte));
        end.unwrap_or(self.0.len())
    }

    /// `5`, `5.`, `.5`, `2.5E-2`. An `e` that begins a name is none of the number's, and then nothing fits.
    fn number(&mut self) -> Option<Tree> {
        let text = self.0;
        let mut length = self.run(|byte| byte.is_ascii_digit());
        let mut digits = length;
        if text.get(length) == Some(&b'.') {
            let fraction = Reading(&text[length + 1..]).run(|byte| byte.is_ascii_digit());
            digits += fraction;
            length += 1 + fraction;
        }
        if digits == 0 {
            return None;
        }
        if let Some(b'e' | b'E') = text.get(length) {
            length += 1;
            if let Some(b'+' | b'-') = text.get(length) {
                length += 1;
            }
            let exponent = Reading(&text[length..]).run(|byte| byte.is_ascii_digit());
            if exponent == 0 {
                return None;
            }
            length += exponent;
        }
        let (number, rest) = text.split_at(length);
        self.0 = rest;
        std::str::from_utf8(number)
            .ok()?
            .parse()
            .ok()
            .map(Tree::Number)
    }
}
