//! The part of a frame that is for the runtime's own nodes: only the members that they have a use for.
//!
//! **Invariant:** it has at most [`MAX_ARGS`] bytes, so that the gateway's thread reads it in next to no time.

use std::collections::BTreeMap;

use serde_json::value::{RawValue, to_raw_value};

use super::OpReader;
use crate::protocol::catalog::{Field, Topic};
use crate::protocol::messages::trajectory::{self, NodeMessage};
use crate::protocol::op::{Arguments, MAX_ARGS, Problem};
use crate::protocol::wire::json;
use crate::protocol::wire::payload::Payload;

/// Arguments and messages longer than this are searched for members that no node of ours uses.
const USUAL: usize = 4 * 1024;

impl OpReader<'_> {
    /// The arguments: of long ones for a node of ours the `fields` that it has, which must not be long.
    pub(super) fn args(&self, fields: Option<&'static [Field]>) -> Result<Arguments, Problem> {
        let Some(raw) = self.get("args") else {
            return Ok(Arguments::none());
        };
        let known = fields.filter(|_| raw.get().len() > USUAL);
        let args = match known.and_then(|fields| only(raw, fields)) {
            Some(known) => Payload::from(known),
            None => Payload::from(raw),
        };
        if fields.is_some() {
            self.within(MAX_ARGS, "args", args.get())?;
        }
        Ok(match args.get().as_bytes().first() {
            Some(b'{') => Arguments::Object(args),
            Some(b'[') => Arguments::Positional(args),
            Some(b'n') => Arguments::none(),
            _ => Arguments::Neither(args),
        })
    }

    /// Returns the part of a long message that the runtime itself needs, where it listens to the topic.
    pub(super) fn heard(&self, topic: &str, msg: &Payload) -> Result<Option<NodeMessage>, Problem> {
        let is_ours = Topic::from_name(topic) == Some(Topic::JointTrajectory);
        if !is_ours || msg.get().len() <= USUAL {
            return Ok(None);
        }
        let Some((text, left_out)) = trajectory::condensed(msg.raw()) else {
            self.within(MAX_ARGS, "msg", msg.get())?;
            return Ok(None);
        };
        self.within(MAX_ARGS, "msg", &text)?;
        let msg = RawValue::from_string(text).ok().map(Payload::from);
        Ok(msg.map(|msg| NodeMessage { msg, left_out }))
    }
}

/// The object `raw` without members that are not among `fields`; `None` if it is no object.
fn only(raw: &RawValue, fields: &[Field]) -> Option<Box<RawValue>> {
    let names: Vec<&str> = fields.iter().map(|field| field.name).collect();
    let mut values = vec![None; names.len()];
    json::members_into(raw.get(), &names, &mut values).ok()?;
    let found = names.into_iter().zip(values);
    let found: BTreeMap<&str, &RawValue> = found
        .filter_map(|(name, value)| Some((name, value?)))
        .collect();
    to_raw_value(&found).ok()
}
