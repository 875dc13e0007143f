//! A client of an exchange: the frames that it receives, those that it keeps, and its questions.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use pendularm_client::codec::Event;
use pendularm_client::{Error, pipe};
use serde_json::{Value, json};
use tokio::io::DuplexStream;
use tokio::time::{Instant, timeout, timeout_at};

use super::patterns::{check, is_within, matches};

/// Longest virtual time until the next frame: the longest time limit of the runtime.
pub(super) const LONG_PATIENCE: Duration = Duration::from_secs(120);

/// Virtual time in which all sent frames arrive.
pub(super) const SHORT_PATIENCE: Duration = Duration::from_millis(10);

/// Topics that are published periodically.
const PERIODIC: [&str; 5] = [
    "/joint_states",
    "joint_states",
    "/clock",
    "/tf",
    "/diagnostics",
];

/// A frame: its text, which is empty for a binary message, and its value.
pub(super) struct Frame(String, Value);

pub(super) struct Peer {
    pub(super) stream: pipe::Client<DuplexStream>,
    /// Frames that arrived while another was awaited, oldest first.
    kept: VecDeque<Frame>,
    pub(super) last: String,
}

impl Peer {
    pub(super) fn new(stream: pipe::Client<DuplexStream>) -> Self {
        Self {
            stream,
            kept: VecDeque::new(),
            last: String::new(),
        }
    }

    async fn read(&mut self) -> Result<Frame, String> {
        loop {
            return match self.stream.next_event().await {
                // Some readers end a line at a carriage return.
                Ok(Event::Text(text)) if text.contains(['\r', '\n']) => Err(text),
                Ok(Event::Text(text)) => match serde_json::from_str(&text) {
                    Ok(value) => Ok(Frame(text, value)),
                    Err(error) => Err(format!("{error}: {text}")),
                },
                Ok(Event::Binary(bytes)) => {
                    let value = json!({"binary": String::from_utf8_lossy(&bytes)});
                    Ok(Frame(String::new(), value))
                }
                Ok(Event::Ping(_) | Event::Pong(_)) => continue,
                Ok(Event::Close(code, why)) => {
                    Ok(Frame(String::new(), json!({"close": code, "why": why})))
                }
                Err(Error::Ended) => Ok(Frame(String::new(), json!("the end"))),
                Err(error) => Err(error.to_string()),
            };
        }
    }

    pub(super) async fn next(&mut self) -> Result<Value, String> {
        let Frame(text, value) = match self.kept.pop_front() {
            Some(frame) => frame,
            None => {
                let read = timeout(LONG_PATIENCE, self.read()).await;
                read.map_err(|_| "nothing came in time")??
            }
        };
        self.last = text;
        Ok(value)
    }

    pub(super) async fn send(&mut self, text: &str) {
        self.stream.send_text(text).await;
    }

    /// The response to a call; the frames before it are kept.
    pub(super) async fn call(&mut self, service: &str, args: &str) -> Result<Value, String> {
        self.send(&format!(
            "{{\"op\":\"call_service\",\"service\":\"{service}\",\"id\":\"the call\",\"args\":{args}}}"
        ))
        .await;
        loop {
            let frame = self.read().await?;
            if frame.1["id"] == "the call" && frame.1["op"] == "service_response" {
                self.last = frame.0;
                return Ok(frame.1);
            }
            self.kept.push_back(frame);
        }
    }

    /// Takes the frames that were received already and all that arrive within `time`.
    pub(super) async fn take_for(&mut self, time: Duration) -> Vec<Value> {
        let end = Instant::now() + time;
        while let Ok(Ok(frame)) = timeout_at(end, self.read()).await {
            let is_end = frame.1 == "the end";
            self.kept.push_back(frame);
            if is_end {
                break;
            }
        }
        self.kept.drain(..).map(|frame| frame.1).collect()
    }

    /// Takes the frames of a time, and checks how many match.
    pub(super) async fn count(
        &mut self,
        given: &str,
        wanted: &str,
        bound: &mut BTreeMap<String, Value>,
    ) -> Result<(), String> {
        let (time, pattern) = given.split_once(' ').ok_or("no pattern")?;
        let time = time.parse().map_err(|_| "no time")?;
        let came = self.take_for(Duration::from_millis(time)).await;
        let is_one = |frame: &&Value| check(pattern, frame, &mut bound.clone()).is_ok();
        let count = came.iter().filter(is_one).count();
        let range = wanted.split_once("..").unwrap_or((wanted, wanted));
        let is_bound =
            wanted.starts_with('$') && matches(&json!(wanted), Some(&json!(count)), bound);
        if is_bound || is_within(range, count as f64) {
            return Ok(());
        }
        Err(format!("{count} came of {}", came.len()))
    }

    /// The frames that have arrived but were not read, without those of periodic topics.
    pub(super) async fn rest(&mut self) -> Vec<Value> {
        let mut rest = self.take_for(SHORT_PATIENCE).await;
        let is_periodic = |value: &Value| PERIODIC.iter().any(|topic| value["topic"] == *topic);
        rest.retain(|value| !is_periodic(value) && *value != "the end");
        rest
    }
}

/// Sends a request, and checks the answer.
pub(super) async fn ask(
    peer: &mut Peer,
    verb: &str,
    [service, args, text, wanted]: [&str; 4],
    bound: &mut BTreeMap<String, Value>,
) -> Result<(), String> {
    match verb {
        "call" => {
            let got = peer.call(service, args).await?;
            check("{\"result\":true,\"status\":\"\"}", &got, bound)?;
            let wanted = if wanted.is_empty() { "{}" } else { wanted };
            check(wanted, &got["values"], bound)?;
        }
        "refused" => {
            let got = peer.call(service, args).await?;
            let status = got["status"].as_str().unwrap_or_default();
            if got["result"] != false || wanted.is_empty() || !status.contains(wanted) {
                return Err(format!("{wanted}: {got}"));
            }
        }
        "goal" => {
            let goal = json!({"op": "send_action_goal", "id": "the goal", "action": service});
            let args = format!(",\"args\":{args}}}");
            peer.send(&goal.to_string().replace('}', &args)).await;
            let got = peer.next().await?;
            let refused = r#"{"op":"action_result","id":"the goal","status":0,"result":false}"#;
            check(refused, &got, bound)?;
            let why = got["values"].as_str().unwrap_or_default();
            if wanted.is_empty() || !why.contains(wanted) {
                return Err(format!("{wanted}: {got}"));
            }
        }
        "error" => {
            peer.send(text).await;
            let got = peer.next().await?;
            let msg = got["msg"].as_str().unwrap_or_default();
            if got["level"] != "error" || wanted.is_empty() || !msg.contains(wanted) {
                return Err(format!("{wanted}: {got}"));
            }
        }
        _ => return Err("no question".to_owned()),
    }
    Ok(())
}
