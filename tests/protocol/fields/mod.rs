//! Fields are read one by one, and rejected by name.
//!
//! **Invariant:** a message is compared whole: it is what the sender of a request has to go by.

mod requests;
mod values;

use pendularm::protocol::catalog::Service;
use pendularm::protocol::op::Arguments;
use pendularm::protocol::op::fields::Fields;
use serde_json::value::RawValue;

fn args(text: &str) -> Arguments {
    let raw = RawValue::from_string(text.to_owned()).expect("valid JSON");
    if text.starts_with('[') {
        Arguments::Positional(raw.into())
    } else {
        Arguments::Object(raw.into())
    }
}

/// The values that `read` takes from a request, and the status.
fn reading<T>(
    service: Service,
    text: &str,
    read: impl FnOnce(&mut Fields<'_>) -> T,
) -> (T, String) {
    let args = args(text);
    let mut fields = Fields::read(&args, service).expect("arguments that fit");
    let value = read(&mut fields);
    assert_eq!(fields.accepted(), fields.status().is_empty());
    (value, fields.status())
}
