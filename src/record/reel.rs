//! A record that can be read from any place, forward and backward.
//!
//! Time here is in nanoseconds since the record's first message. Messages keep the order of the file; a message with an
//! earlier time than the one before counts as simultaneous with that.
//!
//! **Invariant:** one chunk of the file is in memory at a time.

use std::collections::{HashMap, HashSet};
use std::io::{self, Read, Seek, SeekFrom};

use bytes::Bytes;
use mcap::records::{Record, op};
use mcap::sans_io::LinearReaderOptions;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader};
use mcap::{MAGIC, McapError, parse_record, read::ChunkReader};
use serde_json::Value;

use super::reader::{MAX_CHUNK, ReadError, known_type};
use super::schema::{INPUT, INPUTS};
use crate::protocol::catalog::Topic;
use crate::protocol::catalog::types::Type;
use crate::protocol::messages;
use crate::protocol::ros::cdr_reader;

/// Bytes in front of a record: what it is, and its length.
const RECORD_HEAD: u64 = 9;

/// A message on one of the runtime's topics.
#[derive(Debug, Clone, PartialEq)]
pub struct Moment {
    /// Its time, in nanoseconds since the record's beginning.
    pub time: u64,
    /// The topic.
    pub topic: Topic,
    one: Type,
    data: Box<[u8]>,
}

impl Moment {
    fn message(&self) -> Result<Value, ReadError> {
        let topic = || self.topic.name().to_owned();
        cdr_reader::decode(self.one, &self.data).map_err(|why| ReadError::Message {
            topic: topic(),
            why,
        })
    }

    /// The whole `publish` frame, as clients got it.
    ///
    /// # Errors
    /// If the message does not fit its definition.
    pub fn frame(&self) -> Result<Bytes, ReadError> {
        Ok(messages::publish(self.topic.name(), &self.message()?))
    }

    /// The time in a message of `/clock` \[s\]; 0 for any other message.
    ///
    /// # Errors
    /// If the message does not fit its definition.
    pub fn clock_time(&self) -> Result<f64, ReadError> {
        let message = self.message()?;
        let part = |path: &str| message.pointer(path).and_then(Value::as_f64);
        let part = |path: &str| part(path).unwrap_or_default();
        Ok(part("/clock/sec") + 1e-9 * part("/clock/nanosec"))
    }
}

/// A message's place: its chunk, and its number in there.
pub type ReelPlace = (usize, usize);

/// A record, and a place in it.
pub struct Reel<R> {
    file: R,
    chunks: Vec<ChunkPlace>,
    channels: Channels,
    /// Log time of the first message.
    began: u64,
    duration: u64,
    /// Topics that have messages.
    topics: HashSet<Topic>,
    /// Where the messages of latched topics are, and when.
    latched: HashMap<Topic, Vec<(u64, ReelPlace)>>,
    /// The chunk that was read last.
    loaded: Option<(usize, Vec<Moment>)>,
    /// The next message forward.
    next: ReelPlace,
}

/// A chunk in the file.
struct ChunkPlace {
    offset: u64,
    length: usize,
    /// The latest time before it, and with it.
    from: u64,
    to: u64,
}

/// The file's channels, as far as their types are known.
#[derive(Default)]
struct Channels {
    schemas: HashMap<u16, Option<Type>>,
    topics: HashMap<u16, (Topic, Type)>,
    inputs: Option<u16>,
}

