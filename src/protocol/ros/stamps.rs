//! Stamps and durations with the member names of ROS 1. They are written for clients that use a topic's ROS 1 type,
//! and read from every client.
//!
//! **Invariant:** the members of ROS 2 do not change, because some clients use the ROS 1 name of a type for ROS 2
//! messages.

use bytes::Bytes;
use serde_json::value::RawValue;

use crate::protocol::catalog::types::Type;
use crate::protocol::names;
use crate::protocol::wire::json;

/// The text of a stamp before and between its two numbers, and the ROS 1 names of the two.
const SECONDS: &[u8] = b"\"sec\":";
const NANOSECONDS: &[u8] = b",\"nanosec\":";

/// Whether `asked` is the ROS 1 name of a ROS 2 type: `std_msgs/Header` for `std_msgs/msg/Header`.
#[must_use]
pub fn is_ros1_name(asked: &str, type_name: &str) -> bool {
    asked != type_name && asked == names::short_type(type_name)
}

/// The members of a message for the fields of its ROS 2 type, in their order. The second of each is the member with the
/// ROS 1 name of seconds or nanoseconds. `None` if the message is not an object.
pub(super) fn members(one: Type, msg: &RawValue) -> Option<Vec<[Option<&RawValue>; 2]>> {
    let names = one.fields.iter().flat_map(|field| match field.name {
        "sec" => ["sec", "secs"],
        "nanosec" => ["nanosec", "nsecs"],
        // The first of equal names counts.
        name => [name, name],
    });
    let names: Vec<&str> = names.collect();
    let mut values = vec![None; names.len()];
    json::members_into(msg.get(), &names, &mut values).ok()?;
    Some(values.as_chunks().0.to_vec())
}

/// A frame of the runtime in which every stamp has `secs` and `nsecs` besides `sec` and `nanosec`. A text cannot
/// look like a stamp, because its quotes are escaped.
#[must_use]
pub fn with_ros1_names(frame: &[u8]) -> Bytes {
    let mut text = Vec::with_capacity(2 * frame.len());
    let mut rest = frame;
    while let Some((end, seconds, nanoseconds)) = next_stamp(rest) {
        let (before, behind) = rest.split_at(end);
        text.extend_from_slice(before);
        text.extend_from_slice(b",\"secs\":");
        text.extend_from_slice(seconds);
        text.extend_from_slice(b",\"nsecs\":");
        text.extend_from_slice(nanoseconds);
        rest = behind;
    }
    text.extend_from_slice(rest);
    text.shrink_to_fit();
    Bytes::from(text)
}

/// The end of the first stamp in `text`, its seconds and its nanoseconds.
fn next_stamp(text: &[u8]) -> Option<(usize, &[u8], &[u8])> {
    let mut from = 0;
    loop {
        let found = text.get(from..)?;
        from += found
            .windows(SECONDS.len())
            .position(|one| one == SECONDS)?
            + SECONDS.len();
        let (seconds, behind) = number(text.get(from..)?);
        let Some(behind) = behind.strip_prefix(NANOSECONDS) else {
            continue;
        };
        let (nanoseconds, behind) = number(behind);
        return Some((text.len() - behind.len(), seconds, nanoseconds));
    }
}

/// The number at the start of a text, and the rest.
fn number(text: &[u8]) -> (&[u8], &[u8]) {
    let is_part = |byte: &u8| byte.is_ascii_digit() || *byte == b'-';
    let end = text.iter().position(|byte| !is_part(byte));
    text.split_at(end.unwrap_or(text.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_stamp_gets_the_names_of_ros_1_beside_its_own() {
        let stamps = |first: &str, second: &str| {
            let text = r#""\"sec\":3,\"nanosec\":4""#;
            format!(r#"{{"a":{{{first}}},"text":{text},"sec":7,"b":{{{second}}}}}"#)
        };
        let frame = stamps(r#""sec":-1,"nanosec":5"#, r#""sec":2,"nanosec":30"#);
        let expected = stamps(
            r#""sec":-1,"nanosec":5,"secs":-1,"nsecs":5"#,
            r#""sec":2,"nanosec":30,"secs":2,"nsecs":30"#,
        );
        assert_eq!(with_ros1_names(frame.as_bytes()), expected.as_bytes());
        for none in [&b""[..], b"{}", b"\"sec\":", b"\"sec\":1,\"nano"] {
            assert_eq!(with_ros1_names(none), none);
        }
    }

    #[test]
    fn the_name_of_ros_1_has_no_middle_part() {
        assert!(is_ros1_name("std_msgs/Header", "std_msgs/msg/Header"));
        assert!(!is_ros1_name("std_msgs/msg/Header", "std_msgs/msg/Header"));
        assert!(!is_ros1_name("std_msgs/String", "std_msgs/msg/Header"));
    }
}
