//! The faults of an expression, as sentences for its author.
//!
//! **Invariant:** a message is short and printable for every text. A quotation in it is escaped and shortened.

use std::fmt;

/// Longest quotation of the text in a message, in characters: enough to recognise the place.
const MAX_QUOTED: usize = 20;

/// Why a text is not an expression. Columns count characters, from 1.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ExpressionError {
    /// The text has only white space.
    #[error("expected an expression in t, found an empty text")]
    Empty,
    /// A character that is in no token.
    #[error("unrecognized character {found} at column {column}")]
    UnrecognizedCharacter {
        /// Its position.
        column: usize,
        /// The character.
        found: Found,
    },
    /// A name that is neither `t` nor a function.
    #[error(
        "unknown name {found} at column {column}: \
         the variable is t, the functions are sin, cos, tan, exp, sqrt, ln and abs"
    )]
    UnknownName {
        /// Its start.
        column: usize,
        /// The name.
        found: Found,
    },
    /// A decimal point without a digit on either side, or an exponent without one.
    #[error("expected a digit at column {column}, after {found}")]
    ExpectedDigit {
        /// Position of the missing digit.
        column: usize,
        /// The number up to this position.
        found: Found,
    },
    /// A token that cannot start a value, where a value must start.
    #[error("expected a number, t, a function, - or ( at column {column}, found {found}")]
    ExpectedOperand {
        /// Position of the missing value.
        column: usize,
        /// The text there.
        found: Found,
    },
    /// A token other than an operator or a closing parenthesis after a value.
    #[error("expected an operator at column {column}, found {found}")]
    ExpectedOperator {
        /// Position of the missing operator.
        column: usize,
        /// The text there.
        found: Found,
    },
    /// A function without a parenthesised argument.
    #[error("expected ( after {function} at column {column}, found {found}")]
    ExpectedArgument {
        /// The function.
        function: &'static str,
        /// Position of the missing parenthesis.
        column: usize,
        /// The text there.
        found: Found,
    },
    /// A closing parenthesis without an opening one.
    #[error("the ) at column {column} closes nothing")]
    Unopened {
        /// Its position.
        column: usize,
    },
    /// An opening parenthesis without a closing one.
    #[error("the ( at column {column} is never closed")]
    Unclosed {
        /// Position of the innermost open one.
        column: usize,
    },
}

/// The text at a place, in a printable form.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Found {
    /// A piece of the text, at most 20 characters of it, escaped.
    Text(String),
    /// The end of the text.
    End,
}

impl Found {
    /// Quotes `text`.
    pub(super) fn text(text: &str) -> Self {
        let mut characters = text.chars();
        let mut quoted: String = characters
            .by_ref()
            .take(MAX_QUOTED)
            .flat_map(char::escape_debug)
            .collect();
        if characters.next().is_some() {
            quoted.push_str("...");
        }
        Self::Text(quoted)
    }
}

impl fmt::Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Text(text) => write!(f, "'{text}'"),
            Self::End => f.write_str("the end"),
        }
    }
}