impl<R: Read + Seek> Reel<R> {
    /// Goes once through the whole file and remembers where things are. Calls `noted` with each input to the arm and
    /// its time.
    ///
    /// # Errors
    /// If it is no record, or damaged before its end.
    pub fn open(file: R, mut noted: impl FnMut(u64, &str)) -> Result<Self, ReadError> {
        let options = LinearReaderOptions::default()
            .with_emit_chunks(true)
            .with_record_length_limit(MAX_CHUNK);
        let mut reader = LinearReader::new_with_options(options);
        let mut offset = MAGIC.len() as u64;
        let mut reel = Self {
            file,
            chunks: Vec::new(),
            channels: Channels::default(),
            began: 0,
            duration: 0,
            topics: HashSet::new(),
            latched: HashMap::new(),
            loaded: None,
            next: (0, 0),
        };
        loop {
            match reader.next_event() {
                Some(Ok(LinearReadEvent::ReadRequest(need))) => {
                    let read = read_some(&mut reel.file, reader.insert(need))?;
                    reader.notify_read(read);
                }
                Some(Ok(LinearReadEvent::Record { data, opcode })) => {
                    let length = data.len();
                    if opcode == op::CHUNK {
                        reel.enter(data, offset + RECORD_HEAD, &mut noted)?;
                    }
                    offset += RECORD_HEAD + length as u64;
                }
                None | Some(Err(McapError::UnexpectedEof)) => break,
                Some(Err(error)) => return Err(error.into()),
            }
        }
        Ok(reel)
    }

    /// Enters a chunk into the list.
    fn enter(
        &mut self,
        chunk: &[u8],
        offset: u64,
        noted: &mut impl FnMut(u64, &str),
    ) -> Result<(), ReadError> {
        let number = self.chunks.len();
        let from = self.duration;
        let mut is_first = number == 0;
        let mut messages = 0;
        let mut fault = None;
        for record in records(chunk)? {
            self.channels.learn(&record);
            let Record::Message { header, data } = record else {
                continue;
            };
            if std::mem::take(&mut is_first) {
                self.began = header.log_time;
            }
            let since = header.log_time.saturating_sub(self.began);
            self.duration = self.duration.max(since);
            if self.channels.inputs == Some(header.channel_id) {
                match cdr_reader::decode(INPUT, &data) {
                    Ok(input) => {
                        let note = input.get("input").and_then(Value::as_str);
                        noted(self.duration, note.unwrap_or_default());
                    }
                    Err(why) => fault = Some(why),
                }
            } else if let Some((topic, _)) = self.channels.topics.get(&header.channel_id) {
                self.topics.insert(*topic);
                if topic.is_latched() {
                    let places = self.latched.entry(*topic).or_default();
                    places.push((self.duration, (number, messages)));
                }
                messages += 1;
            }
        }
        if let Some(why) = fault {
            let topic = INPUTS.to_owned();
            return Err(ReadError::Message { topic, why });
        }
        let to = self.duration;
        let length = chunk.len();
        self.chunks.push(ChunkPlace {
            offset,
            length,
            from,
            to,
        });
        Ok(())
    }

    /// Length of the record, in nanoseconds.
    #[must_use]
    pub fn duration(&self) -> u64 {
        self.duration
    }

    /// Whether there is a message on that topic anywhere.
    #[must_use]
    pub fn holds(&self, topic: Topic) -> bool {
        self.topics.contains(&topic)
    }

    /// Goes behind the last message that is not later than `time`.
    ///
    /// # Errors
    /// If the file can't be read there any more.
    pub fn wind(&mut self, time: u64) -> Result<(), ReadError> {
        let chunk = self.chunks.partition_point(|chunk| chunk.to <= time);
        let index = match self.chunk(chunk)? {
            Some(moments) => moments.partition_point(|moment| moment.time <= time),
            None => 0,
        };
        self.next = (chunk, index);
        Ok(())
    }

    /// The next message, if it is not later than `until`.
    ///
    /// # Errors
    /// If the file can't be read there any more.
    pub fn forward(&mut self, until: u64) -> Result<Option<Moment>, ReadError> {
        loop {
            let (chunk, index) = self.next;
            let Some(moments) = self.chunk(chunk)? else {
                return Ok(None);
            };
            match moments.get(index) {
                Some(moment) if moment.time > until => return Ok(None),
                Some(moment) => {
                    let moment = moment.clone();
                    self.next = (chunk, index + 1);
                    return Ok(Some(moment));
                }
                None => self.next = (chunk + 1, 0),
            }
        }
    }

