//! Exchanges of frames between clients and a whole runtime, in virtual time.
//!
//! A text file beside this one has the exchanges of one subject. An exchange begins with `# ` and its statement. It runs against a
//! new runtime with an arm of 2 links, which is paused at its starting pose. A line of it is one step:
//!
//! | step | meaning |
//! | --- | --- |
//! | `a > text` | client `a` sends this frame; clients whose names begin with `w` use WebSocket |
//! | `a < pattern` | the next frame that `a` receives matches |
//! | `a << pattern` | a later frame matches; the frames before it are dropped |
//! | `a ~ text` | the frame that `a` received last contains this text, byte by byte |
//! | `a listen topic` | subscribes to a topic and receives the confirmation |
//! | `a call service args = pattern` | the call succeeds, and its values match |
//! | `a refused service args = text` | the call fails with a status that contains this text |
//! | `a goal action args = text` | the goal is refused with a reason that contains this text |
//! | `a error text = part` | the frame is followed by an error status that contains this part |
//! | `a quiet` | nothing has come |
//! | `a leave` | disconnects |
//! | `pass ms` | virtual time passes |
//!
//! In a sent text, `%3*x%` is `xxx`, `%MAX_NAME*x%` repeats as often as that limit says, `%cr%` is a carriage return, and `$name` is a value that a pattern has bound. A pattern is JSON. An object may have more members
//! than its pattern. The texts `*`, `-`, `~part` and `$name` match any value, no value, a value that contains this part, and the value
//! that the name is bound to. `{"=": value}` matches this value only. At the end, no client has a frame that was not received, other
//! than messages of topics that are published periodically.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use crate::nodes::{start_nodes, work_in_this_thread};
use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, WIDE, settle};
use pendularm::actors::compute::workers::WorkerPool;
use pendularm::actors::gateway::connection::Connection;
use pendularm::actors::gateway::connection::admission::Admission;
use pendularm::actors::gateway::registry::Attach;
use pendularm::actors::ros::tf_web::MAX_FRAMES;
use pendularm::actors::wire::Nodes;
use pendularm::protocol::catalog::{Rosapi, Service};
use pendularm::protocol::limits::{MAX_FRAME, MAX_NAME};
use pendularm::protocol::op::follow::MAX_POINTS;
use pendularm::protocol::ros::parameters::MAX_NAMED;
use pendularm_client::codec::Event;
use pendularm_client::{Error, pipe};
use serde_json::{Value, json};
use tokio::io::{DuplexStream, duplex};
use tokio::time::{sleep, timeout};

/// Virtual time that a frame may take to come.
const PATIENCE: Duration = Duration::from_secs(10);

/// Limits that a repetition may have as its count.
const LIMITS: [(&str, usize); 5] = [
    ("MAX_FRAME", MAX_FRAME),
    ("MAX_FRAMES", MAX_FRAMES),
    ("MAX_NAME", MAX_NAME),
    ("MAX_NAMED", MAX_NAMED),
    ("MAX_POINTS", MAX_POINTS),
];

/// Topics that are published periodically.
const PERIODIC: [&str; 5] = [
    "/joint_states",
    "joint_states",
    "/clock",
    "/tf",
    "/diagnostics",
];

/// A frame: its text, which is empty for a binary message, and its value.
struct Frame(String, Value);

struct Peer {
    stream: pipe::Client<DuplexStream>,
    /// Frames that came while another was awaited, oldest first.
    kept: VecDeque<Frame>,
    last: String,
}

impl Peer {
    async fn read(&mut self) -> Result<Frame, String> {
        loop {
            return match self.stream.next_event().await {
                // Some readers end a line at a carriage return.
                Ok(Event::Text(text)) if text.contains('\r') => Err(format!("two lines: {text}")),
                Ok(Event::Text(text)) => match serde_json::from_str(&text) {
                    Ok(value) => Ok(Frame(text, value)),
                    Err(error) => Err(format!("{error}: {text}")),
                },
                Ok(Event::Binary(bytes)) => {
                    let value = json!({"binary": String::from_utf8_lossy(&bytes)});
                    Ok(Frame(String::new(), value))
                }
                Ok(Event::Ping(_) | Event::Pong(_)) => continue,
                Ok(Event::Close(code, _)) => Ok(Frame(String::new(), json!({"close": code}))),
                Err(Error::Ended) => Ok(Frame(String::new(), json!("the end"))),
                Err(error) => Err(error.to_string()),
            };
        }
    }

    async fn next(&mut self) -> Result<Value, String> {
        let Frame(text, value) = match self.kept.pop_front() {
            Some(frame) => frame,
            None => self.read().await?,
        };
        self.last = text;
        Ok(value)
    }

    async fn send(&mut self, text: &str) {
        self.stream.send_text(text).await;
    }

