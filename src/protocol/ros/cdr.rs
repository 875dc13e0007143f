//! Messages in the encoding of ROS 2: CDR, little-endian, converted from JSON by their type.
//!
//! A field that is absent or of another type becomes zero, and so does a whole number that does not fit. But a float of
//! another type becomes NaN, also if it is `null`: a zero would be a valid value.
//!
//! **Invariant:** the offset of every primitive is a multiple of its size, counted from the end of the 4-byte
//! header.

use std::str::FromStr;

use serde_json::Value;
use serde_json::value::{RawValue, to_raw_value};

use super::sink::Sink;
use super::stamps::members;
use crate::protocol::catalog::types;
use crate::protocol::catalog::types::{Count, Type};
use crate::protocol::wire::json;

/// Little-endian, without options.
const HEADER: [u8; 4] = [0, 1, 0, 0];

/// The bytes of a message of that type.
#[must_use]
pub fn encode(one: Type, msg: &Value) -> Vec<u8> {
    let msg = to_raw_value(msg).unwrap_or_default();
    // No message has more bytes than that.
    encode_within(one, &msg, usize::MAX).unwrap_or_default()
}

/// The bytes of a message, unless there are more than `most`. Two bytes of JSON (`{}`) may become a hundred. `None`
/// also if a string is not valid text.
#[must_use]
pub fn encode_within(one: Type, msg: &RawValue, most: usize) -> Option<Vec<u8>> {
    let mut writer = CdrWriter(Sink::new(most));
    writer.0.extend(&HEADER);
    writer.message(one, Some(msg));
    writer.0.finish()
}

/// The type of that name, if it is a message. Such a name begins with a package.
pub(super) fn message_type(kind: &str) -> Option<Type> {
    kind.contains('/').then(|| types::find(kind)).flatten()
}

/// The whole number in a value; 0 if there is none, or if it does not fit.
fn whole<T: FromStr + Default>(value: Option<&RawValue>) -> T {
    let number = value.and_then(|value| value.get().parse().ok());
    number.unwrap_or_default()
}

/// Writes a message.
struct CdrWriter(Sink);

impl CdrWriter {
    fn message(&mut self, one: Type, msg: Option<&RawValue>) {
        let members = msg.and_then(|msg| members(one, msg)).unwrap_or_default();
        let members = members.into_iter().map(|[own, ros1]| own.or(ros1));
        let members = members.chain(std::iter::repeat(None));
        for (field, value) in one.fields.iter().zip(members) {
            let (kind, count) = field.element();
            // The type is looked up once for all entries.
            let inner = message_type(kind);
            match count {
                Count::One => self.single(kind, inner, value),
                Count::Any => {
                    let count = value.and_then(|value| json::entries(value, 0));
                    self.count(count.map_or(0, |entries| entries.count));
                    let single = |entry| self.single(kind, inner, Some(entry));
                    value.and_then(|value| json::for_each(value, single));
                }
                // No count is written, because the type gives it.
                Count::Exactly(count) => {
                    let entries = value.and_then(|value| json::entries(value, count));
                    let mut entries = entries.unwrap_or_default().first.into_iter();
                    for _ in 0..count {
                        self.single(kind, inner, entries.next());
                    }
                }
            }
        }
    }

