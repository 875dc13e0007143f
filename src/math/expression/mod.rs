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
//! constant and no implied multiplication. Names are case-sensitive. Values are ordinary `f64`. A domain error is
//! NaN. A literal too large for `f64`, such as `1e999`, is infinity.
//!
//! `lexer` splits the text into tokens. `parser` orders them into the flat postfix `program` of the [`Expression`].
//! `display` writes that program as text again.
//!
//! **Invariant:** nothing here recurses. Time and memory of parsing, evaluating, printing and dropping grow linearly
//! with the text, however deeply it nests.

mod display;
mod error;
mod lexer;
mod parser;
mod program;

pub use error::{ExpressionError, Found};
use program::{Operation, Program};

/// An expression in `t`. Every value of this type is well-formed.
#[derive(Debug, Clone, PartialEq)]
pub struct Expression(Program);

/// Working memory for [`Expression::evaluate_in`], allocated once for many evaluations.
#[derive(Debug, Clone)]
pub struct Stack(Vec<f64>);

impl Expression {
    /// Reads an expression.
    ///
    /// # Errors
    /// The first thing in the text that the grammar does not allow, with its column.
    pub fn parse(text: &str) -> Result<Self, ExpressionError> {
        parser::parse(text).map(Self)
    }

    /// The number of literals, variables, operators and function calls. Parentheses do not count.
    ///
    /// This is the work of one evaluation.
    #[must_use]
    pub fn nodes(&self) -> usize {
        self.0.ops.len()
    }

    /// Working memory that is enough for this expression.
    #[must_use]
    pub fn stack(&self) -> Stack {
        Stack(Vec::with_capacity(self.0.depth))
    }

    /// The value at time `t` \[s\].
    #[must_use]
    pub fn evaluate(&self, t: f64) -> f64 {
        self.evaluate_in(&mut self.stack(), t)
    }

    /// The value at time `t` \[s\], computed in memory that the caller keeps between evaluations.
    ///
    /// A stack of another expression can be used too; it then grows once.
    #[must_use]
    pub fn evaluate_in(&self, stack: &mut Stack, t: f64) -> f64 {
        let stack = &mut stack.0;
        stack.clear();
        let mut literals = self.0.literals.iter();
        // The topmost value is kept in a variable, so most operations access no memory. The value pushed below the
        // first operand is never popped.
        let mut top = f64::NAN;
        for op in &self.0.ops {
            match op {
                Operation::Number => {
                    stack.push(top);
                    top = literals.next().copied().unwrap_or(f64::NAN);
                }
                Operation::Variable => {
                    stack.push(top);
                    top = t;
                }
                Operation::Negate => top = -top,
                Operation::Add => top += below(stack),
                Operation::Subtract => top = below(stack) - top,
                Operation::Multiply => top *= below(stack),
                Operation::Divide => top = below(stack) / top,
                Operation::Power => top = below(stack).powf(top),
                Operation::Sin => top = top.sin(),
                Operation::Cos => top = top.cos(),
                Operation::Tan => top = top.tan(),
                Operation::Exp => top = top.exp(),
                Operation::Sqrt => top = top.sqrt(),
                Operation::Ln => top = top.ln(),
                Operation::Abs => top = top.abs(),
            }
        }
        debug_assert_eq!(stack.len(), 1, "a program leaves one value");
        top
    }
}

/// The left operand. It exists, because the parser emits an operation only after its operands.
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
            assert_eq!(expression.0.depth, depth, "{text}");
            let mut stack = expression.stack();
            let reserved = stack.0.capacity();
            let _ = expression.evaluate_in(&mut stack, 1.0);
            assert_eq!(stack.0.capacity(), reserved, "{text}");
        }
    }
}
