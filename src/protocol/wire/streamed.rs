//! A `service_response` that is written in parts, for answers of many megabytes whose encoder must be able to pause.
//!
//! **Invariant:** the written text is always the beginning of a valid frame, if the caller's parts are JSON.

use bytes::Bytes;

use super::payload::Payload;

/// A response under construction: its head is written, then the caller writes `values`, then it ends.
#[derive(Debug, Default)]
pub struct StreamedResponse {
    text: Vec<u8>,
}

impl StreamedResponse {
    /// Begins the answer to a call of `service` under the caller's `id`.
    #[must_use]
    pub fn new(service: &str, id: Option<&Payload>) -> Self {
        let mut response = Self::default();
        response.raw("{\"op\":\"service_response\",\"service\":");
        response.string(service);
        if let Some(id) = id {
            response.raw(",\"id\":");
            response.raw(id.line());
        }
        response.raw(",\"values\":");
        response
    }

    /// Writes JSON, or a part of it, unchanged.
    pub fn raw(&mut self, json: &str) {
        self.text.extend_from_slice(json.as_bytes());
    }

    /// Writes a number; `null` if it is not finite.
    pub fn number(&mut self, value: f64) {
        // Writing into memory cannot fail, and every f64 has a JSON form.
        let _ = serde_json::to_writer(&mut self.text, &value);
    }

    /// Ends the frame.
    #[must_use]
    pub fn finish(mut self, result: bool, status: &str) -> Bytes {
        self.raw(if result {
            ",\"result\":true,\"status\":"
        } else {
            ",\"result\":false,\"status\":"
        });
        self.string(status);
        self.raw("}\n");
        self.text.shrink_to_fit();
        self.text.into()
    }

    fn string(&mut self, text: &str) {
        let _ = serde_json::to_writer(&mut self.text, text);
    }
}

#[cfg(test)]
mod tests {
    use serde_json::value::RawValue;

    use super::*;
    use crate::protocol::messages;

    #[test]
    fn a_streamed_response_is_the_same_as_one_encoded_at_once() {
        #[derive(serde::Serialize)]
        struct Values {
            positions: [f64; 3],
        }
        let values = Values {
            positions: [0.1, f64::NAN, -2e300],
        };
        let id = Payload::from(RawValue::from_string("[1,\"a\"]".into()).unwrap());
        let mut streamed = StreamedResponse::new("/x\"y", Some(&id));
        streamed.raw("{\"positions\":[");
        for (index, &value) in values.positions.iter().enumerate() {
            if index > 0 {
                streamed.raw(",");
            }
            streamed.number(value);
        }
        streamed.raw("]}");
        assert_eq!(
            streamed.finish(true, ""),
            messages::response("/x\"y", Some(&id), &values, true, "")
        );
    }
}
