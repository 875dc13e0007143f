//! The head of a request, with the parts that the site reads.
//!
//! **Invariant:** a header that may occur once counts as missing if it occurs twice.

use std::borrow::Cow;

use hyper::http::request::Parts;

/// Longest head in bytes, including the blank line. A browser's has less than 2 KiB.
pub const MAX_HEAD: usize = 16 * 1024;
/// Most header lines in one head.
pub const MAX_HEADERS: usize = 64;

/// A parsed head of a request.
#[derive(Debug)]
pub struct RequestHead(pub Parts);

impl RequestHead {
    /// The path before the `?`.
    #[must_use]
    pub fn path(&self) -> &str {
        self.0.uri.path()
    }

    /// The values of all header lines of that name. Bytes that are not UTF-8 are replaced.
    fn all<'a>(&'a self, name: &str) -> impl Iterator<Item = Cow<'a, str>> + use<'a> {
        let values = self.0.headers.get_all(name).into_iter();
        values.map(|value| String::from_utf8_lossy(value.as_bytes()))
    }

    /// The value of the one header line of that name. `None` if there is none, or more than one.
    #[must_use]
    pub fn one(&self, name: &str) -> Option<Cow<'_, str>> {
        let mut values = self.all(name);
        let first = values.next()?;
        values.next().is_none().then_some(first)
    }

    /// Whether a header that lists words has that word, in any case.
    #[must_use]
    pub fn has_word(&self, name: &str, word: &str) -> bool {
        self.all(name).any(|value| {
            let mut words = value.split(',');
            words.any(|one| one.trim().eq_ignore_ascii_case(word))
        })
    }

    /// A parameter of the query, decoded.
    #[must_use]
    pub fn query(&self, name: &str) -> Option<String> {
        value_of(name, self.0.uri.query()?, '&')
    }

    /// A cookie, decoded.
    #[must_use]
    pub fn cookie(&self, name: &str) -> Option<String> {
        let cookies: Vec<_> = self.all("cookie").collect();
        value_of(name, &cookies.join(";"), ';')
    }
}

/// The decoded value of the first pair of that name.
fn value_of(name: &str, pairs: &str, separator: char) -> Option<String> {
    let mut pairs = pairs
        .split(separator)
        .filter_map(|pair| pair.trim().split_once('='));
    let (_, value) = pairs.find(|(one, _)| *one == name)?;
    decode(value)
}

/// Decodes `%` with two digits; `None` if the result is not valid text.
#[must_use]
pub fn decode(text: &str) -> Option<String> {
    let mut parts = text.split('%');
    let mut bytes = parts.next()?.as_bytes().to_vec();
    for part in parts {
        let (digits, rest) = part.split_at_checked(2)?;
        if !digits.bytes().all(|byte| byte.is_ascii_hexdigit()) {
            return None;
        }
        bytes.push(u8::from_str_radix(digits, 16).ok()?);
        bytes.extend_from_slice(rest.as_bytes());
    }
    String::from_utf8(bytes).ok()
}
