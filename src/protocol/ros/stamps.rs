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

/// The end of the names of a stamp's two numbers.
const SECONDS: &str = "sec\":";

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
    let frame = String::from_utf8_lossy(frame);
    let mut stamps = frame.split(SECONDS);
    let mut text = String::with_capacity(2 * frame.len());
    text.push_str(stamps.next().unwrap_or_default());
    for behind in stamps {
        let is_part = |character: char| character.is_ascii_digit() || character == '-';
        let end = behind.find(|character| !is_part(character));
        let (number, rest) = behind.split_at(end.unwrap_or(behind.len()));
        let name = match text.as_str() {
            before if before.ends_with("\"nano") => "nsecs",
            before if before.ends_with('"') => "secs",
            _ => {
                text.extend([SECONDS, behind]);
                continue;
            }
        };
        text.extend([SECONDS, number, ",\"", name, "\":", number, rest]);
    }
    text.shrink_to_fit();
    Bytes::from(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_stamp_gets_the_names_of_ros_1_beside_its_own() {
        let stamps = |first: &str, second: &str| {
            let text = r#""\"sec\":3,\"nanosec\":4""#;
            format!(r#"{{"a":{{{first}}},"text":{text},"b":{{{second}}}}}"#)
        };
        let frame = stamps(r#""sec":-1,"nanosec":5"#, r#""nanosec":30,"sec":2"#);
        let expected = stamps(
            r#""sec":-1,"secs":-1,"nanosec":5,"nsecs":5"#,
            r#""nanosec":30,"nsecs":30,"sec":2,"secs":2"#,
        );
        assert_eq!(with_ros1_names(frame.as_bytes()), expected.as_bytes());
        for none in [&b""[..], b"{}", b"{\"second\":1,\"msec\":2}"] {
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
