//! Writes an expression as text: one spelling for each program, with only the necessary parentheses.
//!
//! **Invariant:** the text parses to the very same program.

use std::fmt;

use super::Expression;
use super::program::{Arity, Operation, Precedence};

/// A part that is still to be written.
enum Part {
    /// The operand that ends at this operation. It gets parentheses if its level is below the given one.
    Operand {
        root: usize,
        level: Precedence,
    },
    Text(&'static str),
}

impl fmt::Display for Expression {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let starts = self.starts();
        // Operands are written from left to right, in the order of the literals.
        let mut literals = self.0.literals.iter();
        let mut pieces = Vec::new();
        if let Some(root) = self.0.ops.len().checked_sub(1) {
            pieces.push(Part::Operand {
                root,
                level: Precedence::Sum,
            });
        }
        while let Some(piece) = pieces.pop() {
            let (root, level) = match piece {
                Part::Operand { root, level } => (root, level),
                Part::Text(text) => {
                    f.write_str(text)?;
                    continue;
                }
            };
            let Some(&op) = self.0.ops.get(root) else {
                continue;
            };
            let parenthesised = op.level() < level;
            if parenthesised {
                f.write_str("(")?;
                pieces.push(Part::Text(")"));
            }
            match op.arity() {
                Arity::Zero => write_atom(f, op, &mut literals)?,
                Arity::One => {
                    f.write_str(symbol(op))?;
                    let operand = root.saturating_sub(1);
                    if op == Operation::Negate {
                        pieces.push(Part::Operand {
                            root: operand,
                            level: Precedence::Operand,
                        });
                    } else {
                        f.write_str("(")?;
                        pieces.push(Part::Text(")"));
                        pieces.push(Part::Operand {
                            root: operand,
                            level: Precedence::Sum,
                        });
                    }
                }
                Arity::Two => {
                    let right = root.saturating_sub(1);
                    let left = starts.get(right).map_or(0, |start| start.saturating_sub(1));
                    let (left_level, right_level) = operand_levels(op);
                    pieces.push(Part::Operand {
                        root: right,
                        level: right_level,
                    });
                    pieces.push(Part::Text(symbol(op)));
                    pieces.push(Part::Operand {
                        root: left,
                        level: left_level,
                    });
                }
            }
        }
        Ok(())
    }
}

impl Expression {
    /// For each operation, where the part of the program that computes its value starts.
    fn starts(&self) -> Vec<usize> {
        let mut starts = Vec::with_capacity(self.0.ops.len());
        let mut open = Vec::with_capacity(self.0.depth);
        for (index, op) in self.0.ops.iter().enumerate() {
            match op.arity() {
                Arity::Zero => open.push(index),
                Arity::One => {}
                Arity::Two => {
                    open.pop();
                }
            }
            starts.push(open.last().copied().unwrap_or_default());
        }
        starts
    }
}

/// The lowest levels at which the left and the right operand need no parentheses.
fn operand_levels(op: Operation) -> (Precedence, Precedence) {
    match op.level() {
        Precedence::Sum => (Precedence::Sum, Precedence::Product),
        Precedence::Product => (Precedence::Product, Precedence::Power),
        _ => (Precedence::Operand, Precedence::Power),
    }
}

fn symbol(op: Operation) -> &'static str {
    match op {
        Operation::Negate => "-",
        Operation::Add => " + ",
        Operation::Subtract => " - ",
        Operation::Multiply => "*",
        Operation::Divide => "/",
        Operation::Power => "^",
        _ => Operation::FUNCTIONS
            .into_iter()
            .find(|(_, function)| *function == op)
            .map_or("", |(name, _)| name),
    }
}

fn write_atom<'a>(
    f: &mut fmt::Formatter<'_>,
    op: Operation,
    literals: &mut impl Iterator<Item = &'a f64>,
) -> fmt::Result {
    if op == Operation::Variable {
        return f.write_str("t");
    }
    let value = literals.next().copied().unwrap_or_default();
    if value.is_infinite() {
        // The grammar has no name for infinity, but a literal beyond the range of f64 is infinite.
        f.write_str("1e999")
    } else if value == 0.0 || (1e-5..1e16).contains(&value) {
        write!(f, "{value}")
    } else {
        write!(f, "{value:e}")
    }
}
