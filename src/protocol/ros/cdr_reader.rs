//! Decodes the bytes of [`cdr`](super::cdr) to JSON, by the message's type.
//!
//! **Invariant:** bytes that do not match the type are refused. The allocated memory is at most a fixed multiple
//! of their length.

use serde_json::{Map, Value};

use super::cdr::message_type;
use crate::protocol::catalog::types::{Count, Type};

/// Bytes of the header before a message.
const HEADER: usize = 4;
/// The second byte of little-endian plain CDR; the first is 0.
const LITTLE_ENDIAN: u8 = 1;

/// Why bytes are not a message of a type.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum CdrError {
    /// Another encoding, or too few bytes for a header.
    #[error("not little-endian plain CDR")]
    Header,
    /// The bytes end within the message.
    #[error("the message ends at byte {0}")]
    Short(
        /// The number of bytes.
        usize,
    ),
    /// A text that is not UTF-8, or has no NUL after it.
    #[error("no text at byte {0}")]
    Text(
        /// Position of its first byte.
        usize,
    ),
    /// An unknown type.
    #[error("no type {0}")]
    Type(
        /// Its name.
        &'static str,
    ),
}

/// A message of that type. A number that is not finite becomes `null`.
///
/// # Errors
/// If the bytes do not begin with such a message.
pub fn decode(one: Type, bytes: &[u8]) -> Result<Value, CdrError> {
    if bytes.get(..2) != Some(&[0, LITTLE_ENDIAN]) {
        return Err(CdrError::Header);
    }
    let body = bytes.get(HEADER..).ok_or(CdrError::Header)?;
    CdrReader { body, at: 0 }.message(one)
}

struct CdrReader<'a> {
    body: &'a [u8],
    at: usize,
}

impl<'a> CdrReader<'a> {
    fn message(&mut self, one: Type) -> Result<Value, CdrError> {
        let mut members = Map::new();
        for field in one.fields {
            let (kind, count) = field.element();
            let inner = message_type(kind);
            let value = match count {
                Count::One => self.single(kind, inner)?,
                Count::Any => {
                    let count = u32::from_le_bytes(self.aligned()?);
                    // Each entry has at least one byte, so a false count ends with the bytes.
                    let entries = (0..count).map(|_| self.single(kind, inner));
                    Value::Array(entries.collect::<Result<_, _>>()?)
                }
                Count::Exactly(count) => {
                    let entries = (0..count).map(|_| self.single(kind, inner));
                    Value::Array(entries.collect::<Result<_, _>>()?)
                }
            };
            members.insert(field.name.to_owned(), value);
        }
        Ok(Value::Object(members))
    }

    fn single(&mut self, kind: &'static str, inner: Option<Type>) -> Result<Value, CdrError> {
        Ok(match kind {
            "bool" => (u8::from_le_bytes(self.aligned()?) != 0).into(),
            "byte" | "uint8" | "char" => u8::from_le_bytes(self.aligned()?).into(),
            "int8" => i8::from_le_bytes(self.aligned()?).into(),
            "uint16" => u16::from_le_bytes(self.aligned()?).into(),
            "int32" => i32::from_le_bytes(self.aligned()?).into(),
            "uint32" => u32::from_le_bytes(self.aligned()?).into(),
            "int64" => i64::from_le_bytes(self.aligned()?).into(),
            "uint64" => u64::from_le_bytes(self.aligned()?).into(),
            "float32" => f32::from_le_bytes(self.aligned()?).into(),
            "float64" => f64::from_le_bytes(self.aligned()?).into(),
            "string" => self.text()?.into(),
            other => self.message(inner.ok_or(CdrError::Type(other))?)?,
        })
    }

    /// A primitive at a multiple of its size.
    fn aligned<const SIZE: usize>(&mut self) -> Result<[u8; SIZE], CdrError> {
        let start = self.at.next_multiple_of(SIZE);
        let bytes = self.body.get(start..).and_then(<[u8]>::first_chunk);
        self.at = start + SIZE;
        bytes.copied().ok_or(self.short())
    }

