//! The model of all expected frames. Each frame that an honest client receives is compared with the requests and
//! messages that were sent.

mod body;
mod calls;
mod messages;

use std::collections::BTreeMap;
use std::time::Duration;

use pendularm::actors::arm::sim::Obstacle;
use pendularm_client::codec::Event;
use serde::{Deserialize, Deserializer};
use serde_json::Value;
use serde_json::value::RawValue;
use tokio::time::Instant;

use self::body::Body;
use crate::court::Court;
use crate::honest::{Honest, Phase};
use crate::json::Json;

/// The members that all frames share.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReceivedFrame<'a> {
    op: String,
    #[serde(borrow, default, deserialize_with = "there")]
    id: Option<&'a RawValue>,
    topic: Option<String>,
    #[serde(borrow, default, deserialize_with = "there")]
    msg: Option<&'a RawValue>,
    service: Option<String>,
    #[serde(borrow, default, deserialize_with = "there")]
    args: Option<&'a RawValue>,
    #[serde(borrow, default, deserialize_with = "there")]
    values: Option<&'a RawValue>,
    result: Option<bool>,
    #[serde(borrow, default, deserialize_with = "there")]
    status: Option<&'a RawValue>,
    level: Option<String>,
    data: Option<String>,
    num: Option<usize>,
    total: Option<usize>,
    action: Option<String>,
}

/// A member that is present, possibly `null`.
fn there<'de: 'a, 'a, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<&'a RawValue>, D::Error> {
    <&RawValue>::deserialize(deserializer).map(Some)
}

/// A message from one client to others.
pub struct Message {
    pub topic: String,
    pub publisher: u64,
    pub body: String,
}

/// A call from one client to another.
pub struct Forward {
    pub service: String,
    /// Its arguments, as text.
    pub args: String,
    pub since: Instant,
    pub turns: u64,
    pub timeout: Duration,
    /// The answer of its provider, and when: result and values, as text.
    pub answered: Option<(Instant, bool, String)>,
    /// The provider that has received it.
    pub heard_by: Option<u64>,
    /// When that provider disconnected.
    pub orphaned: Option<Instant>,
}

/// The provider of a service of clients, and the turn of the last change.
#[derive(Default, Clone, Copy)]
pub struct Provided {
    pub provider: Option<u64>,
    /// A status has confirmed it.
    pub is_confirmed: bool,
    /// Two clients registered at the same time: the order is unknown to the model.
    pub is_contested: bool,
    pub changed: u64,
}

impl Provided {
    /// Nobody provides it any more, once its last provider's frames have all been handled.
    pub fn none(changed: u64) -> Self {
        Self {
            is_contested: true,
            changed,
            ..Self::default()
        }
    }
}

/// A call that a client has received as a provider.
pub struct Asked {
    pub provider: u64,
    /// The runtime's id, as text.
    pub id: String,
    pub service: String,
    pub number: u64,
}

/// All messages and calls between honest clients.
#[derive(Default)]
pub struct Model {
    /// Every message, by its number.
    pub messages: BTreeMap<u64, Message>,
    pub forwards: BTreeMap<u64, Forward>,
    pub services: BTreeMap<String, Provided>,
    /// Calls that providers have received and not yet answered.
    pub asked: Vec<Asked>,
    /// Calls whose caller has left, or had to wait too long: their provider hears that there is no such call.
    pub orphans: u64,
    /// Messages that were dropped for a client that did not read.
    pub missed: u64,
    /// Whether scarce memory justifies refusals and losses.
    pub is_scarce: bool,
    /// Whether the arm was stepped by hand, so that feedback of half a minute comes at once through a narrow pipe.
    pub is_overrun: bool,
    /// Whether a client has cancelled goals without naming their owner.
    pub ends_any_goal: bool,
}

impl Model {
    /// One client receives one frame.
    pub fn hear(&mut self, court: &Court, honest: &mut Honest, received: Event) {
        match received {
            Event::Text(text) => {
                court.note("received", text.as_bytes());
                self.hear_text(court, honest, &text);
            }
            Event::Binary(bytes) => {
                court.note("received", &bytes);
                let Some(frame) = crate::cbor::read(&bytes) else {
                    return court.wrong(format!(
                        "client {} received a frame that is not CBOR",
                        honest.who
                    ));
                };
                let topic = frame
                    .get("topic")
                    .and_then(Json::text)
                    .unwrap_or_default()
                    .to_owned();
                match frame.get("msg") {
                    Some(msg) => self.hear_message(court, honest, &topic, Body::Binary(msg)),
                    None => court.wrong(format!("a binary frame without a message: {frame:?}")),
                }
            }
            Event::Ping(_) | Event::Pong(_) | Event::Close(..) => {}
        }
    }

