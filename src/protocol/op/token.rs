//! The token: a secret that every client must send if other machines can reach the runtime.
//!
//! **Invariant:** the time of a comparison depends only on the length of the secret. No log and no message contains
//! the secret.

use std::fmt;

use subtle::ConstantTimeEq;

/// Shortest token in bytes: 16 random letters and digits cannot be guessed.
pub const MIN_TOKEN: usize = 16;
/// Longest token in bytes: it must fit into the head of an HTTP request.
pub const MAX_TOKEN: usize = 256;

/// A token: printable ASCII without spaces, so it can be in a command line, a URL and a cookie.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(Box<str>);

/// Why a text is not a valid token. The text itself is not repeated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum TokenError {
    /// Fewer than [`MIN_TOKEN`] bytes.
    #[error("must be at least {MIN_TOKEN} bytes long, got {0}")]
    TooShort(usize),
    /// More than [`MAX_TOKEN`] bytes.
    #[error("must be at most {MAX_TOKEN} bytes long, got {0}")]
    TooLong(usize),
    /// A space, a control character, or a character beyond ASCII.
    #[error("must be printable ASCII without spaces")]
    Unprintable,
}

impl Token {
    /// Converts a text to a token.
    ///
    /// # Errors
    /// [`TokenError`] if it is not valid.
    pub fn new(text: &str) -> Result<Self, TokenError> {
        if !text.bytes().all(|byte| byte.is_ascii_graphic()) {
            Err(TokenError::Unprintable)
        } else if text.len() < MIN_TOKEN {
            Err(TokenError::TooShort(text.len()))
        } else if text.len() > MAX_TOKEN {
            Err(TokenError::TooLong(text.len()))
        } else {
            Ok(Self(text.into()))
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
    fn only_the_token_itself_matches() {
        let token = Token::new("correct-horse-battery").unwrap();
        assert!(token.matches("correct-horse-battery"));
        for other in [
            "",
            "correct-horse-batter",
            "correct-horse-battery ",
            "Correct-horse-battery",
            "x",
        ] {
            assert!(!token.matches(other), "{other:?}");
        }
    }

    #[test]
    fn a_token_is_printable_and_of_bounded_length() {
        assert_eq!(Token::new(""), Err(TokenError::TooShort(0)));
        let short = "x".repeat(MIN_TOKEN);
        assert!(Token::new(&short).is_ok());
        let error = TokenError::TooShort(MIN_TOKEN - 1);
        assert_eq!(Token::new(&short[1..]), Err(error));
        let long = "x".repeat(MAX_TOKEN + 1);
        assert_eq!(Token::new(&long), Err(TokenError::TooLong(MAX_TOKEN + 1)));
        assert!(Token::new(&long[1..]).is_ok());
        for text in [" ", "\n", "é", "\u{7f}"] {
            let text = format!("correct-horse{text}battery");
            assert_eq!(Token::new(&text), Err(TokenError::Unprintable));
        }
    }

    #[test]
    fn a_token_is_not_shown() {
        let token = Token::new("correct-horse-battery").unwrap();
        assert_eq!(format!("{token:?}"), "Token(…)");
        assert_eq!(
            token.reveal(),
            "correct-horse-battery",
            "but where it is asked for"
        );
    }
}