    /// The length including the final NUL, the text, the NUL.
    fn text(&mut self) -> Result<&'a str, CdrError> {
        let length = u32::from_le_bytes(self.aligned()?);
        let start = self.at;
        let rest = self.body.get(start..).unwrap_or_default();
        let length = usize::try_from(length).unwrap_or(usize::MAX);
        let bytes = rest.get(..length).ok_or(self.short())?;
        self.at += length;
        let text = bytes.strip_suffix(&[0]).ok_or(CdrError::Text(start))?;
        std::str::from_utf8(text).map_err(|_| CdrError::Text(start))
    }

    fn short(&self) -> CdrError {
        CdrError::Short(HEADER + self.body.len())
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::protocol::catalog::types;
    use crate::protocol::ros::cdr;

    fn joint_state() -> (Type, Value) {
        let one = types::find("sensor_msgs/msg/JointState").unwrap();
        let msg = json!({"header": {"stamp": {"sec": -1, "nanosec": 2}, "frame_id": "world"},
            "name": ["j", "joint2"], "position": [0.1, -0.0], "velocity": [1e-308, 1.0 / 3.0], "effort": []});
        (one, msg)
    }

    #[test]
    fn written_records_are_read_back_bit_for_bit() {
        let (one, msg) = joint_state();
        let bytes = cdr::encode(one, &msg);
        let read = decode(one, &bytes).unwrap();
        assert_eq!(read, msg);
        assert_eq!(cdr::encode(one, &read), bytes);
        assert!(read["position"][1].as_f64().unwrap().is_sign_negative());
        let one = types::find("action_msgs/msg/GoalStatusArray").unwrap();
        let info = json!({"goal_id": {"uuid": (0..16).collect::<Vec<_>>()}, "stamp": {"sec": 1, "nanosec": 2}});
        let msg = json!({"status_list": [{"goal_info": info, "status": -4}, {"goal_info": info, "status": 5}]});
        assert_eq!(decode(one, &cdr::encode(one, &msg)).unwrap(), msg);
        let one = types::find("control_msgs/msg/JointComponentTolerance").unwrap();
        let msg = json!({"joint_name": "joint1", "component": 65_535, "position": 1.5, "velocity": -1.0,
            "acceleration": 0.0});
        assert_eq!(decode(one, &cdr::encode(one, &msg)).unwrap(), msg);
        let one = types::find("diagnostic_msgs/msg/DiagnosticArray").unwrap();
        let msg = json!({"header": {"stamp": {"sec": 3, "nanosec": 0}, "frame_id": ""}, "status": [{"level": 2,
            "name": "\u{e9}", "message": "", "hardware_id": "", "values": [{"key": "a", "value": "b"}]}]});
        assert_eq!(decode(one, &cdr::encode(one, &msg)).unwrap(), msg);
    }

    #[test]
    fn a_message_that_was_cut_is_refused_wherever_that_is() {
        let (one, msg) = joint_state();
        let bytes = cdr::encode(one, &msg);
        for length in 0..bytes.len() {
            assert!(decode(one, &bytes[..length]).is_err(), "{length}");
        }
        let length = bytes.len() - 1;
        assert_eq!(
            decode(one, &bytes[..length]),
            Err(CdrError::Short(length)),
            "the length includes that of the header"
        );
    }

    #[test]
    fn a_count_beyond_all_bounds_allocates_nothing() {
        let one = types::find("sensor_msgs/msg/JointState").unwrap();
        let mut bytes = cdr::encode(one, &json!({}));
        // The header's stamp, the empty frame_id with its padding, and the number of names.
        bytes[4 + 16..4 + 20].copy_from_slice(&u32::MAX.to_le_bytes());
        // The first of these names has no space for its NUL.
        assert_eq!(decode(one, &bytes), Err(CdrError::Text(24)));
    }
}
