//! A byte buffer with a limit.
//!
//! **Invariant:** there is a whole result, or none.

/// The bytes so far.
#[derive(Debug)]
pub(super) struct Sink {
    bytes: Vec<u8>,
    most: usize,
    is_over: bool,
}

impl Sink {
    /// An empty sink for at most `most` bytes.
    pub(super) fn new(most: usize) -> Self {
        Self {
            bytes: Vec::with_capacity(most.min(256)),
            most,
            is_over: false,
        }
    }

    pub(super) fn push(&mut self, byte: u8) {
        self.extend(&[byte]);
    }

    pub(super) fn extend(&mut self, bytes: &[u8]) {
        if self.has_space(bytes.len()) {
            self.bytes.extend_from_slice(bytes);
        }
    }

    /// Appends zeros up to a multiple of `size`, counted from `start`.
    pub(super) fn align(&mut self, start: usize, size: usize) {
        let written = self.bytes.len().saturating_sub(start);
        let zeros = written.next_multiple_of(size) - written;
        if self.has_space(zeros) {
            self.bytes.resize(self.bytes.len() + zeros, 0);
        }
    }

    /// Whether there will be no result, so writing can stop.
    pub(super) const fn is_over(&self) -> bool {
        self.is_over
    }

    /// A value cannot be written.
    pub(super) fn fail(&mut self) {
        self.is_over = true;
        self.bytes = Vec::new();
    }

    /// All bytes, without spare capacity; `None` after a failure, or if the limit was exceeded.
    pub(super) fn finish(mut self) -> Option<Vec<u8>> {
        self.bytes.shrink_to_fit();
        (!self.is_over).then_some(self.bytes)
    }

    fn has_space(&mut self, more: usize) -> bool {
        if more > self.most - self.bytes.len() {
            self.fail();
        }
        !self.is_over
    }
}
