//! The token: a secret that every client must send if other machines can reach the runtime.
//!
//! **Invariant:** the time of a comparison depends only on the length of the secret. No log and no message contains
//! the secret.

use std::fmt;
use std::time::Duration;

use subtle::ConstantTimeEq;

use super::{Incoming, Op};

/// Shortest token in characters: 16 random letters and digits cannot be guessed.
pub const MIN_TOKEN: usize = 16;
/// Longest token in characters, each a byte: it must fit into the head of an HTTP request.
pub const MAX_TOKEN: usize = 256;

/// A token: printable ASCII without spaces, so it can be in a command line, a URL and a cookie.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(Box<str>);

impl Token {
    /// Converts a text to a token.
    ///
    /// # Errors
    /// The reason if it is not valid. The text itself is not repeated.
    pub fn read(text: &str) -> Result<Self, String> {
        match text.len() {
            _ if !text.bytes().all(|byte| byte.is_ascii_graphic()) => {
                Err("must be printable ASCII without spaces".to_owned())
            }
            MIN_TOKEN..=MAX_TOKEN => Ok(Self(text.into())),
            length => Err(format!(
                "must have {MIN_TOKEN} to {MAX_TOKEN} characters, got {length}"
            )),
        }
    }

    /// Whether `presented` is the token, in a time that does not depend on where the two differ.
    #[must_use]
    pub fn matches(&self, presented: &str) -> bool {
        self.0.as_bytes().ct_eq(presented.as_bytes()).into()
    }

    /// The secret itself, for a client that has just sent it.
    #[must_use]
    pub fn reveal(&self) -> &str {
        &self.0
    }
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token(…)")
    }
}

/// Why a client that must send a token is not admitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum AuthError {
    /// The first frame has no token, or there is none.
    #[error("this runtime requires its token first: {{\"op\":\"auth\",\"token\":...}}")]
    NotShown,
    /// Another token.
    #[error("token: not this runtime's")]
    Wrong,
    /// No whole frame came in time; holds the limit.
    #[error("this runtime requires its token first, and waited for {} s", .0.as_secs())]
    TooLate(Duration),
    /// The first frame is too long; holds the limit in bytes.
    #[error("this runtime requires its token first, in at most {0} bytes")]
    TooMuch(usize),
}

/// Checks whether a client's first frame has the token.
///
/// # Errors
/// If it has none or another one.
pub fn authenticate(token: &Token, frame: &Incoming) -> Result<(), AuthError> {
    match &frame.op {
        Ok(Op::Auth {
            token: Some(shown), ..
        }) if token.matches(shown) => Ok(()),
        Ok(Op::Auth { token: Some(_), .. }) => Err(AuthError::Wrong),
        _ => Err(AuthError::NotShown),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_is_not_shown() {
        let token = Token::read("correct-horse-battery").unwrap();
        assert_eq!(format!("{token:?}"), "Token(…)");
        assert_eq!(
            token.reveal(),
            "correct-horse-battery",
            "but where it is asked for"
        );
    }
}
