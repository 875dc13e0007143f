//! The token: a secret that every client must send if other machines can reach the runtime.
//!
//! **Invariant:** the time of a comparison depends only on the length of the secret. No log and no message contains
//! the secret.

use std::fmt;

use subtle::ConstantTimeEq;

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
