//! The `function` of `/arm_sim/integration_step`: an expression in one variable `t`, read once, evaluated often.
//!
//! | level, loosest first | written | grouping |
//! | --- | --- | --- |
//! | sum | `a + b`, `a - b` | from the left |
//! | product | `a * b`, `a / b` | from the left |
//! | power | `a ^ b` | from the right |
//! | negation | `-a`, repeatable | |
//! | atom | `2.5e-3`, `t`, `(a)`, `sin(a)` and the like | |
//!
//! Negation binds tighter than `^`: `-2^2` is `(-2)^2 = 4`, and `2^-1` is `0.5`. There is no unary plus, no named
//! constant, no implied multiplication. Names are case-sensitive. Values are ordinary `f64`: a domain error is NaN, a
//! literal too large for `f64`, such as `1e999`, is infinity.
//!
//! `lexer` cuts the text into tokens, `parser` orders them into the flat postfix program that [`Expression`] holds,
//! `display` writes that program as text again.
//!
//! **Invariant:** nothing here recurses. Time and memory of parsing, evaluating, printing and dropping grow linearly
//! with the text, however deeply it nests.

mod display;
mod error;
mod lexer;
mod parser;

pub use error::{ExpressionError, Found};

/// One operation of the postfix program. A single byte, so that a program is no larger than its text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Op {
    /// Pushes the next literal: literals are used in the order in which they were written.
    Number,
    /// Pushes `t`.
    Variable,
    Negate,
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Sin,
    Cos,
    Tan,
    Exp,
    Sqrt,
    Ln,
    Abs,
}

/// How many operands an operation takes off the stack. Every operation puts one value back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Arity {
    Zero,
    One,
    Two,
}

impl Op {
    /// The functions by name.
    const FUNCTIONS: [(&'static str, Self); 7] = [
        ("sin", Self::Sin),
        ("cos", Self::Cos),
        ("tan", Self::Tan),
        ("exp", Self::Exp),
        ("sqrt", Self::Sqrt),
        ("ln", Self::Ln),
        ("abs", Self::Abs),
    ];

    const fn arity(self) -> Arity {
        match self {
            Self::Number | Self::Variable => Arity::Zero,
            Self::Negate
            | Self::Sin
            | Self::Cos
            | Self::Tan
            | Self::Exp
            | Self::Sqrt
            | Self::Ln
            | Self::Abs => Arity::One,
            Self::Add | Self::Subtract | Self::Multiply | Self::Divide | Self::Power => Arity::Two,
        }
    }

    const fn level(self) -> Level {
        match self {
            Self::Add | Self::Subtract => Level::Sum,
            Self::Multiply | Self::Divide => Level::Product,
            Self::Power => Level::Power,
            _ => Level::Operand,
        }
    }
}

/// How tightly an operation binds, loosest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Level {
    Sum,
    Product,
    Power,
    /// A negation, and whatever stands for itself: no operation asks for anything tighter.
    Operand,
}

/// An expression in `t`. A value that exists is well-formed.
#[derive(Debug, Clone, PartialEq)]
pub struct Expression {
    /// The program, operands before their operation.
    ops: Vec<Op>,
    /// The literals in the order written; none is negative or NaN.
    literals: Vec<f64>,
    /// Most values that wait at the same time during an evaluation.
    depth: usize,
}

/// Working memory for [`Expression::evaluate_in`], to be allocated once and used for many evaluations.
#[derive(Debug, Clone)]
pub struct Stack(Vec<f64>);

impl Expression {
    /// Reads an expression.
    ///
    /// # Errors
    /// The first thing in the text that the grammar does not allow, with its column.
    pub fn parse(text: &str) -> Result<Self, ExpressionError> {
        parser::parse(text)
    }

    /// How many literals, variables, operators and function calls the expression has; parentheses count nothing.
    ///
    /// This is the work of one evaluation.
    #[must_use]
    pub fn nodes(&self) -> usize {
        self.ops.len()
    }

    /// Working memory that is enough for this expression.
    #[must_use]
    pub fn stack(&self) -> Stack {
        Stack(Vec::with_capacity(self.depth))
    }

    /// The value at time `t` \[s\].
    #[must_use]
    pub fn evaluate(&self, t: f64) -> f64 {
        self.evaluate_in(&mut self.stack(), t)
    }

    /// The value at time `t` \[s\], computed in memory that the caller keeps between evaluations.
    ///
    /// A stack made for another expression serves as well; it grows once.
    #[must_use]
    pub fn evaluate_in(&self, stack: &mut Stack, t: f64) -> f64 {
        let stack = &mut stack.0;
        stack.clear();
        let mut literals = self.literals.iter();
        // The topmost value stays out of the stack: most operations then touch no memory. What is pushed below the very
        // first operand is never taken back.
        let mut top = f64::NAN;
        for op in &self.ops {
            match op {
                Op::Number => {
                    stack.push(top);
                    top = literals.next().copied().unwrap_or(f64::NAN);
                }
                Op::Variable => {
                    stack.push(top);
                    top = t;
                }
                Op::Negate => top = -top,
                Op::Add => top += below(stack),
                Op::Subtract => top = below(stack) - top,
                Op::Multiply => top *= below(stack),
                Op::Divide => top = below(stack) / top,
                Op::Power => top = below(stack).powf(top),
                Op::Sin => top = top.sin(),
                Op::Cos => top = top.cos(),
                Op::Tan => top = top.tan(),
                Op::Exp => top = top.exp(),
                Op::Sqrt => top = top.sqrt(),
                Op::Ln => top = top.ln(),
                Op::Abs => top = top.abs(),
            }
        }
        debug_assert_eq!(stack.len(), 1, "a program leaves one value");
        top
    }
}

/// The left operand. The parser only emits an operation after its operands, so it is there.
#[inline(always)]
fn below(stack: &mut Vec<f64>) -> f64 {
    stack.pop().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::Expression;

    #[test]
    fn an_evaluation_needs_the_room_that_was_reserved_and_no_more() {
        for (text, depth) in [
            ("t", 1),
            ("-sin(t)", 1),
            ("1+t", 2),
            ("1+2+3+t", 2),
            ("1*2+3*t", 3),
            ("1+(2+(3+t))", 4),
            ("t^t^t^t^t", 5),
        ] {
            let expression = Expression::parse(text).unwrap();
            assert_eq!(expression.depth, depth, "{text}");
            let mut stack = expression.stack();
            let reserved = stack.0.capacity();
            let _ = expression.evaluate_in(&mut stack, 1.0);
            assert_eq!(stack.0.capacity(), reserved, "{text}");
        }
    }
}
