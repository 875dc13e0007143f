//! Messages in the encoding of ROS 2: CDR, little-endian, converted from JSON by their type.
//!
//! A field that is absent or of another type becomes zero, and so does a whole number that does not fit. A number that
//! is `null` becomes NaN.
//!
//! **Invariant:** the offset of every primitive is a multiple of its size, counted from the end of the 4-byte
//! header.

use serde_json::{Number, Value};

use super::sink::Sink;
use super::stamps::member;
use super::tree::MessageTree;
use crate::protocol::catalog::types;
use crate::protocol::catalog::types::{Count, Type};

/// Little-endian, without options.
const HEADER: [u8; 4] = [0, 1, 0, 0];
/// An absent field: the zero of a number, a text, an array or a message.
static ABSENT: MessageTree<'static> = MessageTree::Bool(false);

/// The bytes of a message of that type.
#[must_use]
pub fn encode(one: Type, msg: &Value) -> Vec<u8> {
    encode_tree(one, &MessageTree::from(msg))
}

/// The bytes of a message that has been parsed already.
#[must_use]
pub fn encode_tree(one: Type, msg: &MessageTree<'_>) -> Vec<u8> {
    // No message has more bytes than that.
    encode_within(one, msg, usize::MAX).unwrap_or_default()
}

/// The bytes of a message, unless there are more than `most`. Two bytes of JSON (`{}`) may become a hundred.
#[must_use]
pub fn encode_within(one: Type, msg: &MessageTree<'_>, most: usize) -> Option<Vec<u8>> {
    let mut sink = Sink::new(most);
    sink.extend(&HEADER);
    sink.message(one, msg);
    sink.finish()
}

/// The type of that name, if it is a message. Such a name begins with a package.
pub(super) fn message_type(kind: &str) -> Option<Type> {
    kind.contains('/').then(|| types::find(kind)).flatten()
}

/// The whole number in a value; 0 if there is none, or if it does not fit.
fn whole<T: TryFrom<i128> + Default>(value: &MessageTree<'_>) -> T {
    let number = value.number().and_then(Number::as_i128);
    let number = number.and_then(|number| T::try_from(number).ok());
    number.unwrap_or_default()
}

impl Sink {
    fn message(&mut self, one: Type, msg: &MessageTree<'_>) {
        for field in one.fields {
            let value = member(msg, field.name).unwrap_or(&ABSENT);
            let (kind, count) = field.element();
            // The type is looked up once for all entries.
            let inner = message_type(kind);
            match count {
                Count::One => self.single(kind, inner, value),
                Count::Any => {
                    let entries = value.entries().unwrap_or_default();
                    self.count(entries.len());
                    for entry in entries {
                        if self.is_over() {
                            return;
                        }
                        self.single(kind, inner, entry);
                    }
                }
                // No count is written, because the type gives it.
                Count::Exactly(count) => {
                    let mut entries = value.entries().into_iter().flatten();
                    for _ in 0..count {
                        self.single(kind, inner, entries.next().unwrap_or(&ABSENT));
                    }
                }
            }
        }
    }

    #[allow(
        clippy::cast_possible_truncation,
        reason = "a float32 is the nearest one"
    )]
    fn single(&mut self, kind: &str, inner: Option<Type>, value: &MessageTree<'_>) {
        let float = || match (value, value.number()) {
            (MessageTree::Null, _) => f64::NAN,
            (_, number) => number.and_then(Number::as_f64).unwrap_or_default(),
        };
        match kind {
            "bool" => self.aligned([u8::from(*value == MessageTree::Bool(true))]),
            "byte" | "uint8" | "char" => self.aligned(whole::<u8>(value).to_le_bytes()),
            "int8" => self.aligned(whole::<i8>(value).to_le_bytes()),
            "uint16" => self.aligned(whole::<u16>(value).to_le_bytes()),
            "int32" => self.aligned(whole::<i32>(value).to_le_bytes()),
            "uint32" => self.aligned(whole::<u32>(value).to_le_bytes()),
            "int64" => self.aligned(whole::<i64>(value).to_le_bytes()),
            "uint64" => self.aligned(whole::<u64>(value).to_le_bytes()),
            "float32" => self.aligned((float() as f32).to_le_bytes()),
            "float64" => self.aligned(float().to_le_bytes()),
            "string" => self.string(match value {
                MessageTree::Text(text) => text,
                _ => "",
            }),
            other => match inner {
                // No type contains itself, so this recursion ends.
                Some(one) => self.message(one, value),
                None => debug_assert!(false, "{other} is not a type that this writes"),
            },
        }
    }

    /// Writes a primitive at a multiple of its size.
    fn aligned<const SIZE: usize>(&mut self, bytes: [u8; SIZE]) {
        self.align(HEADER.len(), SIZE);
        self.extend(&bytes);
    }

    fn count(&mut self, count: usize) {
        self.aligned(u32::try_from(count).unwrap_or(u32::MAX).to_le_bytes());
    }

    /// The length including the final NUL, the text, the NUL.
    fn string(&mut self, text: &str) {
        self.count(text.len() + 1);
        self.extend(text.as_bytes());
        self.push(0);
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
    fn an_absent_or_mistyped_member_is_zero() {
        let one = types::find("std_msgs/msg/Header").unwrap();
        let zeros = [0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0];
        assert_eq!(encode(one, &json!({})), zeros);
        assert_eq!(encode(one, &json!({"stamp": 5, "frame_id": []})), zeros);
        assert_eq!(encode(one, &json!("no message")), zeros);
        let one = types::find("geometry_msgs/msg/Vector3").unwrap();
        let expected = [&HEADER[..], &[0; 24]].concat();
        assert_eq!(encode(one, &json!({"x": "far"})), expected);
        assert_eq!(encode(one, &json!(null)), expected);
    }
}
