//! A fault for every rule: a wrong answer, a wrong message, or a request that reaches the arm as another one.
//!
//! `faults.txt` has them: a rule, the server's fault in words, and how a proxy makes it.
//!
//! | fault | meaning |
//! | --- | --- |
//! | `answer /s: changes` | changes the frames of the answers of a service |
//! | `request /s: changes` | changes the arguments of its calls |
//! | `topic /t: changes` | changes the messages that the server publishes |
//! | `points: changes` | changes the points of the trajectories that the suite sends |
//! | `after 3 /s: changes` | changes `/joint_states` once the service has been called so often |
//! | `drop server topic /t`, `twice client op x` | drops or doubles that side's frames with this member |
//! | `before /s: /t {}; /t {}`, `behind` | adds calls before or behind the calls of a service |
//! | `one & other` | both |
//!
//! Before the colon, `if path` and `unless path` look for a value, `if path=json` for this one, `only path` for no other member; `from 3`
//! and `every 3` count the frames. Changes are separated by `; `: `path = json`, `path is json -> json`, `path + number`, `path * number`
//! (`2 n` is two for each frame so far), `- path`, `pop path`, `keep 1`. `[*1.0]` has that entry for each joint, `last` is the last one.

#![allow(
    clippy::expect_used,
    clippy::indexing_slicing,
    clippy::panic,
    reason = "the table is a part of the program, and the self-test makes each fault"
)]

use serde_json::{Value, json};

use super::proxy::{Fault, Side};

/// A fault that a rule must find.
#[derive(Debug, Clone, Copy)]
pub struct Planted {
    /// The rule.
    pub rule: &'static str,
    /// A description of the server's fault.
    pub says: &'static str,
    made: &'static str,
}

/// At least one for each rule.
#[must_use]
pub fn all() -> Vec<Planted> {
    let row = |line: &'static str| {
        let [rule, says, made] = line.split(" | ").collect::<Vec<_>>().try_into().expect(line);
        Planted { rule, says, made }
    };
    include_str!("faults.txt").lines().map(row).collect()
}

impl Planted {
    /// Makes it, for a number of links.
    #[must_use]
    pub fn fault(&self, links: usize) -> Fault {
        let mut parts: Vec<Fault> = self.made.split(" & ").map(|part| one(part, links)).collect();
        Box::new(move |side, frame| {
            let mut frames = vec![frame];
            for part in &mut parts {
                frames = frames.into_iter().flat_map(|frame| part(side, frame)).collect();
            }
            frames
        })
    }
}

fn is(frame: &Value, name: &str, value: &str) -> bool {
    frame[name] == value
}

fn one(text: &'static str, links: usize) -> Fault {
    let (head, changes) = text.split_once(": ").unwrap_or((text, ""));
    let words: Vec<&str> = head.split(' ').collect();
    match words[..] {
        ["answer", service, ..] => changed(Side::Server, "service_response", service, "", &words[2..], changes, links),
        ["request", service, ..] => changed(Side::Client, "call_service", service, "/args", &words[2..], changes, links),
        ["topic", topic, ..] => changed(Side::Server, "publish", topic, "/msg", &words[2..], changes, links),
        ["points", ..] => changed(Side::Client, "publish", "/joint_trajectory", "/msg/points", &words[1..], changes, links),
        ["after", calls, service] => {
            let (mut seen, calls) = (0, calls.parse::<usize>().expect(text));
            let mut change = changed(Side::Server, "publish", "/joint_states", "/msg", &[], changes, links);
            Box::new(move |side, frame| {
                seen += usize::from(side == Side::Client && is(&frame, "service", service));
                if seen < calls { vec![frame] } else { change(side, frame) }
            })
        }
        [how @ ("drop" | "twice"), of, name, ..] => {
            // The rest of the line may have spaces.
            let value = head.splitn(4, ' ').last().expect(text);
            let pointer = format!("/{name}");
            Box::new(move |side, frame| {
                let is_of = matches!((of, side), ("server", Side::Server) | ("client", Side::Client));
                match frame.pointer(&pointer).is_some_and(|found| found == value) && is_of {
                    true if how == "drop" => vec![],
                    true => vec![frame.clone(), frame],
                    false => vec![frame],
                }
            })
        }
        [how @ ("before" | "behind"), service, ..] => {
            let conditions = words[2..].to_vec();
            let call = |text: &str| {
                let (service, args) = text.split_once(' ').expect(text);
                json!({"op": "call_service", "id": "proxy", "service": service, "args": json_of(args, links)})
            };
            let calls: Vec<Value> = changes.split("; ").map(call).collect();
            Box::new(move |side, frame| {
                let is_call = side == Side::Client && is(&frame, "service", service);
                if !is_call || !holds(&conditions, &frame["args"], 0) {
                    return vec![frame];
                }
                let frame = vec![frame];
                if how == "before" { [calls.clone(), frame].concat() } else { [frame, calls.clone()].concat() }
            })
        }
        _ => panic!("no fault: {text}"),
    }
}