    /// The message before, if it is later than `until`.
    ///
    /// # Errors
    /// If the file can't be read there any more.
    pub fn backward(&mut self, until: u64) -> Result<Option<Moment>, ReadError> {
        loop {
            let (chunk, index) = self.next;
            if let Some(index) = index.checked_sub(1) {
                let moments = self.chunk(chunk)?.unwrap_or_default();
                let Some(moment) = moments.get(index).filter(|moment| moment.time > until) else {
                    return Ok(None);
                };
                let moment = moment.clone();
                self.next = (chunk, index);
                return Ok(Some(moment));
            }
            let Some(before) = chunk.checked_sub(1) else {
                return Ok(None);
            };
            let messages = self.chunk(before)?.unwrap_or_default().len();
            self.next = (before, messages);
        }
    }

    /// The place, to come back to.
    #[must_use]
    pub fn place(&self) -> ReelPlace {
        self.next
    }

    /// Comes back to a place.
    pub fn come_back(&mut self, place: ReelPlace) {
        self.next = place;
    }

    /// The place of a latched topic's last message that is not later than `time`.
    #[must_use]
    pub fn latched(&self, topic: Topic, time: u64) -> Option<ReelPlace> {
        let places = self.latched.get(&topic)?;
        let after = places.partition_point(|(at, _)| *at <= time);
        Some(places.get(after.checked_sub(1)?)?.1)
    }

    /// The message at a place.
    ///
    /// # Errors
    /// If the file can't be read there any more.
    pub fn moment(&mut self, (chunk, index): ReelPlace) -> Result<Option<Moment>, ReadError> {
        let moments = self.chunk(chunk)?.unwrap_or_default();
        Ok(moments.get(index).cloned())
    }

    /// The messages of a chunk; none behind the last.
    fn chunk(&mut self, number: usize) -> Result<Option<&[Moment]>, ReadError> {
        let is_loaded = matches!(&self.loaded, Some((loaded, _)) if *loaded == number);
        if !is_loaded {
            let Some(place) = self.chunks.get(number) else {
                return Ok(None);
            };
            let mut chunk = vec![0; place.length];
            let file = &mut self.file;
            file.seek(SeekFrom::Start(place.offset))
                .and_then(|_| file.read_exact(&mut chunk))
                .map_err(ReadError::File)?;
            let mut moments = Vec::new();
            let mut latest = place.from;
            for record in records(&chunk)? {
                let Record::Message { header, data } = record else {
                    continue;
                };
                latest = latest.max(header.log_time.saturating_sub(self.began));
                if let Some((topic, one)) = self.channels.topics.get(&header.channel_id) {
                    moments.push(Moment {
                        time: latest,
                        topic: *topic,
                        one: *one,
                        data: data.as_ref().into(),
                    });
                }
            }
            self.loaded = Some((number, moments));
        }
        Ok(self.loaded.as_ref().map(|(_, moments)| moments.as_slice()))
    }
}

impl Channels {
    fn learn(&mut self, record: &Record<'_>) {
        match record {
            Record::Schema { header, data } => {
                let known = known_type(&header.name, data);
                self.schemas.insert(header.id, known);
            }
            Record::Channel(channel) => {
                let known = self.schemas.get(&channel.schema_id).copied().flatten();
                match (Topic::from_name(&channel.topic), known) {
                    _ if channel.topic == INPUTS && known == Some(INPUT) => {
                        self.inputs = Some(channel.id);
                    }
                    (Some(topic), Some(one)) if one.name == topic.type_name() => {
                        self.topics.insert(channel.id, (topic, one));
                    }
                    _ => {}
                }
            }
            _ => {}
        }
    }
}

/// The records in a chunk. Nothing is read behind a fault, which the library would report for ever.
fn records(chunk: &[u8]) -> Result<Vec<Record<'static>>, McapError> {
    let Record::Chunk { header, data } = parse_record(op::CHUNK, chunk)? else {
        return Err(McapError::UnexpectedEof);
    };
    let records = ChunkReader::new(header, &data)?;
    records
        .map(|record| Ok(record?.into_owned()))
        .collect::<Result<_, _>>()
}

/// Reads as much as there is at once; 0 at the end.
fn read_some(file: &mut impl Read, into: &mut [u8]) -> Result<usize, ReadError> {
    loop {
        match file.read(into) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            read => return read.map_err(ReadError::File),
        }
    }
}
