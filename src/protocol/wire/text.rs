//! Clients' text in messages of the runtime and in the log: shortened, with control characters escaped.
//!
//! **Invariant:** clients' text in a message of the runtime has a bounded length.

use std::fmt::Write as _;

use serde_json::value::RawValue;

use super::literals::{INFINITY, NAN};

/// Most characters of clients' text in a message: enough to recognise it, and one line on a terminal.
pub(crate) const EXCERPT: usize = 48;

/// At most [`EXCERPT`] characters of `text`, control characters escaped, an ellipsis where something was cut.
pub(crate) fn excerpt(text: &str) -> String {
    shortened(text, EXCERPT)
}

/// At most `limit` characters of `text`, control characters escaped, an ellipsis where something was cut.
pub(crate) fn shortened(text: &str, limit: usize) -> String {
    let mut short = String::with_capacity(text.len().min(limit));
    for (count, character) in text.chars().enumerate() {
        if count == limit {
            short.push('…');
            break;
        }
        push_plain(&mut short, character);
    }
    short
}

/// Whether a character controls a terminal: control characters, and characters that end a line or change the direction
/// of writing. Each has at most four hexadecimal digits.
fn acts(character: char) -> bool {
    let turns = matches!(
        character,
        '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{feff}'
    );
    turns || character.is_control()
}

/// A text with JSON's escapes where a character [acts]. The syntax of JSON has no such character, so each is part of a
/// text.
#[cfg(feature = "runtime")]
pub(crate) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len() + 1);
    for character in text.chars() {
        if acts(character) {
            // Writing to a `String` cannot fail.
            let _ = write!(escaped, "\\u{:04x}", u32::from(character));
        } else {
            escaped.push(character);
        }
    }
    escaped
}

/// Appends a character, escaped where it [acts].
pub(crate) fn push_plain(text: &mut String, character: char) {
    if acts(character) {
        // Writing to a `String` cannot fail.
        let _ = write!(text, "{}", character.escape_default());
    } else {
        text.push(character);
    }
}

/// Describes a JSON value at the end of a sentence: the value itself if it is short, else its kind.
pub(crate) fn found(raw: &RawValue) -> String {
    match raw.get() {
        object if object.starts_with('{') => "an object".to_owned(),
        array if array.starts_with('[') => "an array".to_owned(),
        // The reader has replaced `NaN` and `Infinity` by these.
        NAN => "NaN".to_owned(),
        INFINITY => "Infinity".to_owned(),
        negative if negative.strip_prefix('-') == Some(INFINITY) => "-Infinity".to_owned(),
        _ => excerpt(raw.get()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_escaped_and_printable_ones_are_not() {
        for acting in [
            '\0', '\n', '\r', '\t', '\u{1b}', '\u{7f}', '\u{85}', '\u{9b}', '\u{61c}', '\u{200e}',
            '\u{200f}', '\u{2028}', '\u{2029}', '\u{202a}', '\u{202e}', '\u{2066}', '\u{2069}',
            '\u{feff}',
        ] {
            let mut text = String::new();
            push_plain(&mut text, acting);
            assert_eq!(text, acting.escape_default().to_string());
            assert!(text.is_ascii() && text.starts_with('\\'), "{text}");
            let text = escape(&format!("-{acting}"));
            assert_eq!(text, format!("-\\u{:04x}", u32::from(acting)));
        }
        for plain in [
            ' ',
            'a',
            '~',
            '\\',
            '"',
            '\u{e9}',
            '\u{2027}',
            '\u{202f}',
            '\u{2065}',
            '\u{206a}',
            '\u{1f9be}',
        ] {
            let mut text = String::new();
            push_plain(&mut text, plain);
            assert_eq!(text, plain.to_string());
        }
    }
}
