//! Orders the tokens of an expression into a postfix program, by Dijkstra's shunting-yard algorithm. Its stack holds
//! operators and parentheses that are not complete.
//!
//! **Invariant:** an operation is emitted only after its operands, so the program of an accepted text leaves
//! exactly one value.

use super::error::{ExpressionError, Found};
use super::lexer::{Lexeme, LexemeKind, Lexer, column};
use super::program::{Arity, Operation, Precedence, Program};

/// An entry of the parser's stack.
#[derive(Debug, Clone, Copy)]
enum Waiting {
    /// An operator whose right operand is being read.
    Operator(Operation),
    /// A parenthesis.
    Open,
    /// A function with its parenthesis.
    Call(Operation),
}

/// The kind of token that may come next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Expect {
    Operand,
    Operator,
}

/// Reads all of `text`.
pub(super) fn parse(text: &str) -> Result<Program, ExpressionError> {
    let mut parser = Parser {
        lexer: Lexer::new(text),
        pending: Vec::new(),
        program: Program::default(),
        values: 0,
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
    pending: Vec<Waiting>,
    program: Program,
    /// How many values the program leaves so far.
    values: usize,
}

impl Parser<'_> {
    /// Takes a token where a value must start.
    fn operand(&mut self, token: &Lexeme<'_>) -> Result<Expect, ExpressionError> {
        match token.kind {
            LexemeKind::Number(value) => {
                self.program.literals.push(value);
                self.emit(Operation::Number);
                Ok(Expect::Operator)
            }
            LexemeKind::Name if token.text == "t" => {
                self.emit(Operation::Variable);
                Ok(Expect::Operator)
            }
            LexemeKind::Name => self.call(token),
            LexemeKind::Sign(b'-') => {
                self.pending.push(Waiting::Operator(Operation::Negate));
                Ok(Expect::Operand)
            }
            LexemeKind::Sign(b'(') => {
                self.pending.push(Waiting::Open);
                Ok(Expect::Operand)
            }
            LexemeKind::Sign(_) => Err(ExpressionError::ExpectedOperand {
                column: column(token.start),
                found: Found::text(token.text),
            }),
        }
    }

    /// Takes a function's name and the parenthesis that must follow.
    fn call(&mut self, token: &Lexeme<'_>) -> Result<Expect, ExpressionError> {
        let function = Operation::FUNCTIONS
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
            Some(Lexeme {
                kind: LexemeKind::Sign(b'('),
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
        self.pending.push(Waiting::Call(op));
        Ok(Expect::Operand)
    }

    /// Takes a token after a complete value.
    fn operator(&mut self, token: &Lexeme<'_>) -> Result<Expect, ExpressionError> {
        let op = match token.kind {
            LexemeKind::Sign(b'+') => Operation::Add,
            LexemeKind::Sign(b'-') => Operation::Subtract,
            LexemeKind::Sign(b'*') => Operation::Multiply,
            LexemeKind::Sign(b'/') => Operation::Divide,
            LexemeKind::Sign(b'^') => Operation::Power,
            LexemeKind::Sign(b')') => return self.close(token),
            _ => {
                return Err(ExpressionError::ExpectedOperator {
                    column: column(token.start),
                    found: Found::text(token.text),
                });
            }
        };
        // An operation that binds tighter is complete. So is one of the same level that groups from the left. Only
        // `^` groups from the right.
        self.emit_while(|waiting| {
            waiting > op.level() || (waiting == op.level() && waiting != Precedence::Power)
        });
        self.pending.push(Waiting::Operator(op));
        Ok(Expect::Operand)
    }

    fn close(&mut self, token: &Lexeme<'_>) -> Result<Expect, ExpressionError> {
        self.emit_while(|_| true);
        match self.pending.pop() {
            Some(Waiting::Call(op)) => self.emit(op),
            Some(Waiting::Open | Waiting::Operator(_)) => {}
            None => {
                return Err(ExpressionError::Unopened {
                    column: column(token.start),
                });
            }
        }
        Ok(Expect::Operator)
    }

    fn finish(mut self, text: &str, expect: Expect) -> Result<Program, ExpressionError> {
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
        Ok(self.program)
    }

    /// Emits the operators on top of the stack, down to a parenthesis or the first one whose level fails the test.
    fn emit_while(&mut self, test: impl Fn(Precedence) -> bool) {
        while let Some(Waiting::Operator(op)) = self.pending.last().copied() {
            if !test(op.level()) {
                break;
            }
            self.pending.pop();
            self.emit(op);
        }
    }

    fn emit(&mut self, op: Operation) {
        match op.arity() {
            Arity::Zero => {
                self.values += 1;
                self.program.depth = self.program.depth.max(self.values);
            }
            Arity::One => {}
            Arity::Two => self.values -= 1,
        }
        self.program.ops.push(op);
    }

    fn place(&self, token: Option<&Lexeme<'_>>) -> (usize, Found) {
        match token {
            Some(token) => (column(token.start), Found::text(token.text)),
            None => (self.lexer.end_column(), Found::End),
        }
    }
}

/// Byte offset of the last `(` that is not closed. It is searched only for the message: positions of all open
/// parentheses would need more memory than the program.
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
