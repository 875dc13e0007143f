//! The model of all that must come back: each frame that an honest client hears, held against what was asked and sent.

use std::collections::BTreeMap;
use std::time::Duration;

use pendularm::math::arm::{Arm, State};
use pendularm::math::expression::Expression;
use pendularm::math::integrator::Method;
use pendularm::math::kinematics::forward;
use pendularm::math::particle::Particle;
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::rollout::{Plan, Rollout};
use serde::{Deserialize, Deserializer};
use serde_json::Value;
use serde_json::value::RawValue;
use tokio::time::Instant;

use crate::client::Received;
use crate::court::Court;
use crate::honest::{Computed, Expect, Honest, Phase};
use crate::json::Json;

/// Longest virtual time between two looks at what has come.
const LOOKS_APART: Duration = Duration::from_millis(25);

/// The reason that a client hears that held the most when all together held too much.
const HELD_MOST: &str = "memory: this connection held the most";

/// The status of a goal that ended because somebody asked for it.
const CANCELED: &str = "5";

/// A frame, as far as all of them are alike.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Heard<'a> {
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

/// A member that is there, though it be `null`.
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
    /// The provider that has heard it.
    pub heard_by: Option<u64>,
    /// When that one was gone.
    pub orphaned: Option<Instant>,
}

/// Who provides a service of clients, and the turn of the last change.
#[derive(Default, Clone, Copy)]
pub struct Provided {
    pub provider: Option<u64>,
    /// It has been told that it is.
    pub is_confirmed: bool,
    /// Two wanted to be it at the same time: which of them came last is not to be told from here.
    pub is_contested: bool,
    pub changed: u64,
}

/// A call that has come for a client as a provider.
pub struct Asked {
    pub provider: u64,
    /// The runtime's id, as text.
    pub id: String,
    pub service: String,
    pub number: u64,
}

/// All that honest clients have said to one another.
#[derive(Default)]
pub struct Model {
    /// Every message, by its number.
    pub messages: BTreeMap<u64, Message>,
    pub forwards: BTreeMap<u64, Forward>,
    pub services: BTreeMap<String, Provided>,
    /// Calls that providers have heard and not decided about.
    pub asked: Vec<Asked>,
    /// Calls whose caller is gone: whoever answers one is told so.
    pub orphans: u64,
    /// Messages that have not come to somebody who did not read.
    pub missed: u64,
    /// Whether little room excuses refusals and losses.
    pub is_scarce: bool,
    /// Whether somebody has changed, or may have changed, the lengths of the arm's links.
    pub is_reshaped: bool,
    /// Whether somebody has ended goals without saying whose.
    pub ends_any_goal: bool,
    pub links: usize,
}

