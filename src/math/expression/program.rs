//! The postfix program of an expression, and its operations.
//!
//! **Invariant:** an operation is a single byte, so a program is no larger than its text.

/// One operation of the postfix program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Operation {
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

/// The number of operands that an operation pops. Every operation pushes one value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Arity {
    Zero,
    One,
    Two,
}

impl Operation {
    /// The functions by name.
    pub(super) const FUNCTIONS: [(&'static str, Self); 7] = [
        ("sin", Self::Sin),
        ("cos", Self::Cos),
        ("tan", Self::Tan),
        ("exp", Self::Exp),
        ("sqrt", Self::Sqrt),
        ("ln", Self::Ln),
        ("abs", Self::Abs),
    ];

    pub(super) const fn arity(self) -> Arity {
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

    pub(super) const fn level(self) -> Precedence {
        match self {
            Self::Add | Self::Subtract => Precedence::Sum,
            Self::Multiply | Self::Divide => Precedence::Product,
            Self::Power => Precedence::Power,
            _ => Precedence::Operand,
        }
    }
}

/// How tightly an operation binds, loosest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Precedence {
    Sum,
    Product,
    Power,
    /// A negation, a number, a name or parentheses: nothing binds tighter.
    Operand,
}

/// A program: operands before their operation.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Program {
    pub(super) ops: Vec<Operation>,
    /// The literals in the order written; none is negative or NaN.
    pub(super) literals: Vec<f64>,
    /// The largest number of values on the stack during an evaluation.
    pub(super) depth: usize,
}