/// Changes that part of a side's frames with this op, about this service or topic.
fn changed(
    of: Side,
    op: &'static str,
    about: &'static str,
    part: &'static str,
    conditions: &[&'static str],
    changes: &'static str,
    links: usize,
) -> Fault {
    let (mut count, conditions) = (0, conditions.to_vec());
    let name = if op == "publish" { "topic" } else { "service" };
    Box::new(move |side, mut frame| {
        if side == of
            && is(&frame, "op", op)
            && is(&frame, name, about)
            && let Some(subject) = frame.pointer_mut(part)
        {
            if holds(&conditions, subject, count) {
                changes.split("; ").for_each(|change| apply(subject, change, count, links));
            }
            count += 1;
        }
        vec![frame]
    })
}

fn holds(conditions: &[&str], subject: &Value, count: usize) -> bool {
    conditions.chunks(2).all(|condition| {
        let [how, what] = condition[..] else { panic!("half a condition: {condition:?}") };
        let (path, wanted) = what.split_once('=').map_or((what, None), |(path, text)| (path, Some(json_of(text, 0))));
        let found = subject.pointer(&format!("/{path}")).filter(|found| !found.is_null() && **found != json!(false));
        match how {
            "if" => found.is_some_and(|found| wanted.is_none_or(|wanted| wanted == *found)),
            "unless" => found.is_none(),
            "only" => found.is_some() && subject.as_object().is_some_and(|members| members.len() == 1),
            "from" => count >= what.parse().expect(what),
            "every" => count % what.parse::<usize>().expect(what) == 1,
            _ => panic!("no condition: {how}"),
        }
    })
}

fn json_of(text: &str, links: usize) -> Value {
    let each = |text: &str| vec![text; links].join(",");
    let text = match text.split_once("[*") {
        Some((before, rest)) => {
            let (entry, after) = rest.split_once(']').expect(text);
            format!("{before}[{}]{after}", each(entry))
        }
        None => text.to_owned(),
    };
    serde_json::from_str(&text).unwrap_or_else(|why| panic!("{text}: {why}"))
}

/// The value at the end of a path, which is made if it is a member.
fn place<'a>(subject: &'a mut Value, path: &str, links: usize) -> Option<&'a mut Value> {
    let path = path.replace("last", &(links - 1).to_string());
    path.split('/').filter(|name| !name.is_empty()).try_fold(subject, |value, name| match value {
        Value::Object(_) => Some(&mut value[name]),
        Value::Array(entries) => entries.get_mut(name.parse::<usize>().ok()?),
        _ => None,
    })
}

fn number(text: &str, count: usize) -> f64 {
    let (base, each) = match text.strip_suffix(" n") {
        Some(text) => text.split_once(" + ").unwrap_or(("0", text)),
        None => (text, "0"),
    };
    let parse = |text: &str| text.parse::<f64>().expect(text);
    parse(base) + parse(each) * f64::from(u32::try_from(count).unwrap_or(u32::MAX))
}

fn apply(subject: &mut Value, change: &str, count: usize, links: usize) {
    if let Some((path, values)) = change.split_once(" is ") {
        let (from, to) = values.split_once(" -> ").expect(change);
        if let Some(value) = place(subject, path, links)
            && *value == json_of(from, links)
        {
            *value = json_of(to, links);
        }
    } else if let Some((path, value)) = change.split_once("= ") {
        if let Some(place) = place(subject, path.trim(), links) {
            *place = json_of(value, links);
        }
    } else if let Some((path, factor)) = change.split_once(" * ") {
        let factor = number(factor, count);
        match place(subject, path, links) {
            Some(Value::Array(entries)) => entries.iter_mut().for_each(|entry| *entry = json!(factor * entry.as_f64().unwrap_or(0.0))),
            Some(value) if value.is_number() => *value = json!(factor * value.as_f64().unwrap_or(0.0)),
            _ => {}
        }
    } else if let Some((path, more)) = change.split_once(" + ") {
        if let Some(value) = place(subject, path, links).filter(|value| value.is_number()) {
            *value = json!(value.as_f64().unwrap_or(0.0) + number(more, count));
        }
    } else {
        remove(subject, change, links);
    }
}

/// Changes that take something away.
fn remove(subject: &mut Value, change: &str, links: usize) {
    let (how, what) = change.split_once(' ').expect(change);
    let (path, name) = what.rsplit_once('/').unwrap_or(("", what));
    match how {
        "-" => drop(place(subject, path, links).and_then(Value::as_object_mut).and_then(|members| members.remove(name))),
        "pop" => drop(place(subject, what, links).and_then(Value::as_array_mut).and_then(Vec::pop)),
        "keep" => subject.as_array_mut().into_iter().for_each(|entries| entries.truncate(what.parse().expect(what))),
        _ => panic!("no change: {change}"),
    }
}
