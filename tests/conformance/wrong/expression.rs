//! Expressions as a student's parser reads them, with one of the usual mistakes or none.

/// The mistake of a parser.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Misread {
    Nothing,
    MinusBindsLooser,
    PowerFromTheLeft,
    FromTheRight(&'static str),
    AllBindAlike,
    PowerBindsAsTimes,
    WholeDivision,
    Degrees,
    Decimal,
    Binary,
    NoParentheses,
}

/// A value, and whether it is a whole number in the source's type.
type Number = (f64, bool);

struct Parser {
    tokens: Vec<String>,
    at: usize,
    t: f64,
    as_read: Misread,
}

/// The value of an expression at a time. `None` if it does not parse.
pub fn evaluate(text: &str, t: f64, as_read: Misread) -> Option<f64> {
    let mut tokens: Vec<String> = Vec::new();
    for one in text.chars() {
        let joins =
            |last: &String| last.ends_with(|end: char| end.is_alphanumeric() || end == '.') && (one.is_alphanumeric() || one == '.');
        match tokens.last_mut() {
            Some(last) if joins(last) => last.push(one),
            _ => tokens.push(one.to_string()),
        }
    }
    tokens.retain(|token| token != " ");
    if as_read == Misread::NoParentheses {
        let is_name = |token: Option<&String>| token.is_some_and(|token| token.len() > 1 && token.starts_with(char::is_alphabetic));
        let is_call = (0..tokens.len()).any(|at| is_name(tokens.get(at)));
        tokens.retain(|token| is_call || !["(", ")"].contains(&token.as_str()));
    }
    let mut parser = Parser { tokens, at: 0, t, as_read };
    let (value, _) = parser.sum()?;
    (parser.at == parser.tokens.len()).then_some(value)
}

impl Parser {
    fn next(&self) -> &str {
        self.tokens.get(self.at).map_or("", String::as_str)
    }

    fn takes(&mut self, token: &str) -> bool {
        let is_it = self.next() == token;
        self.at += usize::from(is_it);
        is_it
    }

    /// A chain of operators between operands of one level.
    fn chain(&mut self, operators: &[&str], operand: fn(&mut Self) -> Option<Number>) -> Option<Number> {
        let mut value = operand(self)?;
        while let Some(operator) = operators.iter().find(|operator| **operator == self.next()) {
            self.at += 1;
            let turned = matches!(self.as_read, Misread::FromTheRight(which) if which.contains(operator));
            let right = if turned { self.chain(operators, operand)? } else { operand(self)? };
            value = self.apply(value, operator, right);
        }
        Some(value)
    }

    fn apply(&self, (a, left): Number, operator: &str, (b, right): Number) -> Number {
        let whole = left && right;
        match operator {
            "+" => (a + b, whole),
            "-" => (a - b, whole),
            "*" => (a * b, whole),
            "^" => (a.powf(b), whole),
            _ if whole && self.as_read == Misread::WholeDivision => ((a / b).trunc(), true),
            _ => (a / b, false),
        }
    }

    fn sum(&mut self) -> Option<Number> {
        if self.as_read == Misread::AllBindAlike {
            return self.chain(&["+", "-", "*", "/", "^"], Self::unary);
        }
        self.chain(&["+", "-"], Self::product)
    }

    fn product(&mut self) -> Option<Number> {
        let alike = self.as_read == Misread::PowerBindsAsTimes;
        if alike { self.chain(&["*", "/", "^"], Self::unary) } else { self.chain(&["*", "/"], Self::power) }
    }

    fn power(&mut self) -> Option<Number> {
        if self.as_read == Misread::PowerFromTheLeft {
            return self.chain(&["^"], Self::unary);
        }
        if self.as_read == Misread::MinusBindsLooser && self.takes("-") {
            return self.power().map(|(value, whole)| (-value, whole));
        }
        let base = self.unary()?;
        if self.takes("^") { self.power().map(|exponent| self.apply(base, "^", exponent)) } else { Some(base) }
    }

    fn unary(&mut self) -> Option<Number> {
        if self.takes("-") { self.unary().map(|(value, whole)| (-value, whole)) } else { self.atom() }
    }

    fn atom(&mut self) -> Option<Number> {
        if self.takes("(") {
            let inner = self.sum();
            return inner.filter(|_| self.takes(")"));
        }
        let token = self.next().to_owned();
        self.at += 1;
        if token == "t" {
            return Some((self.t, false));
        }
        if let Ok(value) = token.parse::<f64>() {
            return token.starts_with(|first: char| first.is_ascii_digit()).then_some((value, !token.contains('.')));
        }
        let function: fn(f64) -> f64 = match (token.as_str(), self.as_read) {
            ("sin", Misread::Degrees) => |x| x.to_radians().sin(),
            ("ln", Misread::Decimal) => f64::log10,
            ("ln", Misread::Binary) => f64::log2,
            ("sin", _) => f64::sin,
            ("cos", _) => f64::cos,
            ("tan", _) => f64::tan,
            ("exp", _) => f64::exp,
            ("sqrt", _) => f64::sqrt,
            ("ln", _) => f64::ln,
            ("abs", _) => f64::abs,
            _ => return None,
        };
        let argument = if self.takes("(") { self.sum().filter(|_| self.takes(")")) } else { None };
        argument.map(|(value, _)| (function(value), false))
    }
}
