//! Writes a record: entries to MCAP, in whole chunks.
//!
//! **Invariant:** the messages of each channel are numbered from 1 in the order of writing.

use std::collections::{BTreeMap, HashMap};
use std::io::{self, Write};

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{McapError, WriteOptions, Writer};
use serde::Deserialize;
use serde::de::Error as _;
use serde_json::value::RawValue;
use serde_json::{Value, json};

use super::schema::{CALL, CALLS, INPUT, INPUTS, STATE, STATES};
use super::{Content, RecordEntry};
use crate::protocol::catalog::types::{self, Type};
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::ros::cdr;
use crate::protocol::ros::rosapi::DISTRO;

/// Length at which a chunk is written without waiting for the next second.
pub const CHUNK_BYTES: u64 = 64 * 1024;

/// This program's version, with its commit if known.
pub(super) const VERSION: &str = env!("PENDULARM_VERSION");
/// The metadata record with facts about the run.
const FACTS: &str = env!("CARGO_PKG_NAME");
/// The channel metadata in which rosbag2 stores the quality of service.
const QOS_KEY: &str = "offered_qos_profiles";

/// Facts about the run besides its inputs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunSettings {
    /// The number of links.
    pub links: usize,
    /// The seed of the targets of timed trials.
    pub seed: u64,
}

/// Why an entry was not recorded.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file cannot be written.
    #[error("the file cannot be written: {0}")]
    File(#[from] io::Error),
    /// The MCAP library refuses.
    #[error("the file cannot be written: {0}")]
    Mcap(McapError),
    /// A frame of the runtime that cannot be read back.
    #[error("a frame cannot be read: {0}")]
    Frame(#[from] serde_json::Error),
}

impl From<McapError> for RecordError {
    fn from(error: McapError) -> Self {
        match error {
            McapError::Io(error) => Self::File(error),
            error => Self::Mcap(error),
        }
    }
}

/// Writes entries into a file.
pub struct McapWriter<W: Write> {
    writer: Writer<NoSeek<W>>,
    channels: HashMap<&'static str, Channel>,
    messages: u64,
    /// The latest time of an entry. An entry of another thread may come after one with a later time.
    latest: u64,
}

struct Channel {
    id: u16,
    sequence: u32,
}

#[derive(Deserialize)]
struct PublishFrame<'a> {
    #[serde(borrow)]
    msg: &'a RawValue,
}

#[derive(Deserialize)]
struct ResponseFrame<'a> {
    #[serde(borrow)]
    id: Option<&'a RawValue>,
    #[serde(borrow)]
    values: &'a RawValue,
    result: bool,
    status: String,
}

