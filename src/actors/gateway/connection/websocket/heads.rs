//! The heads of a WebSocket's frames, followed in the bytes that come: they say how much of a frame there is at most.
//!
//! **Invariant:** the state after a byte depends on the bytes so far, not on how they were cut up.

/// The longest head: two bytes, eight of length and four of the mask.
const LONGEST_HEAD: usize = 14;

/// Follows the frames. Source: RFC 6455, section 5.2.
#[derive(Debug, Default)]
pub(super) struct FrameHeads {
    /// The head that is coming, as far as it has come.
    head: [u8; LONGEST_HEAD],
    come: usize,
    /// Bytes of the frame's payload that have come, and those that are still to come.
    received: u64,
    left: u64,
    /// Whether a further frame belongs to the message: its last has not come.
    goes_on: bool,
}

impl FrameHeads {
    /// Follows more bytes. Returns the longest part of one frame's payload that is there so far.
    pub(super) fn follow(&mut self, mut bytes: &[u8]) -> u64 {
        let mut longest = 0;
        loop {
            let here = self.left.min(bytes.len() as u64);
            self.received += here;
            self.left -= here;
            longest = longest.max(self.received);
            bytes = usize::try_from(here)
                .ok()
                .and_then(|here| bytes.get(here..))
                .unwrap_or_default();
            let Some((&byte, behind)) = bytes.split_first() else {
                return longest;
            };
            if let Some(place) = self.head.get_mut(self.come) {
                *place = byte;
            }
            self.come += 1;
            bytes = behind;
            if let Some(length) = self.length() {
                (self.come, self.received, self.left) = (0, 0, length);
                let [first, ..] = self.head;
                let is_control = first & 0x08 != 0;
                if !is_control {
                    self.goes_on = first & 0x80 == 0;
                }
            }
        }
    }

    /// Whether something has begun that is not complete: a frame, or a message of several.
    pub(super) const fn is_within(&self) -> bool {
        self.come > 0 || self.left > 0 || self.goes_on
    }

    /// The length of the payload, once all of the head has come.
    fn length(&self) -> Option<u64> {
        let [_, second, long @ ..] = self.head;
        let more = match second & 0x7f {
            127 => 8,
            126 => 2,
            _ => 0,
        };
        let mask = if second & 0x80 == 0 { 0 } else { 4 };
        if self.come < 2 + more + mask {
            return None;
        }
        let length = long
            .iter()
            .take(more)
            .fold(0, |length: u64, &byte| length << 8 | u64::from(byte));
        Some(if more == 0 {
            u64::from(second & 0x7f)
        } else {
            length
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(length: usize, is_masked: bool) -> Vec<u8> {
        let mask = if is_masked { 0x80 } else { 0 };
        let long = (length as u64).to_be_bytes();
        let mut bytes = vec![0x81];
        match length {
            0..126 => bytes.push(mask | long[7]),
            126..65536 => {
                bytes.push(mask | 126);
                bytes.extend(&long[6..]);
            }
            _ => {
                bytes.push(mask | 127);
                bytes.extend(long);
            }
        }
        // Bytes that would be heads of long frames, if they were taken for heads.
        bytes.resize(bytes.len() + length + usize::from(is_masked) * 4, 0xff);
        bytes
    }

    #[test]
    fn the_longest_payload_is_found_however_the_bytes_are_cut_up() {
        let lengths = [3, 0, 125, 126, 70_000, 1, 65_535, 65_536, 2];
        let all: Vec<u8> = lengths
            .iter()
            .enumerate()
            .flat_map(|(at, &length)| frame(length, at % 2 == 0))
            .collect();
        for size in [1, 2, 3, 7, 1000, all.len()] {
            let mut heads = FrameHeads::default();
            let longest = all.chunks(size).map(|bytes| heads.follow(bytes)).max();
            assert_eq!(longest, Some(70_000), "in pieces of {size}");
        }
    }

    #[test]
    fn of_a_frame_that_has_begun_counts_only_what_is_there() {
        let mut heads = FrameHeads::default();
        assert_eq!(heads.follow(&frame(70_000, true)[..50_014]), 50_000);
        assert_eq!(heads.follow(&[0; 10]), 50_010);
    }

    #[test]
    fn a_message_is_complete_with_its_last_frame_and_no_sooner() {
        let mut heads = FrameHeads::default();
        let ping = [0x89, 0x80, 0, 0, 0, 0];
        let (begin, go_on, end) = ([0x01, 1, 7], [0x00, 1, 7], [0x80, 1, 7]);
        for (bytes, is_within) in [
            (&ping[..], false),
            (&begin, true),
            (&ping, true),
            (&go_on, true),
            (&end[..1], true),
            (&end[1..], false),
            (&ping[..3], true),
            (&ping[3..], false),
            (&[0x81, 0], false),
        ] {
            heads.follow(bytes);
            assert_eq!(heads.is_within(), is_within, "{bytes:?}");
        }
    }

    #[test]
    fn no_length_is_too_long() {
        let mut heads = FrameHeads::default();
        let head = [&[0x82, 0xff][..], &[0xff; 12]].concat();
        assert_eq!(heads.follow(&head), 0);
        assert_eq!(heads.follow(&[0; 100]), 100);
    }
}