    /// The response to a call; the frames before it are kept.
    async fn call(&mut self, service: &str, args: &str) -> Result<Value, String> {
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

    /// The frames that have come and were not received, without those of periodic topics.
    async fn rest(&mut self) -> Vec<Value> {
        settle().await;
        while let Ok(Ok(frame)) = timeout(Duration::from_millis(1), self.read()).await {
            let is_end = frame.1 == "the end";
            self.kept.push_back(frame);
            if is_end {
                break;
            }
        }
        let is_periodic = |value: &Value| PERIODIC.iter().any(|topic| value["topic"] == *topic);
        let rest = self.kept.drain(..).map(|frame| frame.1);
        rest.filter(|value| !is_periodic(value) && *value != "the end")
            .collect()
    }
}

/// A runtime, its clients by their names, and the values that patterns have bound.
struct World {
    gateway: Gateway,
    peers: BTreeMap<String, Peer>,
    bound: BTreeMap<String, Value>,
}

impl World {
    async fn start() -> Self {
        let gateway = Gateway::bare().await;
        let registry = gateway.registry.clone();
        let pool = WorkerPool::without_threads();
        let mut nodes = Nodes::default();
        start_nodes::<2>(&registry, &gateway.gauges, &pool, 1, &mut nodes);
        registry.send(Attach(nodes)).await.unwrap();
        work_in_this_thread(pool);
        let (peers, bound) = (BTreeMap::new(), BTreeMap::new());
        Self {
            gateway,
            peers,
            bound,
        }
    }

    async fn connect(&self, name: &str) -> Peer {
        let (ours, theirs) = duplex(WIDE);
        let (registry, gauges) = (
            self.gateway.registry.clone(),
            Arc::clone(&self.gateway.gauges),
        );
        let local = SocketAddr::from(([127, 0, 0, 1], 9095));
        let admission = Arc::<Admission>::default();
        Connection::start_with(admission, local, theirs, registry, gauges);
        let stream = if name.starts_with('w') {
            pipe::Client::web_on(ours, PATIENCE, "127.0.0.1:9095", "/").await
        } else {
            pipe::Client::on(ours, PATIENCE)
        };
        Peer {
            stream,
            kept: VecDeque::new(),
            last: String::new(),
        }
    }

