//! Bytes into a request: the head of HTTP/1, and what of it anybody asks for.
//!
//! **Invariant:** a head is read once it is complete and at most [`MAX_HEAD`] bytes long; nothing behind it is looked
//! at.

use std::borrow::Cow;

/// Longest head in bytes, the blank line included: a browser's has under 2 KiB.
pub const MAX_HEAD: usize = 16 * 1024;
/// Header lines in one head.
const MAX_HEADERS: usize = 64;

/// A request, without a body.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RequestHead {
    /// The path before the `?`; begins with a slash.
    pub path: String,
    /// The query behind it.
    query: Option<String>,
    /// HTTP/1.1, not 1.0.
    pub is_http_1_1: bool,
    /// Names in lower case; values as they came, what is not UTF-8 replaced.
    headers: Vec<(String, String)>,
}

/// Why bytes are no request that is answered.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum HeadError {
    /// Not HTTP/1 as it has to be.
    #[error("this is not a well-formed HTTP request: {0}")]
    Malformed(&'static str),
    /// More than [`MAX_HEAD`] bytes, or too many lines.
    #[error(
        "the head of a request may have at most {MAX_HEAD} bytes and {MAX_HEADERS} header lines"
    )]
    TooLong,
    /// Any method but GET.
    #[error("only GET is answered here")]
    Method,
}

/// End of the head, blank line included, if it is there; `seen` bytes were searched before. A line ends with or without
/// a carriage return (RFC 9112, section 2.2), as it does for who reads the head.
#[must_use]
pub fn end(bytes: &[u8], seen: usize) -> Option<usize> {
    let from = seen.saturating_sub(2);
    let rest = bytes.get(from..)?;
    let after = |mark: &[u8]| {
        let at = rest.windows(mark.len()).position(|window| window == mark);
        at.map(|at| from + at + mark.len())
    };
    match (after(b"\n\r\n"), after(b"\n\n")) {
        (Some(one), Some(other)) => Some(one.min(other)),
        (one, other) => one.or(other),
    }
}

impl RequestHead {
    /// Reads a complete head.
    ///
    /// # Errors
    /// [`HeadError`] if it is not one of ours to answer.
    pub fn parse(head: &[u8]) -> Result<Self, HeadError> {
        let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
        let mut parsed = httparse::Request::new(&mut headers);
        match parsed.parse(head) {
            Ok(status) if status.is_complete() => {}
            Ok(_) => return Err(HeadError::Malformed("it ends too early")),
            Err(httparse::Error::TooManyHeaders) => return Err(HeadError::TooLong),
            Err(error) => return Err(HeadError::Malformed(complaint(error))),
        }
        if parsed.method != Some("GET") {
            return Err(HeadError::Method);
        }
        let target = parsed.path.filter(|target| target.starts_with('/'));
        let target = target.ok_or(HeadError::Malformed("its target must begin with a slash"))?;
        let (path, query) = match target.split_once('?') {
            Some((path, query)) => (path, Some(query.to_owned())),
            None => (target, None),
        };
        let headers = parsed.headers.iter().map(|header| {
            let value = String::from_utf8_lossy(header.value).into_owned();
            (header.name.to_ascii_lowercase(), value)
        });
        Ok(Self {
            path: path.to_owned(),
            query,
            is_http_1_1: parsed.version == Some(1),
            headers: headers.collect(),
        })
    }

    /// The values of all header lines of that name, given in lower case.
    fn all<'a, 'n>(&'a self, name: &'n str) -> impl Iterator<Item = &'a str> + use<'a, 'n> {
        let named = self.headers.iter().filter(move |(one, _)| one == name);
        named.map(|(_, value)| value.as_str())
    }

    /// How many header lines have that name.
    #[must_use]
    pub fn count(&self, name: &str) -> usize {
        self.all(name).count()
    }

    /// The value of the one header line of that name; `None` if there is none, or more than one.
    #[must_use]
    pub fn one(&self, name: &str) -> Option<&str> {
        let mut values = self.all(name);
        let first = values.next()?;
        values.next().is_none().then_some(first)
    }

    /// Whether a header that lists words has that word, in any case.
    #[must_use]
    pub fn has_word(&self, name: &str, word: &str) -> bool {
        self.all(name)
            .flat_map(|value| value.split(','))
            .any(|one| one.trim().eq_ignore_ascii_case(word))
    }

    /// A parameter of the query, decoded.
    #[must_use]
    pub fn query(&self, name: &str) -> Option<Cow<'_, str>> {
        let pairs = self.query.as_deref()?.split('&');
        let mut values = pairs.filter_map(|pair| pair.split_once('='));
        let (_, value) = values.find(|(one, _)| *one == name)?;
        decode(value)
    }

    /// A cookie, decoded.
    #[must_use]
    pub fn cookie(&self, name: &str) -> Option<Cow<'_, str>> {
        let pairs = self.all("cookie").flat_map(|value| value.split(';'));
        let mut values = pairs.filter_map(|pair| pair.trim().split_once('='));
        let (_, value) = values.find(|(one, _)| *one == name)?;
        decode(value)
    }
}

