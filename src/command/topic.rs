//! `pendularm topic`: prints messages, measures their rate, and publishes.
//!
//! **Invariant:** a publisher waits until the runtime has handled each message, so it gets every refusal.

use std::collections::VecDeque;
use std::time::Duration;

use clap::{Args, Subcommand};
use serde_json::json;
use serde_json::value::RawValue;
use tokio::time::{Instant, sleep_until};

use super::call::{GraphVerb, TypedValue, run_graph};
use super::output::{CommandError, Outcome, print};
use super::session::{Session, member_of, read_as, read_positive};
use crate::protocol::catalog::{Rosapi, Service};
use crate::value::{ValueReader, within};

/// Time between two lines of `hz`.
const REPORT: Duration = Duration::from_secs(1);

/// The verbs of topics.
#[derive(Debug, Clone, PartialEq, Subcommand)]
pub enum TopicVerb {
    #[command(flatten)]
    Graph(GraphVerb),
    /// Print the messages of a topic as they arrive
    #[command(after_help = "\
Examples:
  pendularm topic echo /joint_states --once
  pendularm topic echo /joint_states --field position -n 3
  pendularm topic echo --json /clock | head -n 3

Each message is a YAML document that ends with ---. With --json it is one line.")]
    Echo {
        #[command(flatten)]
        source: SubscribedTopic,
        /// Print only this part, such as `header.stamp` or `position[0]`
        #[arg(long)]
        field: Option<String>,
        /// Print one message and end
        #[arg(long, conflicts_with = "times")]
        once: bool,
        /// Print N messages and end
        #[arg(short = 'n', long, value_name = "N", value_parser = ValueReader(read_count))]
        times: Option<usize>,
    },
    /// Measure the rate of messages
    #[command(after_help = "\
Example:
  pendularm topic hz /joint_states

The command prints every second: the rate [1/s], and the smallest, the largest and the standard deviation of the time
between two messages [s].")]
    Hz {
        #[command(flatten)]
        source: SubscribedTopic,
        /// Number of the last messages in the measurement
        #[arg(short = 'w', long, value_name = "N", default_value = "10000")]
        #[arg(value_parser = ValueReader(read_count))]
        window: usize,
    },
    /// Publish a message, once or repeatedly
    #[command(after_help = "\
Examples:
  pendularm topic pub -1 /joint_trajectory '{points: [{positions: [0.3, -0.5]}]}'
  pendularm topic pub -r 10 /chatter std_msgs/msg/String 'data: hello'

Without --once or --times the command publishes until a signal ends it.")]
    Pub {
        /// Name, with or without the leading slash
        topic: String,
        #[command(flatten)]
        message: TypedValue,
        /// Publish one message and end
        #[arg(short = '1', long, conflicts_with = "times")]
        once: bool,
        /// Publish N messages and end
        #[arg(short = 't', long, value_name = "N", value_parser = ValueReader(read_count))]
        times: Option<usize>,
        /// Messages per second
        #[arg(short = 'r', long, value_name = "HZ", default_value = "1")]
        #[arg(value_parser = ValueReader(read_positive))]
        rate: f64,
    },
}

/// The topic of a subscription.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct SubscribedTopic {
    /// Name, with or without the leading slash
    topic: String,
    /// Type, as pkg/Name; with a type the command waits for a topic that does not exist yet
    #[arg(value_name = "TYPE")]
    type_name: Option<String>,
}

fn read_count(text: &str) -> Result<usize, String> {
    within(&(1..=1_000_000), "a whole number", text)
}

pub(super) async fn run(verb: &TopicVerb, session: &mut Session) -> Outcome {
    match verb {
        TopicVerb::Graph(verb) => run_graph(verb, "topic", session).await,
        TopicVerb::Echo {
            source: SubscribedTopic { topic, type_name },
            field,
            once,
            times,
        } => {
            session.subscribe(topic, type_name.as_deref()).await?;
            let mut left = times.or(once.then_some(1));
            while left != Some(0) {
                let message = session.message(topic).await?;
                let shown = field
                    .as_ref()
                    .map_or(Ok(&*message), |field| part(&message, field))?;
                session.show(shown, "---\n")?;
                left = left.map(|left| left - 1);
            }
            Ok(())
        }
        TopicVerb::Hz {
            source: SubscribedTopic { topic, type_name },
            window,
        } => {
            session.subscribe(topic, type_name.as_deref()).await?;
            measure(topic, *window, session).await
        }
        TopicVerb::Pub {
            topic,
            message,
            once,
            times,
            rate,
        } => {
            let times = times.or(once.then_some(1));
            let (type_name, message) = message.checked("topic", topic, session).await?;
            let advertise = match &*type_name {
                "" => json!({"op": "advertise", "topic": topic}),
                name => json!({"op": "advertise", "topic": topic, "type": name}),
            };
            session.send(&advertise).await?;
            let publish = json!({"op": "publish", "topic": topic, "msg": message});
            let period = Duration::from_secs_f64(rate.recip());
            let mut due = Instant::now();
            for count in 1.. {
                session.send(&publish).await?;
                // The answer to this call arrives after the message has been handled. A refusal arrives before it.
                session
                    .call(Service::Rosapi(Rosapi::GetTime).name(), &json!({}))
                    .await?;
                session.show_line(&message, &format!("publishing #{count}: {message}"))?;
                if times == Some(count) {
                    break;
                }
                due += period;
                sleep_until(due).await;
            }
            Ok(())
        }
    }
}

/// The part of a message at a path: names separated by dots, items in brackets. Numbers keep their spelling.
fn part<'a>(message: &'a RawValue, path: &str) -> Result<&'a RawValue, CommandError> {
    let step = |value: &'a RawValue, step: &str| match step.strip_suffix(']') {
        Some(index) => {
            let items: Vec<&RawValue> = read_as(Some(value))?;
            items.get(index.parse::<usize>().ok()?).copied()
        }
        None => member_of(value, step),
    };
    let part = path.split(['.', '[']).try_fold(message, step);
    part.ok_or_else(|| {
        CommandError::Refused(format!(
            "--field must be a part of the message, got \"{path}\""
        ))
    })
}

async fn measure(topic: &str, window: usize, session: &mut Session) -> Outcome {
    let mut spans = VecDeque::new();
    session.message(topic).await?;
    let mut last = Instant::now();
    let mut reported = last;
    loop {
        session.message(topic).await?;
        let now = Instant::now();
        if spans.len() == window {
            spans.pop_front();
        }
        spans.push_back((now - last).as_secs_f64());
        last = now;
        if now - reported >= REPORT {
            reported = now;
            print(&rhythm(&spans, session.is_json))?;
        }
    }
}

/// Rate and spread of the times between messages, in the format of `ros2`.
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