impl<W: Write> McapWriter<W> {
    /// Starts a file.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn new(file: W, settings: &RunSettings) -> Result<Self, RecordError> {
        let options = WriteOptions::new()
            .profile("ros2")
            .library(format!("{FACTS} {VERSION}"))
            .compression(None)
            .chunk_size(Some(CHUNK_BYTES))
            // A chunk is kept in memory until it is whole, so the file is always the beginning of a valid one.
            .disable_seeking(true);
        let mut writer = options.create(NoSeek::new(file))?;
        let facts = [
            ("version", VERSION.to_owned()),
            ("links", settings.links.to_string()),
            ("seed", settings.seed.to_string()),
        ];
        // Without this metadata rosbag2 would read the quality of service in the newer format.
        let of_rosbag2 = [
            ("ROS_DISTRO", DISTRO.to_owned()),
            ("serialized_metadata", String::new()),
        ];
        for (name, metadata) in [(FACTS, facts.to_vec()), ("rosbag2", of_rosbag2.to_vec())] {
            let metadata = metadata.into_iter();
            writer.write_metadata(&Metadata {
                name: name.to_owned(),
                metadata: metadata
                    .map(|(key, value)| (key.to_owned(), value))
                    .collect(),
            })?;
        }
        writer.flush()?;
        Ok(Self {
            writer,
            channels: HashMap::new(),
            messages: 0,
            latest: 0,
        })
    }

    /// Writes an entry. Its time is at least that of the entry before.
    ///
    /// # Errors
    /// If the file cannot be written, or the entry is not valid.
    pub fn write(&mut self, entry: &RecordEntry) -> Result<(), RecordError> {
        self.latest = self.latest.max(entry.log_time);
        let at = self.latest;
        match &entry.content {
            Content::Published { topic, frame } => {
                let frame: PublishFrame = serde_json::from_slice(frame)?;
                let Some(one) = types::find(topic.type_name()) else {
                    return Ok(());
                };
                let data = cdr::encode_within(one, frame.msg, usize::MAX);
                let bad_text = || serde_json::Error::custom("a string is not valid text");
                self.put(at, topic.name(), one, &data.ok_or_else(bad_text)?)
            }
            Content::Called {
                client,
                service,
                id,
                args,
            } => {
                let msg = call(*client, *service, id, args, None);
                self.put(at, CALLS, CALL, &cdr::encode(CALL, &msg))
            }
            Content::Answered {
                client,
                service,
                frame,
            } => {
                let frame: ResponseFrame = serde_json::from_slice(frame)?;
                let id = frame.id.map_or("", RawValue::get);
                let answer = Some((frame.result, &*frame.status));
                let msg = call(*client, *service, id, frame.values.get(), answer);
                self.put(at, CALLS, CALL, &cdr::encode(CALL, &msg))
            }
            Content::Input { step, note } => {
                let msg = json!({"step": step, "input": note});
                self.put(at, INPUTS, INPUT, &cdr::encode(INPUT, &msg))
            }
            Content::State {
                step,
                position,
                velocity,
                effort,
            } => {
                let msg = json!({"step": step, "position": position, "velocity": velocity, "effort": effort});
                self.put(at, STATES, STATE, &cdr::encode(STATE, &msg))
            }
        }
    }

    /// Writes everything so far to the file.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn flush(&mut self) -> Result<(), RecordError> {
        Ok(self.writer.flush()?)
    }

    /// Ends the file with an index.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(mut self) -> Result<W, RecordError> {
        self.writer.finish()?;
        let mut file = self.writer.into_inner().into_inner();
        file.flush()?;
        Ok(file)
    }

    /// Messages written so far.
    #[must_use]
    pub fn messages(&self) -> u64 {
        self.messages
    }

    fn put(
        &mut self,
        at: u64,
        topic: &'static str,
        one: Type,
        data: &[u8],
    ) -> Result<(), RecordError> {
        if !self.channels.contains_key(topic) {
            let text = types::definition(one);
            let schema = self
                .writer
                .add_schema(one.name, "ros2msg", text.as_bytes())?;
            let is_latched = Topic::from_name(topic).is_some_and(Topic::is_latched);
            let metadata = BTreeMap::from([(QOS_KEY.to_owned(), qos_profiles(is_latched))]);
            let id = self.writer.add_channel(schema, topic, "cdr", &metadata)?;
            self.channels.insert(topic, Channel { id, sequence: 0 });
        }
        let Some(channel) = self.channels.get_mut(topic) else {
            return Ok(());
        };
        channel.sequence = channel.sequence.wrapping_add(1);
        let header = MessageHeader {
            channel_id: channel.id,
            sequence: channel.sequence,
            log_time: at,
            publish_time: at,
        };
        self.writer.write_to_known_channel(&header, data)?;
        self.messages += 1;
        Ok(())
    }
}

/// The quality of service of a topic, in the format of rosbag2 up to version 8 of its metadata. The
/// numbers are those of `rmw`: keep last, reliable, transient local or volatile, automatic. The times are infinite.
fn qos_profiles(is_latched: bool) -> String {
    let (depth, durability) = if is_latched { (1, 1) } else { (10, 2) };
    let infinite = "\n    sec: 9223372036\n    nsec: 854775807";
    format!(
        "- history: 1\n  depth: {depth}\n  reliability: 1\n  durability: {durability}\n  deadline:{infinite}\n  \
         lifespan:{infinite}\n  liveliness: 1\n  liveliness_lease_duration:{infinite}\n  \
         avoid_ros_namespace_conventions: false"
    )
}

/// A call, or an answer with its result and its status.
fn call(
    client: u64,
    service: Service,
    id: &str,
    content: &str,
    answer: Option<(bool, &str)>,
) -> Value {
    let (result, status) = answer.unwrap_or_default();
    json!({
        "client": client,
        "id": id,
        "service": service.name(),
        "type": service.type_name(),
        "is_answer": answer.is_some(),
        "content": content,
        "result": result,
        "status": status,
    })
}