/// Undoes `%` and two digits; `None` where that makes no text.
#[must_use]
pub fn decode(text: &str) -> Option<Cow<'_, str>> {
    if !text.contains('%') {
        return Some(Cow::Borrowed(text));
    }
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((&first, behind)) = rest.split_first() {
        if first != b'%' {
            bytes.push(first);
            rest = behind;
            continue;
        }
        let digits = std::str::from_utf8(behind.get(..2)?).ok()?;
        if !digits.bytes().all(|byte| byte.is_ascii_hexdigit()) {
            return None;
        }
        bytes.push(u8::from_str_radix(digits, 16).ok()?);
        rest = behind.get(2..)?;
    }
    String::from_utf8(bytes).ok().map(Cow::Owned)
}

/// Names the fault in our words.
const fn complaint(error: httparse::Error) -> &'static str {
    match error {
        httparse::Error::HeaderName => "a header's name has a character that it may not have",
        httparse::Error::HeaderValue => "a header's value has a character that it may not have",
        httparse::Error::NewLine => "a line does not end as it has to",
        httparse::Error::Version => "its version is not 1.0 or 1.1",
        httparse::Error::Token => "its first line has a character that it may not have",
        _ => "it cannot be read",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(head: &str) -> Result<RequestHead, HeadError> {
        RequestHead::parse(head.as_bytes())
    }

    #[test]
    fn the_end_of_a_head_is_found_however_it_is_cut() {
        let head = b"GET / HTTP/1.1\r\nHost: a\r\n\r\nbody\r\n\r\n";
        for cut in 0..head.len() {
            let found = end(&head[..cut], 0).or_else(|| end(head, cut));
            assert_eq!(found, Some(27), "{cut}");
        }
        assert_eq!(end(b"GET / HTTP/1.1\n\nx", 0), Some(16));
        assert_eq!(end(b"GET / HTTP/1.1\n\r\nUpgrade: x\r\n\r\n", 0), Some(17));
        assert_eq!(end(b"GET / HTTP/1.1\r\n", 0), None);
        assert_eq!(end(b"", 0), None);
    }

    #[test]
    fn a_request_is_taken_apart() {
        let text = "GET /a/b?x=1&token=a%2Bb HTTP/1.1\r\nHost: h\r\n\
                    COOKIE: a=1; b=%20x\r\nConnection: keep-alive, Upgrade\r\n\r\n";
        let request = request(text).unwrap();
        assert_eq!(request.path, "/a/b");
        assert_eq!(request.query("token").as_deref(), Some("a+b"));
        assert_eq!(request.query("y"), None);
        assert_eq!(request.cookie("b").as_deref(), Some(" x"));
        assert_eq!(request.one("host"), Some("h"));
        assert!(request.has_word("connection", "upgrade"));
        assert!(request.is_http_1_1);
    }

    #[test]
    fn a_header_given_twice_is_not_one() {
        let request = request("GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n").unwrap();
        assert_eq!((request.one("host"), request.count("host")), (None, 2));
    }

    #[test]
    fn what_is_no_request_is_refused() {
        for text in [
            "GET /\r\n\r\n",
            "GET / HTTP/2.0\r\n\r\n",
            "GET / HTTP/1.1\r\nno colon\r\n\r\n",
            "GET / HTTP/1.1\r\n a: folded\r\n\r\n",
            "GET / HTTP/1.1\r\nna me: x\r\n\r\n",
            "GET / HTTP/1.1\r\na: \x01\r\n\r\n",
            "GET http://a/ HTTP/1.1\r\n\r\n",
            "GET * HTTP/1.1\r\n\r\n",
            "GET  / HTTP/1.1\r\n\r\n",
        ] {
            assert!(
                matches!(request(text), Err(HeadError::Malformed(_))),
                "{text:?}"
            );
        }
        assert_eq!(request("PUT / HTTP/1.1\r\n\r\n"), Err(HeadError::Method));
        let many = format!(
            "GET / HTTP/1.1\r\n{}\r\n",
            "a: b\r\n".repeat(MAX_HEADERS + 1)
        );
        assert_eq!(request(&many), Err(HeadError::TooLong));
    }

    #[test]
    fn only_whole_escapes_are_decoded() {
        assert_eq!(decode("a%41%2f").as_deref(), Some("aA/"));
        for text in ["%", "%4", "%4g", "%+1", "%ff"] {
            assert_eq!(decode(text), None, "{text}");
        }
    }
}
