//! The requests to the recorder in JSON, and the responses.
//!
//! **Invariant:** a client names a file, never a folder.

use actix::prelude::*;
use bytes::Bytes;
use serde_json::json;

use super::Recorder;
use super::limits::MAX_FILE_NAME;
use super::messages::{NotRecorded, Recorded, StartRecording, StopRecording};
use crate::actors::wire::{Address, Answered, Callable, Nodes};
use crate::protocol::catalog::Service;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Fields, Rejections};

impl<const N: usize> Recorder<N> {
    /// Adds this node's services to the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        nodes.serve::<StartRecording>(Service::RecorderStart, address.clone());
        nodes.serve::<StopRecording>(Service::RecorderStop, address.clone());
    }
}

impl Callable for StartRecording {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let name = fields.text("name").map(std::borrow::Cow::into_owned);
        if name.as_ref().is_some_and(|name| !is_file_name(name)) {
            let rule = format!(
                "must be 1 to {MAX_FILE_NAME} letters, digits, `.`, `-` and `_`, the first one not `.`"
            );
            fields.refuse("name", &rule);
        }
        fields.accept(Self { name })
    }
}

impl Answered for StartRecording {
    fn write(answer: Result<String, NotRecorded>, to: &Address) -> Bytes {
        to.outcome(answer.map(|file| json!({"file": file})))
    }
}

impl Callable for StopRecording {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        Fields::read(arguments, service)?;
        Ok(Self)
    }
}

impl Answered for StopRecording {
    fn write(answer: Result<Recorded, NotRecorded>, to: &Address) -> Bytes {
        to.outcome(answer)
    }
}

/// Whether this is a plain file name on every system.
fn is_file_name(name: &str) -> bool {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'.' | b'-' | b'_');
    (1..=MAX_FILE_NAME).contains(&name.len()) && !name.starts_with('.') && name.bytes().all(plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_that_of_a_file_beside_the_others() {
        let longest = "a".repeat(MAX_FILE_NAME);
        for name in ["run", "Run-2_b.mcap", "7", &longest] {
            assert!(is_file_name(name), "{name}");
        }
        let too_long = "a".repeat(MAX_FILE_NAME + 1);
        for name in [
            "", ".hidden", "../a", "a/b", "a\\b", "a b", "a:b", "\u{e4}", &too_long,
        ] {
            assert!(!is_file_name(name), "{name}");
        }
    }
}
