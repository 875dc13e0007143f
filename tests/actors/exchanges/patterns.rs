//! The texts of a step: numbers, repetitions, and patterns of values.

use std::collections::BTreeMap;
use std::time::Duration;

use pendularm::actors::compute::computations::MAX_COMPUTATIONS_WAITING;
use pendularm::actors::gateway::connection::admission::{MAX_AUTH_BYTES, WRONG_TOKEN_TIME};
use pendularm::actors::gateway::limits::{
    DEFAULT_TIMEOUT, FRAME_TIME, HEAD_TIME, LINGER, MAX_RESPONSES_WAITING, OPENING_TIME,
    RESPONSES_TIME, STALL_LIMIT,
};
use pendularm::actors::graph::registrations::{ENTRY_BYTES, MAX_REGISTERED};
use pendularm::actors::resources::memory::{LONG_FRAME_TIME, MAX_BACKLOG, MAX_LONG_BACKLOG};
use pendularm::actors::resources::places::{KEPT_PLACES, MAX_NEWCOMERS};
use pendularm::actors::ros::tf_web::{MAX_FRAME_SUBSCRIPTIONS, MAX_FRAMES};
use pendularm::options::DEFAULT_CLIENTS;
use pendularm::protocol::limits::{MAX_FRAME, MAX_NAME, MEDIUM, SHORT};
use pendularm::protocol::ros::parameters::MAX_NAMED;
use pendularm::services::trajectory::MAX_POINTS;
#[cfg(feature = "web")]
use pendularm::web::head::{MAX_HEAD, MAX_HEADERS};
#[cfg(feature = "web")]
use pendularm::web::stream::IDLE_TIME;
use serde_json::Value;

/// Limits in place of numbers. Times are in ms. `ENTRIES_OF_5` entries with 5 bytes of names are the most that a client
/// may register.
const LIMITS: &[(&str, usize)] = &[
    ("DEFAULT_CLIENTS", DEFAULT_CLIENTS),
    ("DEFAULT_TIMEOUT", ms(DEFAULT_TIMEOUT)),
    ("FRAME_TIME", ms(FRAME_TIME)),
    ("HEAD_TIME", ms(HEAD_TIME)),
    #[cfg(feature = "web")]
    ("IDLE_TIME", ms(IDLE_TIME)),
    ("ENTRIES_OF_5", MAX_REGISTERED / (ENTRY_BYTES + 3 * 5)),
    ("ENTRIES_OF_12", MAX_REGISTERED / (ENTRY_BYTES + 3 * 12)),
    ("ENTRIES_OF_1000", MAX_REGISTERED / (ENTRY_BYTES + 3 * 1000)),
    ("KEPT_PLACES", KEPT_PLACES),
    ("LINGER", ms(LINGER)),
    ("LONG_FRAME_TIME", ms(LONG_FRAME_TIME)),
    ("MAX_COMPUTATIONS_WAITING", MAX_COMPUTATIONS_WAITING),
    ("MAX_AUTH_BYTES", MAX_AUTH_BYTES),
    ("MAX_BACKLOG", MAX_BACKLOG),
    ("MAX_FRAME", MAX_FRAME),
    ("MAX_LONG_BACKLOG", MAX_LONG_BACKLOG),
    ("MAX_FRAMES", MAX_FRAMES),
    #[cfg(feature = "web")]
    ("MAX_HEAD", MAX_HEAD),
    #[cfg(feature = "web")]
    ("MAX_HEADERS", MAX_HEADERS),
    ("MAX_NAME", MAX_NAME),
    ("MAX_NAMED", MAX_NAMED),
    ("MAX_POINTS", MAX_POINTS),
    ("MAX_RESPONSES_WAITING", MAX_RESPONSES_WAITING),
    ("MAX_NEWCOMERS", MAX_NEWCOMERS),
    ("MAX_FRAME_SUBSCRIPTIONS", MAX_FRAME_SUBSCRIPTIONS),
    ("MEDIUM", MEDIUM),
    ("OPENING_TIME", ms(OPENING_TIME)),
    ("RESPONSES_TIME", ms(RESPONSES_TIME)),
    ("SHORT", SHORT),
    ("STALL_LIMIT", ms(STALL_LIMIT)),
    ("WRONG_TOKEN_TIME", ms(WRONG_TOKEN_TIME)),
];

