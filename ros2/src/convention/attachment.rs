//! The 33 bytes that every message, request and response has besides its payload.
//!
//! **Invariant:** the layout is that of `rmw_zenoh` since April 2025. ROS 2 drops a message without it.

use std::time::{SystemTime, UNIX_EPOCH};

/// Bytes of an endpoint's id.
pub const GID: usize = 16;
/// Bytes of an attachment: two numbers of 8, the length of the id, the id.
const LENGTH: usize = 8 + 8 + 1 + GID;

/// The identification of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Attachment {
    /// The message's number, from 1.
    pub sequence: i64,
    /// The time of sending, in nanoseconds since 1970.
    pub sent: i64,
    /// The id of the sender or the caller.
    pub gid: [u8; GID],
}

impl Attachment {
    /// The attachment of a message that is sent now.
    #[must_use]
    pub fn now(sequence: i64, gid: [u8; GID]) -> Self {
        let since = SystemTime::now().duration_since(UNIX_EPOCH);
        let sent = since.map_or(0, |since| {
            i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
        });
        Self {
            sequence,
            sent,
            gid,
        }
    }

    /// Its bytes.
    #[must_use]
    pub fn bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(LENGTH);
        bytes.extend_from_slice(&self.sequence.to_le_bytes());
        bytes.extend_from_slice(&self.sent.to_le_bytes());
        bytes.push(16);
        bytes.extend_from_slice(&self.gid);
        bytes
    }

    /// The attachment in these bytes, if they are valid.
    #[must_use]
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let (sequence, rest) = bytes.split_first_chunk()?;
        let (sent, rest) = rest.split_first_chunk()?;
        let (length, gid) = rest.split_first()?;
        Some(Self {
            sequence: i64::from_le_bytes(*sequence),
            sent: i64::from_le_bytes(*sent),
            gid: gid.try_into().ok().filter(|_| *length == 16)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_attachment_is_33_bytes_and_is_read_back() {
        let one = Attachment {
            sequence: 1,
            sent: 0x0102,
            gid: [7; GID],
        };
        let mut expected = vec![1, 0, 0, 0, 0, 0, 0, 0, 2, 1, 0, 0, 0, 0, 0, 0, 16];
        expected.extend([7; GID]);
        assert_eq!(one.bytes(), expected);
        assert_eq!(Attachment::read(&expected), Some(one));
    }

    #[test]
    fn other_bytes_are_no_attachment() {
        let bytes = Attachment::now(1, [0; GID]).bytes();
        for length in 0..bytes.len() {
            assert_eq!(Attachment::read(&bytes[..length]), None, "{length}");
        }
        let mut longer = bytes.clone();
        longer.push(0);
        assert_eq!(Attachment::read(&longer), None);
        let mut other = bytes;
        other[16] = 15;
        assert_eq!(Attachment::read(&other), None);
    }
}
