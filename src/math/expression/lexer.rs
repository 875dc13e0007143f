//! Splits the text of an expression into numbers, names and signs.
//!
//! **Invariant:** every byte is read a bounded number of times, and tokens borrow from the text.

use super::error::{ExpressionError, Found};

/// The kind of a token.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum LexemeKind {
    /// A literal with its value, which may be infinite.
    Number(f64),
    /// Letters, digits and underscores that don't start with a digit.
    Name,
    /// One of `+ - * / ^ ( )`.
    Sign(u8),
}

/// A token and its position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lexeme<'a> {
    pub(super) kind: LexemeKind,
    pub(super) text: &'a str,
    /// Offset of its first byte.
    pub(super) start: usize,
}

/// Iterates over the tokens.
pub(super) struct Lexer<'a> {
    text: &'a str,
    /// Offset of the unread rest; always between two characters.
    at: usize,
}

impl<'a> Lexer<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        Self { text, at: 0 }
    }

    /// The next token, `None` at the end.
    pub(super) fn next(&mut self) -> Result<Option<Lexeme<'a>>, ExpressionError> {
        self.skip(|byte| byte.is_ascii_whitespace());
        let start = self.at;
        let Some(first) = self.peek() else {
            return Ok(None);
        };
        let kind = match first {
            b'0'..=b'9' | b'.' => self.number()?,
            b'a'..=b'z' | b'A'..=b'Z' | b'_' => {
                self.skip(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
                LexemeKind::Name
            }
            b'+' | b'-' | b'*' | b'/' | b'^' | b'(' | b')' => {
                self.at += 1;
                LexemeKind::Sign(first)
            }
            _ => return Err(self.unrecognized()),
        };
        let text = self.text.get(start..self.at).unwrap_or_default();
        Ok(Some(Lexeme { kind, text, start }))
    }

    /// The column just after the last character that is not white space. The text must have been read to its end.
    pub(super) fn end_column(&self) -> usize {
        column(self.text.trim_ascii_end().len())
    }

    /// Digits with at most one point, at least one digit, then perhaps an exponent.
    fn number(&mut self) -> Result<LexemeKind, ExpressionError> {
        let start = self.at;
        let mut digits = self.skip(|byte| byte.is_ascii_digit());
        if self.peek() == Some(b'.') {
            self.at += 1;
            digits += self.skip(|byte| byte.is_ascii_digit());
        }
        if digits == 0 {
            return Err(self.expected_digit(start));
        }
        self.exponent(start)?;
        // The standard library parses exactly these forms, correctly rounded, in linear time.
        let value = self.text.get(start..self.at).map(str::parse);
        debug_assert!(matches!(value, Some(Ok(_))), "digits make a number");
        Ok(LexemeKind::Number(
            value.and_then(Result::ok).unwrap_or(f64::NAN),
        ))
    }

    /// An `e` right after a number starts its exponent, unless it starts a name (`2exp(t)`). Then the parser
    /// reports a name after a number, which is the better message.
    fn exponent(&mut self, start: usize) -> Result<(), ExpressionError> {
        let rest = self.text.as_bytes().get(self.at..).unwrap_or_default();
        let [b'e' | b'E', after @ ..] = rest else {
            return Ok(());
        };
        if matches!(after, [b'a'..=b'z' | b'A'..=b'Z' | b'_', ..]) {
            return Ok(());
        }
        self.at += if matches!(after, [b'+' | b'-', ..]) {
            2
        } else {
            1
        };
        if self.skip(|byte| byte.is_ascii_digit()) == 0 {
            return Err(self.expected_digit(start));
        }
        Ok(())
    }

    fn expected_digit(&self, start: usize) -> ExpressionError {
        ExpressionError::ExpectedDigit {
            column: column(self.at),
            found: Found::text(self.text.get(start..self.at).unwrap_or_default()),
        }
    }

    fn unrecognized(&self) -> ExpressionError {
        let rest = self.text.get(self.at..).unwrap_or_default();
        let length = rest.chars().next().map_or(0, char::len_utf8);
        ExpressionError::UnrecognizedCharacter {
            column: column(self.at),
            found: Found::text(rest.get(..length).unwrap_or_default()),
        }
    }

    fn peek(&self) -> Option<u8> {
        self.text.as_bytes().get(self.at).copied()
    }

    /// Skips bytes that satisfy the test and returns their number. They must be ASCII.
    fn skip(&mut self, test: impl Fn(u8) -> bool) -> usize {
        let start = self.at;
        while self.peek().is_some_and(&test) {
            self.at += 1;
        }
        self.at - start
    }
}

/// The column, from 1, of the character at a byte offset. A text up to its first mistake is ASCII, because
/// every other character is a mistake. So bytes count characters there.
pub(super) const fn column(offset: usize) -> usize {
    offset + 1
}
