//! A second reading of the CBOR (RFC 8949, typed arrays of RFC 8746) that the runtime writes, into JSON.
//!
//! A number that is not finite is read as `null`, its form in JSON.

use crate::json::Json;

/// Reads bytes that are one value in shortest heads; `None` for anything else.
#[must_use]
pub fn read(bytes: &[u8]) -> Option<Json> {
    let mut reading = Reading(bytes);
    let value = reading.value()?;
    reading.0.is_empty().then_some(value)
}

struct Reading<'a>(&'a [u8]);

impl Reading<'_> {
    fn take(&mut self, count: usize) -> Option<&[u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn big_endian(&mut self, count: usize) -> Option<u64> {
        let bytes = self.take(count)?;
        Some(
            bytes
                .iter()
                .fold(0, |number, byte| number << 8 | u64::from(*byte)),
        )
    }

    /// The number of a head, in as few bytes as it needs.
    fn argument(&mut self, short: u8) -> Option<u64> {
        let (bytes, least) = match short {
            0..24 => return Some(short.into()),
            24 => (1, 24),
            25 => (2, 0x100),
            26 => (4, 0x1_0000),
            27 => (8, 0x1_0000_0000),
            _ => return None,
        };
        self.big_endian(bytes).filter(|number| *number >= least)
    }

    fn value(&mut self) -> Option<Json> {
        let head = self.take(1)?[0];
        if head == 0xfb {
            return Some(number(f64::from_bits(self.big_endian(8)?)));
        }
        if head >> 5 == 7 {
            return match head {
                0xf4 => Some(Json::Boolean(false)),
                0xf5 => Some(Json::Boolean(true)),
                0xf6 => Some(Json::Null),
                _ => None,
            };
        }
        if head & 31 == 31 {
            return self.marked(head);
        }
        let argument = self.argument(head & 31)?;
        let count = usize::try_from(argument).ok()?;
        match head >> 5 {
            0 => Some(Json::Number(argument.to_string())),
            1 => Some(Json::Number((-1 - i128::from(argument)).to_string())),
            2 => {
                let bytes = self.take(count)?;
                Some(Json::Array(
                    bytes
                        .iter()
                        .map(|byte| Json::Number(byte.to_string()))
                        .collect(),
                ))
            }
            3 => self.text(count).map(|text| Json::Text(Some(text))),
            4 => (0..count)
                .map(|_| self.value())
                .collect::<Option<_>>()
                .map(Json::Array),
            5 => (0..count)
                .map(|_| self.member())
                .collect::<Option<_>>()
                .map(Json::Object),
            _ => self.typed_array(argument),
        }
    }

    /// An array or an object with a mark at its end.
    fn marked(&mut self, head: u8) -> Option<Json> {
        let (mut entries, mut members) = (Vec::new(), Vec::new());
        while *self.0.first()? != 0xff {
            match head >> 5 {
                4 => entries.push(self.value()?),
                5 => members.push(self.member()?),
                _ => return None,
            }
        }
        self.take(1)?;
        Some(if head >> 5 == 4 {
            Json::Array(entries)
        } else {
            Json::Object(members)
        })
    }

    fn text(&mut self, count: usize) -> Option<String> {
        String::from_utf8(self.take(count)?.to_vec()).ok()
    }

    fn member(&mut self) -> Option<(Option<String>, Json)> {
        let Json::Text(key) = self.value()? else {
            return None;
        };
        Some((key, self.value()?))
    }

    fn typed_array(&mut self, tag: u64) -> Option<Json> {
        let head = self.take(1)?[0];
        if head >> 5 != 2 {
            return None;
        }
        let count = usize::try_from(self.argument(head & 31)?).ok()?;
        let bytes = self.take(count)?;
        let entries: Vec<Json> = match tag {
            86 if count % 8 == 0 => {
                let entries = bytes.chunks(8).filter_map(|entry| entry.try_into().ok());
                entries
                    .map(|entry| number(f64::from_le_bytes(entry)))
                    .collect()
            }
            78 if count % 4 == 0 => {
                let entries = bytes.chunks(4).filter_map(|entry| entry.try_into().ok());
                entries
                    .map(|entry| Json::Number(i32::from_le_bytes(entry).to_string()))
                    .collect()
            }
            _ => return None,
        };
        Some(Json::Array(entries))
    }
}

fn number(value: f64) -> Json {
    if value.is_finite() {
        Json::Number(format!("{value:e}"))
    } else {
        Json::Null
    }
}