    fn hear_text(&mut self, court: &Court, honest: &mut Honest, text: &str) {
        let frame: ReceivedFrame<'_> = match serde_json::from_str(text) {
            Ok(frame) => frame,
            Err(why) => {
                return court.wrong(format!("client {} received {text:.200}: {why}", honest.who));
            }
        };
        match frame.op.as_str() {
            "publish" => {
                let (Some(topic), Some(msg)) = (frame.topic, frame.msg) else {
                    return court.wrong(format!("a message without topic or msg: {text:.200}"));
                };
                self.hear_message(court, honest, &topic, Body::Text(msg.get()));
            }
            "service_response" => self.hear_answer(court, honest, &frame, text),
            "status" => self.hear_status(court, honest, &frame, text),
            "call_service" => self.hear_call(court, honest, &frame, text),
            "fragment" => self.hear_piece(court, honest, frame),
            "action_feedback" | "action_result" => self.hear_goal(court, honest, &frame, text),
            _ => court.wrong(format!("client {} received {text:.200}", honest.who)),
        }
    }

    fn hear_status(
        &mut self,
        court: &Court,
        honest: &mut Honest,
        frame: &ReceivedFrame<'_>,
        text: &str,
    ) {
        let msg: Value = serde_json::from_str(text).unwrap_or_default();
        let msg = msg["msg"].as_str().unwrap_or_default();
        match frame.level.as_deref() {
            // A warning belongs to a call or a goal that has no answer yet.
            Some("warning")
                if [Obstacle::ControllerOff, Obstacle::Diverged]
                    .iter()
                    .any(|obstacle| obstacle.to_string() == msg)
                    && frame
                        .id
                        .is_some_and(|id| honest.calls.contains_key(id.get())) => {}
            Some("info") => {
                if !honest.has_news(msg) && !honest.is_excused {
                    return court.wrong(format!(
                        "client {} is told of what it has not done, or twice: {text:.300}",
                        honest.who
                    ));
                }
                if let Some(topic) = msg.strip_prefix("subscribed to ")
                    && let Some(subscription) = honest.subscriptions.get_mut(topic)
                    && subscription.phase == Phase::Asked
                {
                    subscription.phase = Phase::On;
                }
                let service = msg.strip_prefix("advertised service ").map(absolute);
                if let Some(provided) = service.and_then(|service| self.services.get_mut(&service))
                    && provided.provider == Some(honest.who)
                {
                    provided.is_confirmed = true;
                    provided.changed = court.turns.get();
                }
            }
            _ if honest.is_excused => {}
            _ if self.orphans > 0 && msg.contains("no call of") => self.orphans -= 1,
            _ if honest.mistakes > 0 => honest.mistakes -= 1,
            _ => court.wrong(format!(
                "client {} has made no mistake and hears {text:.300}",
                honest.who
            )),
        }
    }

    fn hear_piece(&mut self, court: &Court, honest: &mut Honest, frame: ReceivedFrame<'_>) {
        let (Some(id), Some(data), Some(num), Some(total)) =
            (frame.id, frame.data, frame.num, frame.total)
        else {
            return court.wrong("a fragment lacks something".to_owned());
        };
        let id = id.get().to_owned();
        let pieces = honest.pieces.entry(id.clone()).or_default();
        if num != pieces.len() {
            return court.wrong(format!(
                "fragment {num} of {id} came as number {}",
                pieces.len()
            ));
        }
        pieces.push(data);
        if pieces.len() == total {
            let whole = honest.pieces.remove(&id).unwrap_or_default().concat();
            self.hear_text(court, honest, &whole);
        }
    }
}

/// A name with its slash.
pub fn absolute(name: &str) -> String {
    if name.starts_with('/') {
        name.to_owned()
    } else {
        format!("/{name}")
    }
}
