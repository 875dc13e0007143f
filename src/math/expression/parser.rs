//! Orders the tokens of an expression into a postfix program: Dijkstra's shunting yard, which keeps what is still open
//! on a stack of its own.
//!
//! **Invariant:** an operation is emitted only after its operands, so that the program of an accepted text leaves exactly
//! one value.

use super::error::{ExpressionError, Found};
use super::lexer::{Kind, Lexer, Token, column};
use super::{Arity, Expression, Level, Op};

/// What waits on the parser's stack.
#[derive(Debug, Clone, Copy)]
enum Pending {
    /// An operator whose right operand is being read.
    Operator(Op),
    /// A parenthesis.
    Open,
    /// A function with its parenthesis.
    Call(Op),
}

/// What may come next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Expect {
    Operand,
    Operator,
}

/// Reads all of `text`.
pub(super) fn parse(text: &str) -> Result<Expression, ExpressionError> {
    let mut parser = Parser {
        lexer: Lexer::new(text),
        pending: Vec::new(),
        program: Program::default(),
    };
    let mut expect = Expect::Operand;
    while let Some(token) = parser.lexer.next()? {
        expect = match expect {
            Expect::Operand => parser.operand(&token)?,
            Expect::Operator => parser.operator(&token)?,
        };
    }
    parser.finish(text, expect)
}

struct Parser<'a> {
    lexer: Lexer<'a>,
    pending: Vec<Pending>,
    program: Program,
}

impl Parser<'_> {
    /// Takes a token where a value must start.
    fn operand(&mut self, token: &Token<'_>) -> Result<Expect, ExpressionError> {
        match token.kind {
            Kind::Number(value) => {
                self.program.literals.push(value);
                self.program.emit(Op::Number);
                Ok(Expect::Operator)
            }
            Kind::Name if token.text == "t" => {
                self.program.emit(Op::Variable);
                Ok(Expect::Operator)
            }
            Kind::Name => self.call(token),
            Kind::Sign(b'-') => {
                self.pending.push(Pending::Operator(Op::Negate));
                Ok(Expect::Operand)
            }
            Kind::Sign(b'(') => {
                self.pending.push(Pending::Open);
                Ok(Expect::Operand)
            }
            Kind::Sign(_) => Err(ExpressionError::ExpectedOperand {
                column: column(token.start),
                found: Found::text(token.text),
            }),
        }
    }

    /// Takes a function's name and the parenthesis that must follow.
    fn call(&mut self, token: &Token<'_>) -> Result<Expect, ExpressionError> {
        let function = Op::FUNCTIONS
            .into_iter()
            .find(|(name, _)| *name == token.text);
        let Some((name, op)) = function else {
            return Err(ExpressionError::UnknownName {
                column: column(token.start),
                found: Found::text(token.text),
            });
        };
        let next = self.lexer.next()?;
        if !matches!(
            next,
            Some(Token {
                kind: Kind::Sign(b'('),
                ..
            })
        ) {
            let (column, found) = self.place(next.as_ref());
            return Err(ExpressionError::ExpectedArgument {
                function: name,
                column,
                found,
            });
        }
        self.pending.push(Pending::Call(op));
        Ok(Expect::Operand)
    }

    /// Takes a token after a complete value.
    fn operator(&mut self, token: &Token<'_>) -> Result<Expect, ExpressionError> {
        let op = match token.kind {
            Kind::Sign(b'+') => Op::Add,
            Kind::Sign(b'-') => Op::Subtract,
            Kind::Sign(b'*') => Op::Multiply,
            Kind::Sign(b'/') => Op::Divide,
            Kind::Sign(b'^') => Op::Power,
            Kind::Sign(b')') => return self.close(token),
            _ => {
                return Err(ExpressionError::ExpectedOperator {
                    column: column(token.start),
                    found: Found::text(token.text),
                });
            }
        };
        // What binds tighter is complete. So is an equal that groups from the left; only `^` groups from the right.
        self.emit_while(|waiting| {
            waiting > op.level() || (waiting == op.level() && waiting != Level::Power)
        });
        self.pending.push(Pending::Operator(op));
        Ok(Expect::Operand)
    }

    fn close(&mut self, token: &Token<'_>) -> Result<Expect, ExpressionError> {
        self.emit_while(|_| true);
        match self.pending.pop() {
            Some(Pending::Call(op)) => self.program.emit(op),
            Some(Pending::Open | Pending::Operator(_)) => {}
            None => {
                return Err(ExpressionError::Unopened {
                    column: column(token.start),
                });
            }
        }
        Ok(Expect::Operator)
    }

    fn finish(mut self, text: &str, expect: Expect) -> Result<Expression, ExpressionError> {
        if expect == Expect::Operand {
            let (column, found) = self.place(None);
            return Err(if column == 1 {
                ExpressionError::Empty
            } else {
                ExpressionError::ExpectedOperand { column, found }
            });
        }
        self.emit_while(|_| true);
        if !self.pending.is_empty() {
            return Err(ExpressionError::Unclosed {
                column: column(innermost_open(text)),
            });
        }
        let Program {
            ops,
            literals,
            depth,
            ..
        } = self.program;
        Ok(Expression {
            ops,
            literals,
            depth,
        })
    }

    /// Emits the operators on top of the stack, down to a parenthesis or the first one whose level fails the test.
    fn emit_while(&mut self, test: impl Fn(Level) -> bool) {
        while let Some(Pending::Operator(op)) = self.pending.last().copied() {
            if !test(op.level()) {
                break;
            }
            self.pending.pop();
            self.program.emit(op);
        }
    }

    fn place(&self, token: Option<&Token<'_>>) -> (usize, Found) {
        match token {
            Some(token) => (column(token.start), Found::text(token.text)),
            None => (self.lexer.end_column(), Found::End),
        }
    }
}

/// Byte offset of the last `(` that nothing closes. Looked up only for the message: remembering the place of every open
/// parenthesis would cost more memory than the program.
fn innermost_open(text: &str) -> usize {
    let mut closed = 0_usize;
    for (offset, byte) in text.bytes().enumerate().rev() {
        match byte {
            b')' => closed += 1,
            b'(' if closed == 0 => return offset,
            b'(' => closed -= 1,
            _ => {}
        }
    }
    debug_assert!(false, "only called with a parenthesis open");
    0
}

/// The program so far, with the number of values that it leaves.
#[derive(Default)]
struct Program {
    ops: Vec<Op>,
    literals: Vec<f64>,
    values: usize,
    depth: usize,
}

impl Program {
    fn emit(&mut self, op: Op) {
        match op.arity() {
            Arity::Zero => {
                self.values += 1;
                self.depth = self.depth.max(self.values);
            }
            Arity::One => {}
            Arity::Two => self.values -= 1,
        }
        self.ops.push(op);
    }
}
