//! The end of one JSON object: the scan behind the [frame reader](super::frame).
//!
//! **Invariant:** the state after a byte depends on the bytes so far, not on how they were cut up.

use crate::protocol::limits::MAX_NESTING;

const _: () = assert!(MAX_NESTING <= u128::BITS as usize, "one bit per level");

/// The reason why a scan of an object stops.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Event {
    Balanced,
    Newline { in_string: bool },
    Mismatch { opener: char, found: char },
    TooDeep,
}

/// State of the scan in an object: the brackets that are open, and whether it is inside a string.
#[derive(Debug, Clone, Copy)]
pub(super) struct Nesting {
    depth: usize,
    /// One bit per open level, the innermost last: 1 for a bracket, 0 for a brace. Holds [`MAX_NESTING`] levels.
    brackets: u128,
    in_string: bool,
    escaped: bool,
    /// Whether an `N` or an `I` stood outside strings: only then can there be a `NaN` or an `Infinity`.
    pub(super) has_literals: bool,
}

impl Nesting {
    pub(super) const fn new() -> Self {
        Self {
            depth: 0,
            brackets: 0,
            in_string: false,
            escaped: false,
            has_literals: false,
        }
    }

    /// Goes on with `bytes`. Returns how many were scanned, and what stopped the scan: it stops before a newline, and
    /// behind anything else.
    pub(super) fn scan(&mut self, bytes: &[u8]) -> (usize, Option<Event>) {
        let mut at = 0;
        while let Some(&byte) = bytes.get(at) {
            if self.in_string {
                if self.escaped {
                    self.escaped = false;
                    if byte != b'\n' {
                        at += 1;
                        continue;
                    }
                }
                at += plain_in_string(bytes.get(at..).unwrap_or_default());
                match bytes.get(at) {
                    None => break,
                    Some(b'\n') => return (at, Some(Event::Newline { in_string: true })),
                    Some(b'\\') => self.escaped = true,
                    Some(_) => self.in_string = false,
                }
                at += 1;
                continue;
            }
            if byte == b'\n' {
                return (at, Some(Event::Newline { in_string: false }));
            }
            at += 1;
            if let Some(event) = self.structural(byte) {
                return (at, Some(event));
            }
        }
        (bytes.len(), None)
    }

    #[inline]
    fn structural(&mut self, byte: u8) -> Option<Event> {
        match byte {
            b'"' => self.in_string = true,
            b'{' => return self.open(0),
            b'[' => return self.open(1),
            b'}' => return self.close(0),
            b']' => return self.close(1),
            b'N' | b'I' => self.has_literals = true,
            _ => {}
        }
        None
    }

    fn open(&mut self, bracket: u128) -> Option<Event> {
        self.depth += 1;
        if self.depth <= MAX_NESTING {
            self.brackets = (self.brackets << 1) + bracket;
        }
        (self.depth == MAX_NESTING + 1).then_some(Event::TooDeep)
    }

    fn close(&mut self, bracket: u128) -> Option<Event> {
        if self.depth <= MAX_NESTING {
            if self.brackets & 1 != bracket {
                let (opener, found) = if bracket == 1 { ('{', ']') } else { ('[', '}') };
                return Some(Event::Mismatch { opener, found });
            }
            self.brackets >>= 1;
        }
        self.depth -= 1;
        (self.depth == 0).then_some(Event::Balanced)
    }
}

/// How many bytes from the start are plain inside a string: neither its end, nor an escape, nor a newline.
pub(crate) fn plain_in_string(bytes: &[u8]) -> usize {
    /// Most strings are keys and names, and end before a block would pay.
    const SHORT: usize = 16;
    /// Bytes that the compiler compares with a few vector instructions.
    const BLOCK: usize = 32;
    let special = |byte: &u8| matches!(byte, b'"' | b'\\' | b'\n');
    if let Some(end) = bytes.iter().take(SHORT).position(special) {
        return end;
    }
    let blocks = bytes
        .chunks_exact(BLOCK)
        .take_while(|block| !block.iter().fold(false, |any, byte| any | special(byte)))
        .count();
    let plain = blocks * BLOCK;
    let rest = bytes.get(plain..).unwrap_or_default();
    plain + rest.iter().position(special).unwrap_or(rest.len())
}