impl Model {
    /// One client hears one frame.
    pub fn hear(&mut self, court: &Court, honest: &mut Honest, received: Received) {
        match received {
            Received::Json(text) => {
                court.note("heard", text.as_bytes());
                self.hear_text(court, honest, &text);
            }
            Received::Binary(bytes) => {
                court.note("heard", &bytes);
                let Some(frame) = crate::cbor::read(&bytes) else {
                    return court.wrong(format!("client {} heard what is no CBOR", honest.who));
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
        }
    }

    fn hear_text(&mut self, court: &Court, honest: &mut Honest, text: &str) {
        let frame: Heard<'_> = match serde_json::from_str(text) {
            Ok(frame) => frame,
            Err(why) => {
                return court.wrong(format!("client {} heard {text:.200}: {why}", honest.who));
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
            _ => court.wrong(format!("client {} heard {text:.200}", honest.who)),
        }
    }

    fn hear_status(&mut self, court: &Court, honest: &mut Honest, frame: &Heard<'_>, text: &str) {
        let msg: Value = serde_json::from_str(text).unwrap_or_default();
        let msg = msg["msg"].as_str().unwrap_or_default();
        match frame.level.as_deref() {
            Some("error") if msg.starts_with(HELD_MOST) => honest.was_cut_off = true,
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
            _ if honest.mistakes > 0 => honest.mistakes -= 1,
            _ if honest.is_excused => {}
            _ if self.orphans > 0 && msg.contains("no call of") => self.orphans -= 1,
            _ => court.wrong(format!(
                "client {} has made no mistake and hears {text:.300}",
                honest.who
            )),
        }
    }

    fn hear_piece(&mut self, court: &Court, honest: &mut Honest, frame: Heard<'_>) {
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

    fn hear_message(&mut self, court: &Court, honest: &mut Honest, topic: &str, body: Body<'_>) {
        let who = honest.who;
        let Some(subscription) = honest.subscriptions.get_mut(topic) else {
            if !honest.watched.contains(topic) {
                court.wrong(format!("client {who} has not subscribed to {topic}"));
            }
            return;
        };
        if subscription.is_binary != matches!(body, Body::Binary(_)) {
            // The messages on their way when the encoding was asked for are as before.
            if subscription.phase == Phase::On {
                court.wrong(format!(
                    "client {who} got a message on {topic} in the wrong encoding"
                ));
            }
        }
        // A hostile client's message has no number.
        let Some((from, number)) = body.origin() else {
            return;
        };
        let expected = self
            .messages
            .get(&number)
            .map_or("", |message| &message.body);
        if !body.is(expected) {
            return court.wrong(format!(
                "message {number} came to client {who} changed: {body:?} instead of {expected}"
            ));
        }
        let pending = subscription.pending.entry(from).or_default();
        let Some(place) = pending.iter().position(|(one, _)| *one == number) else {
            return court.wrong(format!(
                "message {number} of client {from} came to client {who} twice, out of order or unasked; its last was {:?}",
                subscription.last
            ));
        };
        let skipped = pending
            .drain(..=place)
            .take(place)
            .filter(|(_, must)| *must)
            .count();
        if let (Some(interval), Some((_, before))) = (subscription.throttle, subscription.last)
            && subscription.phase == Phase::On
            && !honest.is_hampered
            && before.elapsed() + LOOKS_APART < interval
        {
            court.wrong(format!(
                "client {who} heard {topic} after {:?}, not {interval:?}",
                before.elapsed()
            ));
        }
        subscription.last = Some((number, Instant::now()));
        subscription.last_from = Some(from);
        court.count("messages heard");
        if skipped > 0 {
            self.miss(
                court,
                honest,
                skipped,
                &format!("before message {number} on {topic}"),
            );
        }
    }

    /// A client lacks messages: right only if it did not read, or if there was little room.
    pub fn miss(&mut self, court: &Court, honest: &Honest, count: usize, which: &str) {
        self.missed += count as u64;
        if !honest.is_hampered && !self.is_scarce {
            court.wrong(format!(
                "client {} lacks {count} messages {which}",
                honest.who
            ));
        }
    }

    fn hear_call(&mut self, court: &Court, honest: &Honest, frame: &Heard<'_>, text: &str) {
        let (Some(id), Some(service), Some(args)) = (frame.id, &frame.service, frame.args) else {
            return court.wrong(format!("a call lacks something: {text:.200}"));
        };
        let number = Json::read(args.get()).and_then(|args| args.get("call")?.number());
        // Hostile clients call too.
        let Some(forward) = number.and_then(|number| self.forwards.get_mut(&(number as u64)))
        else {
            return;
        };
        if forward.args != args.get() || absolute(service) != absolute(&forward.service) {
            return court.wrong(format!(
                "a call came to its provider changed: {text:.200} instead of {}",
                forward.args
            ));
        }
        if forward.heard_by.replace(honest.who).is_some() {
            return court.wrong(format!("call {number:?} came to a provider twice"));
        }
        self.asked.push(Asked {
            provider: honest.who,
            id: id.get().to_owned(),
            service: service.clone(),
            number: number.unwrap_or_default() as u64,
        });
    }

    fn hear_answer(&mut self, court: &Court, honest: &mut Honest, frame: &Heard<'_>, text: &str) {
        let id = frame.id.map_or("", RawValue::get);
        let Some(call) = honest.calls.remove(id) else {
            if !honest.is_excused {
                court.wrong(format!(
                    "client {} got an answer that it does not wait for: {text:.300}",
                    honest.who
                ));
            }
            return;
        };
        court.count("calls answered");
        honest.handled_before(call.order);
        if call.is_computation() {
            honest.computed = court.turns.get();
        }
        let (Some(values), Some(result), Some(status)) = (frame.values, frame.result, frame.status)
        else {
            return court.wrong(format!("an answer lacks something: {text:.200}"));
        };
        if frame.service.as_deref() != call.what.split(' ').next() {
            return court.wrong(format!("the answer to {} says {text:.200}", call.what));
        }
        let Some(status) = Value::from_raw(status) else {
            return court.wrong(format!("an answer's status is no text: {text:.200}"));
        };
        let lacks_room = status.contains("too many bytes") || status.contains("busy");
        if lacks_room && !result && (self.is_scarce || !call.is_light) {
            return;
        }
        if result != status.is_empty() && !matches!(call.expect, Expect::Forwarded(_)) {
            return court.wrong(format!("result and status disagree: {text:.200}"));
        }
        let why = match call.expect {
            Expect::Arm { is_good } => arm_answer(court, id, values, result, is_good),
            Expect::Refusal => result.then(|| "it should be refused".to_owned()),
            Expect::Member(name) => {
                let value: Value = serde_json::from_str(values.get()).unwrap_or_default();
                (!result || value.get(name).is_none()).then(|| format!("it should have {name}"))
            }
            Expect::Solution { x, y } => self.solution(values, result, x, y),
            Expect::Computed(ref computed) => compute(computed, self.links, values, result),
            Expect::Forwarded(number) => {
                self.forwarded(honest.is_hampered, number, values.get(), result, &status)
            }
            Expect::Goal { .. } => Some("a goal is answered by its result".to_owned()),
            Expect::Anything => None,
        };
        if let Some(why) = why {
            court.wrong(format!(
                "client {}: {} with id {id}: {why}: {text:.400}",
                honest.who, call.what
            ));
        }
    }

    fn hear_goal(&self, court: &Court, honest: &mut Honest, frame: &Heard<'_>, text: &str) {
        let id = frame.id.map_or("", RawValue::get);
        let who = honest.who;
        let goal = honest.calls.get(id);
        let Some((Expect::Goal { has_feedback }, is_cancelled)) =
            goal.map(|call| (call.expect.clone(), call.is_cancelled))
        else {
            if !honest.is_excused {
                court.wrong(format!(
                    "client {who} has no such goal under way: {text:.300}"
                ));
            }
            return;
        };
        if frame.action.as_deref() != Some("/ik_action") || frame.values.is_none() {
            court.wrong(format!("news of a goal lack something: {text:.300}"));
        }
        if frame.op == "action_result" {
            honest.calls.remove(id);
            court.count("goals ended");
            let is_canceled = frame.status.map(RawValue::get) == Some(CANCELED);
            if is_canceled && !is_cancelled && !self.ends_any_goal {
                court.wrong(format!(
                    "client {who} has not asked for the end of its goal: {text:.300}"
                ));
            }
        } else if !has_feedback {
            court.wrong(format!(
                "client {who} did not ask for feedback: {text:.300}"
            ));
        }
    }

    fn solution(&self, values: &RawValue, result: bool, x: f64, y: f64) -> Option<String> {
        if self.is_reshaped {
            return None;
        }
        let value: Value = serde_json::from_str(values.get()).unwrap_or_default();
        let joints: Vec<f64> =
            serde_json::from_value(value["positions"].clone()).unwrap_or_default();
        let tip = match self.links {
            2 => joints
                .try_into()
                .ok()
                .map(|q| forward(Arm::<2>::default().lengths(), &q).position),
            _ => joints
                .try_into()
                .ok()
                .map(|q| forward(Arm::<3>::default().lengths(), &q).position),
        };
        let is_there = tip.is_some_and(|tip| (tip.x - x).hypot(tip.y - y) < 1e-9);
        (!result || !is_there).then(|| format!("the hand is at {tip:?}"))
    }

    /// The provider's answer, word for word; or a failure for which there is a reason.
    fn forwarded(
        &mut self,
        hampered: bool,
        number: u64,
        values: &str,
        result: bool,
        status: &str,
    ) -> Option<String> {
        let forward = self.forwards.remove(&number)?;
        let now = Instant::now();
        if let Some((_, answered, text)) = &forward.answered
            && (*answered, text.as_str()) == (result, values)
        {
            return None;
        }
        if result {
            return Some(format!("its provider said {:?}", forward.answered));
        }
        let provided = self
            .services
            .get(&absolute(&forward.service))
            .copied()
            .unwrap_or_default();
        let is_unsettled = provided.provider.is_none()
            || !provided.is_confirmed
            || provided.is_contested
            || provided.changed >= forward.turns.saturating_sub(200);
        let deadline = forward.since + forward.timeout;
        let was_answered_in_time = forward
            .answered
            .is_some_and(|(when, _, _)| when + Duration::from_millis(50) < deadline);
        let was_forgotten = forward
            .orphaned
            .is_some_and(|when| now > when + Duration::from_secs(1));
        if was_forgotten && !hampered {
            return Some("its provider has been gone for more than a second".to_owned());
        }
        let is_late = now >= deadline && (!was_answered_in_time || hampered);
        (!is_late && !is_unsettled && !self.is_scarce)
            .then(|| format!("nothing speaks for {status:?}"))
    }
}

/// A message's body, in either encoding.
#[derive(Debug, Clone, Copy)]
enum Body<'a> {
    Text(&'a str),
    Binary(&'a Json),
}

impl Body<'_> {
    /// Its publisher and its number.
    fn origin(&self) -> Option<(u64, u64)> {
        #[derive(Deserialize)]
        struct Origin {
            from: u64,
            number: u64,
        }
        match self {
            Self::Text(text) => {
                let origin: Origin = serde_json::from_str(text).ok()?;
                Some((origin.from, origin.number))
            }
            Self::Binary(msg) => {
                let number =
                    |name: &str| msg.get(name).and_then(Json::number).map(|one| one as u64);
                number("from").zip(number("number"))
            }
        }
    }

    /// Whether it is what was sent: to the byte, or in another encoding to the value.
    fn is(&self, sent: &str) -> bool {
        match self {
            Self::Text(text) => *text == sent,
            Self::Binary(msg) => Json::read(sent).is_some_and(|sent| are_same(&sent, msg)),
        }
    }
}

fn are_same(one: &Json, other: &Json) -> bool {
    match (one, other) {
        (Json::Number(_), Json::Number(_)) => one.number() == other.number(),
        (Json::Array(ones), Json::Array(others)) => {
            ones.len() == others.len()
                && ones
                    .iter()
                    .zip(others)
                    .all(|(one, other)| are_same(one, other))
        }
        (Json::Object(ones), Json::Object(others)) => {
            let all = |(key, one): &(Option<String>, Json)| {
                key.as_deref()
                    .and_then(|key| other.get(key))
                    .is_some_and(|other| are_same(one, other))
            };
            ones.len() == others.len() && ones.iter().all(all)
        }
        _ => one == other,
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

trait FromRaw: Sized {
    fn from_raw(raw: &RawValue) -> Option<String>;
}

impl FromRaw for Value {
    fn from_raw(raw: &RawValue) -> Option<String> {
        serde_json::from_str(raw.get()).ok()
    }
}

fn arm_answer(
    court: &Court,
    id: &str,
    values: &RawValue,
    result: bool,
    is_good: bool,
) -> Option<String> {
    let Some((expected, is_done)) = court.expected.borrow_mut().remove(id) else {
        return Some("the arm's double has not seen it".to_owned());
    };
    let value: Value = serde_json::from_str(values.get()).unwrap_or_default();
    if expected.is_null() {
        let is_answer = value["steps"].is_u64() && value["time"].is_f64();
        return (!is_answer).then(|| "steps and time should have come".to_owned());
    }
    let should = is_good && is_done;
    // Over WebSocket the answer to what is wrong is its text.
    let is_text = !result && value.is_string();
    ((value != expected && !is_text) || result != should)
        .then(|| format!("the arm's double has {should} {expected}"))
}

/// The offline computation, against what came.
fn compute(computed: &Computed, links: usize, values: &RawValue, result: bool) -> Option<String> {
    let value: Value = serde_json::from_str(values.get()).unwrap_or_default();
    let expected = match computed {
        Computed::Particle {
            function,
            x0,
            dt,
            steps,
            method,
        } => {
            let function = Expression::parse(function).ok()?;
            let mut particle =
                Particle::new(function, *x0, 0.0, *dt, *steps, Method::ALL[*method]).ok()?;
            while particle.advance(1000) > 0 {}
            let times: Vec<f64> = particle.times().collect();
            serde_json::json!({"times": times, "positions": particle.positions(), "velocities": particle.velocities()})
        }
        Computed::Rollout { .. } if links == 2 => roll_out::<2>(computed)?,
        Computed::Rollout { .. } => roll_out::<3>(computed)?,
    };
    let same = expected
        .as_object()?
        .iter()
        .all(|(name, column)| value.get(name) == Some(column));
    (!result || !same).then(|| "the offline computation has something else".to_owned())
}

fn roll_out<const N: usize>(computed: &Computed) -> Option<Value> {
    let Computed::Rollout {
        q0,
        duration,
        timestep,
        method,
        samples,
    } = computed
    else {
        return None;
    };
    let plan = Plan::<N> {
        control: ControlLoop::free(Arm::default())
            .with_method(Method::ALL[*method])
            .with_timestep(*timestep),
        start: State::at_rest(q0.clone().try_into().ok()?),
        duration: *duration,
        samples: *samples,
        reference: false,
    };
    let mut run = Rollout::new(plan).ok()?;
    while run.advance(10_000) > 0 {}
    let rows = |rows: &[[f64; N]]| rows.iter().map(|row| row.to_vec()).collect::<Vec<_>>();
    Some(serde_json::json!({
        "times": run.times(), "positions": rows(run.positions()), "velocities": rows(run.velocities()),
    }))
}
