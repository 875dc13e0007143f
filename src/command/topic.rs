//! `pendularm topic`: what is published, how often, and publishing.
//!
//! **Invariant:** whatever publishes waits until the runtime has taken each message, so that a refusal is heard.

use std::collections::VecDeque;
use std::thread;
use std::time::{Duration, Instant};

use clap::{Arg, Command};
use serde_json::json;
use serde_json::value::RawValue;

use super::asked::{Asked, read_count, read_positive};
use super::error::CommandError;
use super::field::read_path;
use super::output::print;
use super::session::end_on_signal;
use super::verbs::{flag, number, required, show_types, subject, typed_value, verb};
use crate::protocol::catalog::{Rosapi, Service};

/// How often `hz` says what it has measured.
const REPORT: Duration = Duration::from_secs(1);

pub(super) fn command() -> Command {
    let topic = || {
        required(
            "topic",
            "TOPIC",
            "Its name, with or without the leading slash",
        )
    };
    let type_name = || {
        let arg = Arg::new("type").value_name("TYPE");
        arg.help("Its type, as pkg/Name, to wait for a topic that is not there yet")
    };
    let list = verb(
        "list",
        "List the topics that there are",
        "Examples:\n  pendularm topic list -t\n  pendularm topic list --json | jq -r .name",
    );
    let echo = verb(
        "echo",
        "Print the messages of a topic as they come",
        "Examples:\n  pendularm topic echo /joint_states --once\n  \
         pendularm topic echo /joint_states --field position -n 3\n  \
         pendularm topic echo --json /clock | head -n 3\n\n\
         Each message is a YAML document that ends with ---, or with --json a line. \
         SIGINT, and a reader that goes away, end it\nwith status 0.",
    );
    let hz = verb(
        "hz",
        "Measure how often messages come",
        "Example:\n  pendularm topic hz /joint_states\n\n\
         Once a second it prints the rate [1/s], and least, largest and standard deviation of the time between \
         two\nmessages [s].",
    );
    let window = number("window", "N").short('w');
    let field = Arg::new("field").long("field").value_name("FIELD");
    let times = number("times", "N").short('n');
    subject("topic", "Watch topics of a running pendularm, and publish").subcommands([
        list.arg(show_types()),
        echo.args([
            topic(),
            type_name(),
            field
                .value_parser(read_path)
                .help("Print this part alone, such as header.stamp or position[0]"),
            flag("once", "Print one message and end").conflicts_with("times"),
            times
                .value_parser(read_count)
                .help("Print so many messages and end"),
        ]),
        hz.args([
            topic(),
            type_name(),
            window
                .value_parser(read_count)
                .default_value("10000")
                .help("How many of the last messages count"),
        ]),
        publisher()
            .arg(topic())
            .args(typed_value("MESSAGE", "The message")),
    ])
}

fn publisher() -> Command {
    let notes = "Examples:\n  pendularm topic pub -1 /joint_trajectory '{points: [{positions: [0.3, -0.5]}]}'\n  \
        pendularm topic pub -r 10 /chatter std_msgs/msg/String 'data: hello'\n\n\
        Without --once or --times it publishes until SIGINT, and ends with status 0. MESSAGE is JSON or YAML; without \
        one it is {}.";
    let once = flag("once", "Publish one message and end").short('1');
    let times = number("times", "N").short('t');
    let rate = number("rate", "HZ").short('r');
    verb("pub", "Publish a message, once or again and again", notes).args([
        once.conflicts_with("times"),
        times
            .value_parser(read_count)
            .help("Publish so many messages and end"),
        rate.value_parser(read_positive)
            .default_value("1")
            .help("How many a second"),
    ])
}

pub(super) fn list(asked: &Asked) -> Result<(), CommandError> {
    let mut session = asked.open()?;
    let names: Vec<String> = session.ask("topics", &json!({}), "topics")?;
    asked.list(&names, |name| session.type_of("topic", name, None))
}

pub(super) fn echo(asked: &Asked) -> Result<(), CommandError> {
    let topic = asked.text("topic");
    let field = asked.field();
    let times = asked.times();
    let mut session = asked.open()?;
    session.subscribe(topic, asked.type_name())?;
    end_on_signal()?;
    let mut count = 0;
    while times.is_none_or(|times| count < times) {
        let msg = session.message(topic)?;
        asked.show_next(match field {
            Some(field) => field.pick(&msg)?,
            None => &msg,
        })?;
        count += 1;
    }
    Ok(())
}

pub(super) fn hz(asked: &Asked) -> Result<(), CommandError> {
    let topic = asked.text("topic");
    let window = asked.number("window").unwrap_or(1);
    let mut session = asked.open()?;
    session.subscribe(topic, asked.type_name())?;
    end_on_signal()?;
    let mut spans = VecDeque::new();
    session.message(topic)?;
    let mut last = Instant::now();
    let mut reported = last;
    loop {
        session.message(topic)?;
        let now = Instant::now();
        if spans.len() == window {
            spans.pop_front();
        }
        spans.push_back((now - last).as_secs_f64());
        last = now;
        if now - reported >= REPORT {
            reported = now;
            print(&rhythm(&spans, asked.has("json")))?;
        }
    }
}

/// Rate and spread of the times between messages, in the words of `ros2`.
fn rhythm(spans: &VecDeque<f64>, is_json: bool) -> String {
    #[expect(clippy::cast_precision_loss, reason = "there are at most a million")]
    let count = spans.len() as f64;
    let mean = spans.iter().sum::<f64>() / count;
    let variance = spans.iter().map(|span| (span - mean).powi(2)).sum::<f64>() / count;
    let (rate, deviation) = (mean.recip(), variance.sqrt());
    let least = spans.iter().copied().fold(f64::INFINITY, f64::min);
    let most = spans.iter().copied().fold(0.0, f64::max);
    let window = spans.len();
    if is_json {
        let line = json!({"rate": rate, "min": least, "max": most, "std_dev": deviation, "window": window});
        return format!("{line}\n");
    }
    format!(
        "average rate: {rate:.3}\n\tmin: {least:.3}s max: {most:.3}s std dev: {deviation:.5}s window: {window}\n"
    )
}

pub(super) fn publish(asked: &Asked) -> Result<(), CommandError> {
    let topic = asked.text("topic");
    let (type_name, message) = asked.typed_value("MESSAGE")?;
    let times = asked.times();
    let period = Duration::from_secs_f64(asked.number("rate").unwrap_or(1.0_f64).recip());
    let mut session = asked.open()?;
    let known = session.type_of("topic", topic, type_name)?;
    let mut advertise = json!({"op": "advertise", "topic": topic});
    if let (false, Some(frame)) = (known.is_empty(), advertise.as_object_mut()) {
        frame.insert("type".to_owned(), known.into());
    }
    session.send(&advertise)?;
    end_on_signal()?;
    let publish = json!({"op": "publish", "topic": topic, "msg": message});
    let spelled = RawValue::from_string(message.to_string()).ok();
    let mut due = Instant::now();
    let mut count = 0;
    loop {
        session.send(&publish)?;
        // Answered once the message has been taken; a refusal comes before.
        session.call(Service::Rosapi(Rosapi::GetTime).name(), &json!({}))?;
        count += 1;
        if let Some(spelled) = &spelled {
            if asked.has("json") {
                asked.show_next(spelled)?;
            } else {
                print(&format!(
                    "publishing #{count}: {}",
                    super::spelling::json_line(spelled)
                ))?;
            }
        }
        if times.is_some_and(|times| count >= times) {
            return Ok(());
        }
        due += period;
        thread::sleep(due.saturating_duration_since(Instant::now()));
    }
}