    async fn step(&mut self, line: &str) -> Result<(), String> {
        let (name, rest) = line.split_once(' ').ok_or("no step")?;
        if name == "pass" {
            sleep(Duration::from_millis(rest.parse().map_err(|_| "no time")?)).await;
            return Ok(());
        }
        if !self.peers.contains_key(name) {
            let peer = self.connect(name).await;
            self.peers.insert(name.to_owned(), peer);
        }
        let peer = self.peers.get_mut(name).ok_or("no client")?;
        let (verb, rest) = rest.split_once(' ').unwrap_or((rest, ""));
        let (given, wanted) = rest.split_once(" = ").unwrap_or((rest, ""));
        let (service, args) = given.split_once(' ').unwrap_or((given, "{}"));
        let args = expand(args, &self.bound);
        match verb {
            ">" => {
                peer.send(&expand(rest, &self.bound)).await;
                settle().await;
            }
            "<" => {
                let got = peer.next().await?;
                check(rest, &got, &mut self.bound)?;
            }
            "<<" => {
                let later = async {
                    while check(rest, &peer.next().await?, &mut self.bound).is_err() {}
                    Ok::<_, String>(())
                };
                // Periodic messages never end.
                let came = timeout(PATIENCE, later).await;
                came.map_err(|_| "it did not come".to_owned())??;
            }
            "~" if peer.last.contains(rest) => {}
            "~" => return Err(format!("not in {}", peer.last)),
            "listen" => {
                peer.send(&json!({"op": "subscribe", "topic": rest}).to_string())
                    .await;
                let got = peer.next().await?;
                check(
                    "{\"op\":\"status\",\"level\":\"info\"}",
                    &got,
                    &mut self.bound,
                )?;
            }
            "call" | "refused" | "goal" | "error" => {
                let text = expand(given, &self.bound);
                ask(peer, verb, [service, &args, &text, wanted], &mut self.bound).await?;
            }
            "quiet" => {
                let rest = peer.rest().await;
                if !rest.is_empty() {
                    return Err(format!("came too: {rest:?}"));
                }
            }
            "leave" => {
                self.peers.remove(name);
                settle().await;
            }
            _ => return Err("no step".to_owned()),
        }
        Ok(())
    }
}

/// Asks something, and checks the answer.
async fn ask(
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

/// A text as it is sent.
fn expand(text: &str, bound: &BTreeMap<String, Value>) -> String {
    let mut text = text.to_owned();
    for (name, value) in bound {
        text = text.replace(&format!("${name}"), &value.to_string());
    }
    while let Some((before, rest)) = text.split_once('%') {
        let (repeated, after) = rest.split_once('%').expect("an end of the repetition");
        let (count, part) = repeated.split_once('*').unwrap_or(("1", "\r"));
        let limit = LIMITS.iter().find(|(name, _)| *name == count);
        let count = limit.map_or_else(|| count.parse().expect("a count"), |(_, limit)| *limit);
        text = format!("{before}{}{after}", part.repeat(count));
    }
    text
}

fn check(pattern: &str, got: &Value, bound: &mut BTreeMap<String, Value>) -> Result<(), String> {
    let wanted = serde_json::from_str(pattern).map_err(|error| format!("{error}: {pattern}"))?;
    if matches(&wanted, Some(got), bound) {
        return Ok(());
    }
    Err(format!("{pattern}: {got}"))
}

fn matches(wanted: &Value, got: Option<&Value>, bound: &mut BTreeMap<String, Value>) -> bool {
    let Some(got) = got else { return wanted == "-" };
    match (wanted, got) {
        (Value::String(text), _) => match text.split_at_checked(1) {
            Some(("*", "")) => true,
            Some(("~", part)) => got
                .as_str()
                .map_or_else(|| got.to_string(), str::to_owned)
                .contains(part),
            Some(("$", name)) => bound.entry(name.to_owned()).or_insert_with(|| got.clone()) == got,
            _ => text == got,
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

/// Runs the exchanges of a file; each that fails is named with its line.
fn play(file: &str) {
    let path = format!(
        "{}/tests/actors/exchanges/{file}.txt",
        env!("CARGO_MANIFEST_DIR")
    );
    let text = std::fs::read_to_string(&path).unwrap();
    let lines: Vec<(usize, &str)> = text.lines().enumerate().collect();
    let mut failures = Vec::new();
    for exchange in lines
        .split(|(_, line)| line.is_empty())
        .filter(|lines| !lines.is_empty())
    {
        let ((_, title), steps) = exchange.split_first().unwrap();
        assert!(title.starts_with("# "), "{file}: no title: {title}");
        let failure = in_virtual_time(async {
            let mut world = World::start().await;
            for quiet in ["/arm_sim/pause {\"data\":true}", "/arm_sim/reset"] {
                world.step(&format!("first call {quiet}")).await?;
            }
            for (number, line) in steps {
                let at = |why| format!("{file}.txt:{}: {line}: {why}", number + 1);
                world.step(line).await.map_err(at)?;
            }
            for (name, peer) in &mut world.peers {
                let rest = peer.rest().await;
                if !rest.is_empty() {
                    return Err(format!("{file}: {title}: {name} also received {rest:?}"));
                }
            }
            Ok(())
        });
        failures.extend(failure.err());
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn topics_of_clients() {
    play("topics");
}

#[test]
fn services_of_clients() {
    play("services");
}

#[test]
fn actions_of_clients_and_of_the_runtime() {
    play("actions");
}

#[test]
fn frames_in_pieces_and_malformed_frames() {
    play("frames");
}

#[test]
fn names_and_ids() {
    play("names");
}

#[test]
fn rosapi_and_parameters() {
    play("rosapi");
}

#[test]
fn what_the_arm_publishes_and_refuses() {
    play("arm");
}

#[cfg(feature = "web")]
#[test]
fn exchanges_over_websocket() {
    play("web");
}

/// Under either prefix, and with or without the leading slash.
#[test]
fn every_question_of_rosapi_is_answered_with_the_fields_of_the_catalogue() {
    in_virtual_time(async {
        let mut peer = World::start().await.connect("a").await;
        for question in Rosapi::ALL {
            let service = Service::Rosapi(question);
            let argument = match question {
                Rosapi::MessageDetails => "sensor_msgs/msg/JointState",
                Rosapi::ServiceRequestDetails | Rosapi::ServiceResponseDetails => {
                    "pendularm_interfaces/srv/SetParams"
                }
                Rosapi::ActionGoalDetails
                | Rosapi::ActionResultDetails
                | Rosapi::ActionFeedbackDetails => "pendularm_interfaces/action/MoveTo",
                _ => "/x",
            };
            let required = service.fields().iter().filter(|field| field.required);
            let args: BTreeMap<_, _> = required.map(|field| (field.name, argument)).collect();
            let listed: BTreeSet<_> = service
                .response_fields()
                .iter()
                .map(|one| one.name)
                .collect();
            for prefix in ["/rosapi/", "/rosapi_node/", "rosapi/", "rosapi_node/"] {
                let name = format!("{prefix}{}", question.short_name());
                let answer = peer.call(&name, &json!(args).to_string()).await.unwrap();
                let given = answer["values"].as_object().unwrap().keys();
                assert_eq!(
                    given.map(String::as_str).collect::<BTreeSet<_>>(),
                    listed,
                    "{answer}"
                );
                assert_eq!(answer["result"], true, "{answer}");
            }
        }
    });
}