const fn ms(time: Duration) -> usize {
    time.as_millis() as usize
}

/// The range of `1..2` or of a single number.
pub(super) fn range(text: &str) -> Option<(usize, usize)> {
    match text.split_once("..") {
        Some((low, high)) => number(low).zip(number(high)),
        None => number(text).map(|number| (number, number)),
    }
}

/// A number, or the limit of that name, or the sum or the difference of two such.
pub(super) fn number(text: &str) -> Option<usize> {
    if let Some((one, other)) = text.split_once(" + ") {
        return number(one)?.checked_add(number(other)?);
    }
    if let Some((one, other)) = text.split_once(" - ") {
        return number(one)?.checked_sub(number(other)?);
    }
    let limit = LIMITS.iter().find(|(name, _)| *name == text);
    limit.map_or_else(|| text.parse().ok(), |(_, limit)| Some(*limit))
}

/// A text as it is sent.
pub(super) fn expand(text: &str, bound: &BTreeMap<String, Value>) -> String {
    let mut text = text.to_owned();
    for (name, value) in bound {
        text = text.replace(&format!("${name}"), &value.to_string());
    }
    while let Some((before, rest)) = text.split_once('%') {
        let (repeated, after) = rest.split_once('%').expect("an end of the repetition");
        let (count, part) = match repeated {
            "cr" => ("1", "\r"),
            "lf" => ("1", "\n"),
            _ => repeated.split_once('*').expect("a count"),
        };
        let count = number(count).expect("a count");
        text = format!("{before}{}{after}", part.repeat(count));
    }
    text
}

pub(super) fn check(
    pattern: &str,
    got: &Value,
    bound: &mut BTreeMap<String, Value>,
) -> Result<(), String> {
    let wanted = serde_json::from_str(pattern).map_err(|error| format!("{error}: {pattern}"))?;
    if matches(&wanted, Some(got), bound) {
        return Ok(());
    }
    Err(format!("{pattern}: {got}"))
}

/// Whether a number is within the range between two texts.
pub(super) fn is_within((low, high): (&str, &str), number: f64) -> bool {
    let bounds = low.parse::<f64>().ok().zip(high.parse::<f64>().ok());
    bounds.is_some_and(|(low, high)| (low..=high).contains(&number))
}

pub(super) fn matches(
    wanted: &Value,
    got: Option<&Value>,
    bound: &mut BTreeMap<String, Value>,
) -> bool {
    let Some(got) = got else { return wanted == "-" };
    match (wanted, got) {
        (Value::String(text), _) => match text.split_at_checked(1) {
            Some(("*", "")) => true,
            Some(("~", part)) => got
                .as_str()
                .map_or_else(|| got.to_string(), str::to_owned)
                .contains(part),
            Some(("$", name)) => bound.entry(name.to_owned()).or_insert_with(|| got.clone()) == got,
            _ => {
                text == got || {
                    let number = got.as_str().map_or(got.as_f64(), |text| text.parse().ok());
                    let range = text.split_once("..").zip(number);
                    range.is_some_and(|(range, number)| is_within(range, number))
                }
            }
        },
        (Value::Object(members), _) if members.len() == 1 && members.contains_key("=") => {
            members["="] == *got
        }
        (Value::Object(members), Value::Object(_)) => members
            .iter()
            .all(|(name, one)| matches(one, got.get(name), bound)),
        (Value::Array(wanted), Value::Array(got)) => {
            wanted.len() == got.len()
                && wanted
                    .iter()
                    .zip(got)
                    .all(|(one, got)| matches(one, Some(got), bound))
        }
        (Value::Number(wanted), Value::Number(got)) => wanted.as_f64() == got.as_f64(),
        (wanted, got) => wanted == got,
    }
}