    #[allow(
        clippy::cast_possible_truncation,
        reason = "a float32 is the nearest one"
    )]
    fn single(&mut self, kind: &str, inner: Option<Type>, value: Option<&RawValue>) {
        if self.0.is_over() {
            return;
        }
        let float = || value.map_or(0.0, |value| json::number(value).unwrap_or(f64::NAN));
        match kind {
            "bool" => self.aligned([u8::from(value.and_then(json::boolean) == Some(true))]),
            "byte" | "uint8" | "char" => self.aligned(whole::<u8>(value).to_le_bytes()),
            "int8" => self.aligned(whole::<i8>(value).to_le_bytes()),
            "uint16" => self.aligned(whole::<u16>(value).to_le_bytes()),
            "int32" => self.aligned(whole::<i32>(value).to_le_bytes()),
            "uint32" => self.aligned(whole::<u32>(value).to_le_bytes()),
            "int64" => self.aligned(whole::<i64>(value).to_le_bytes()),
            "uint64" => self.aligned(whole::<u64>(value).to_le_bytes()),
            "float32" => self.aligned((float() as f32).to_le_bytes()),
            "float64" => self.aligned(float().to_le_bytes()),
            "string" => match value.filter(|value| value.get().starts_with('"')) {
                None => self.string(""),
                Some(value) => match json::text(value) {
                    Some(text) => self.string(&text),
                    None => self.0.fail(),
                },
            },
            other => match inner {
                // No type contains itself, so this recursion ends.
                Some(one) => self.message(one, value),
                None => debug_assert!(false, "{other} is not a type that this writes"),
            },
        }
    }

    /// Writes a primitive at a multiple of its size.
    fn aligned<const SIZE: usize>(&mut self, bytes: [u8; SIZE]) {
        self.0.align(HEADER.len(), SIZE);
        self.0.extend(&bytes);
    }

    fn count(&mut self, count: usize) {
        self.aligned(u32::try_from(count).unwrap_or(u32::MAX).to_le_bytes());
    }

    /// The length including the final NUL, the text, the NUL.
    fn string(&mut self, text: &str) {
        self.count(text.len() + 1);
        self.0.extend(text.as_bytes());
        self.0.push(0);
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// Encoded by hand: seconds and nanoseconds, a string of 5 + 1 bytes, then a sequence. Its count is aligned to 4
    /// and its numbers to 8.
    #[test]
    fn a_joint_state_is_written_as_the_rules_say() {
        let one = types::find("sensor_msgs/msg/JointState").unwrap();
        let msg = json!({"header": {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": "world"},
            "name": ["j"], "position": [1.0], "velocity": [null], "effort": []});
        let mut expected = vec![0, 1, 0, 0];
        expected.extend([1, 0, 0, 0, 2, 0, 0, 0]);
        expected.extend([6, 0, 0, 0]);
        expected.extend(b"world\0");
        expected.extend([0, 0]); // 18 to 20
        expected.extend([1, 0, 0, 0, 2, 0, 0, 0]);
        expected.extend(b"j\0");
        expected.extend([0, 0]); // 30 to 32
        expected.extend([1, 0, 0, 0, 0, 0, 0, 0]); // the count, and 36 to 40
        expected.extend(1.0_f64.to_le_bytes());
        expected.extend([1, 0, 0, 0, 0, 0, 0, 0]);
        expected.extend(f64::NAN.to_le_bytes());
        expected.extend([0, 0, 0, 0]);
        assert_eq!(encode(one, &msg), expected);
    }

    /// Encoded by hand: no count before the 16 bytes, and a signed byte after them.
    #[test]
    fn an_array_of_a_fixed_length_has_no_count() {
        let one = types::find("action_msgs/msg/GoalStatus").unwrap();
        let uuid: Vec<u8> = (1..=16).collect();
        let info = json!({"goal_id": {"uuid": uuid}, "stamp": {"sec": 3, "nanosec": 4}});
        let msg = json!({"goal_info": info, "status": -1});
        let expected = [&HEADER[..], &uuid, &[3, 0, 0, 0, 4, 0, 0, 0, 255]].concat();
        assert_eq!(encode(one, &msg), expected);
        let cut = json!({"goal_info": {"goal_id": {"uuid": [7]}}});
        assert_eq!(encode(one, &cut)[4..8], [7, 0, 0, 0], "absent fields are 0");
    }

    #[test]
    fn an_absent_or_mistyped_member_is_zero_but_a_mistyped_float_is_not_a_number() {
        let one = types::find("std_msgs/msg/Header").unwrap();
        let zeros = [0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0];
        assert_eq!(encode(one, &json!({})), zeros);
        assert_eq!(encode(one, &json!({"stamp": 5, "frame_id": []})), zeros);
        assert_eq!(encode(one, &json!("no message")), zeros);
        let one = types::find("geometry_msgs/msg/Vector3").unwrap();
        let expected = |x: f64| [&HEADER[..], &x.to_le_bytes(), &[0; 16]].concat();
        assert_eq!(encode(one, &json!({"x": "far"})), expected(f64::NAN));
        assert_eq!(encode(one, &json!(null)), expected(0.0));
    }
}
