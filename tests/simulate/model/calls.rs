//! Calls and goals: each arrives at its provider unchanged, and its caller gets exactly one correct answer.

use std::time::Duration;

use serde_json::Value;
use serde_json::value::RawValue;
use tokio::time::Instant;

use super::{Asked, Model, ReceivedFrame, absolute};
use crate::court::Court;
use crate::honest::{Expect, Honest};
use crate::json::Json;

fn read(values: &RawValue) -> Value {
    serde_json::from_str(values.get()).unwrap_or_default()
}

/// The status of a cancelled goal.
const CANCELED: &str = "5";

impl Model {
    pub(super) fn hear_call(
        &mut self,
        court: &Court,
        honest: &Honest,
        frame: &ReceivedFrame<'_>,
        text: &str,
    ) {
        let (Some(id), Some(service), Some(args)) = (frame.id, &frame.service, frame.args) else {
            return court.wrong(format!("a call lacks something: {text:.200}"));
        };
        let number = Json::read(args.get()).and_then(|args| args.get("call")?.number());
        // Hostile clients also call.
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

    pub(super) fn hear_answer(
        &mut self,
        court: &Court,
        honest: &mut Honest,
        frame: &ReceivedFrame<'_>,
        text: &str,
    ) {
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
        let Ok(status) = serde_json::from_str::<String>(status.get()) else {
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
            Expect::Success => (!result).then(|| "it should succeed".to_owned()),
            Expect::Refusal => result.then(|| "it should be refused".to_owned()),
            Expect::Member(name) => {
                let is_there = result && read(values).get(name).is_some();
                (!is_there).then(|| format!("it should have {name}"))
            }
            Expect::Computed { entries, .. } => {
                let came = read(values)["times"].as_array().map(Vec::len);
                let is_whole = result && came == Some(entries);
                (!is_whole).then(|| format!("{came:?} entries instead of {entries}"))
            }
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

    pub(super) fn hear_goal(
        &self,
        court: &Court,
        honest: &mut Honest,
        frame: &ReceivedFrame<'_>,
        text: &str,
    ) {
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

    /// The provider's answer unchanged, or a justified failure.
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
        let provided = self.services.get(&absolute(&forward.service)).copied();
        let provided = provided.unwrap_or_default();
        let is_unsettled = provided.provider.is_none()
            || !provided.is_confirmed
            || provided.is_contested
            || provided.changed >= forward.turns.saturating_sub(200);
        let deadline = forward.since + forward.timeout;
        let answered = forward.answered.map(|(when, ..)| when);
        let was_answered_in_time =
            answered.is_some_and(|when| when + Duration::from_millis(50) < deadline);
        let gone = forward
            .orphaned
            .map(|when| now.saturating_duration_since(when));
        if gone.is_some_and(|gone| gone > Duration::from_secs(1)) && !hampered {
            return Some("its provider has been gone for more than a second".to_owned());
        }
        let is_late = now >= deadline && (!was_answered_in_time || hampered);
        (!is_late && !is_unsettled && !self.is_scarce)
            .then(|| format!("nothing speaks for {status:?}"))
    }
}
