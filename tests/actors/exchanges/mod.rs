//! Exchanges of frames between clients and a whole runtime, in virtual time.
//!
//! A text file beside this one has the exchanges of one subject. An exchange begins with `# ` and its statement. It runs against a
//! new runtime with an arm of 2 links, which is paused at its starting pose. If its first step is `3 links`, the arm has 3. A line of it is one
//! step:
//!
//! | step | meaning |
//! | --- | --- |
//! | `a > text` | client `a` sends this frame; clients whose names begin with `w` use WebSocket |
//! | `a bytes text` | client `a` sends this text without a line end |
//! | `a < pattern` | the next frame that `a` receives matches |
//! | `a << pattern` | a later frame matches; the frames before it are dropped |
//! | `a ~ text` | the frame that `a` received last contains this text, byte by byte |
//! | `a listen topic` | subscribes to a topic and receives the confirmation |
//! | `a call service args = pattern` | the call succeeds, and its values match |
//! | `a refused service args = text` | the call fails with a status that contains this text |
//! | `a goal action args = text` | the goal is refused with a reason that contains this text |
//! | `a error text = part` | the frame is followed by an error status that contains this part |
//! | `a quiet` | nothing has come |
//! | `a forget` | all frames that have come are dropped |
//! | `a count ms pattern = 3` | time passes, and this number of the frames that have come by then match; all of them are dropped |
//! | `a leave` | disconnects |
//! | `options text` | from here on clients are admitted as with these options; as a first step, the arm is neither paused nor reset |
//! | `request text = 200,404 part` | a new connection sends this request and ends; the answers have these statuses, and contain this part, or with `!` do not |
//! | `pass ms` | virtual time passes |
//! | `stall ms` | virtual time passes, and no actor runs in it |
//! | `floating` | gravity and gains are zero and the controller is on: an arm at rest stays where it is |
//! | `for x \| y in 1 \| a; 2 \| b` | the steps up to `end` run once for each row, with its values in place of `@x` and `@y` |
//! | `for x in 0..9` | the same for each number, without the last, which may be a limit |
//! | `for x in` | the same for each row of the lines below it, which begin with `\| ` |
//!
//! A file may begin with lines `let name = text`: `@name` stands for that text in each step.
//!
//! The text of a request has the escapes of JSON. The first answer to it has the headers that keep a browser
//! strict.
//!
//! In a sent text, `%3*x%` is `xxx`, `%MAX_NAME*x%` repeats as often as that limit says, `%cr%` is a carriage return, `%lf%` is a line feed, and
//! `$name` is a value that a pattern has bound. A pattern is JSON. An object may have more members than its pattern. The texts `*`, `-`, `~part`
//! and `$name` match any value, no value, a value that contains this part, and the value that the name is bound to. The text `1..2` matches
//! numbers from 1 to 2, also as texts. `{"=": value}` matches this value only. At the end, no client has a frame that was not received, other than messages of
//! topics that are published periodically.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use crate::nodes::{start_whole, work_in_this_thread};
use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, WIDE, settle};
use pendularm::actors::gateway::connection::Connection;
use pendularm::actors::gateway::connection::admission::{Admission, MAX_AUTH_BYTES};
use pendularm::actors::ros::tf_web::{MAX_FRAMES, MAX_WISHES};
use pendularm::math::pid::Gains;
use pendularm::options::{Options, Parsed};
use pendularm::protocol::catalog::{Rosapi, Service};
use pendularm::protocol::limits::{MAX_FRAME, MAX_NAME};
use pendularm::protocol::op::follow::MAX_POINTS;
use pendularm::protocol::ros::parameters::MAX_NAMED;
#[cfg(feature = "web")]
use pendularm::web::{Site, access::Access};
use pendularm_client::codec::Event;
use pendularm_client::{Error, pipe};
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream, duplex};
use tokio::time::{Instant, advance, sleep, timeout, timeout_at};

/// Virtual time that a frame may take to come.
const PATIENCE: Duration = Duration::from_secs(10);
/// Virtual time in which all that is under way arrives.
const SOON: Duration = Duration::from_millis(10);

/// Limits that a repetition or a loop may have as its count.
const LIMITS: [(&str, usize); 7] = [
    ("MAX_AUTH_BYTES", MAX_AUTH_BYTES),
    ("MAX_FRAME", MAX_FRAME),
    ("MAX_FRAMES", MAX_FRAMES),
    ("MAX_NAME", MAX_NAME),
    ("MAX_NAMED", MAX_NAMED),
    ("MAX_POINTS", MAX_POINTS),
    ("MAX_WISHES", MAX_WISHES),
];

/// Topics that are published periodically.
const PERIODIC: [&str; 5] = [
    "/joint_states",
    "joint_states",
    "/clock",
    "/tf",
    "/diagnostics",
];

/// Headers that every answer over HTTP has, in lower case.
#[cfg(feature = "web")]
const STRICT: [&str; 8] = [
    "\r\nx-content-type-options: nosniff",
    "\r\nx-frame-options: deny",
    "\r\ncross-origin-resource-policy: same-origin",
    "\r\ncross-origin-opener-policy: same-origin",
    "\r\nreferrer-policy: no-referrer",
    "\r\ncache-control: no-store",
    "default-src 'none'",
    "frame-ancestors 'none'",
];
/// Beginnings of headers that no answer has.
#[cfg(feature = "web")]
const NEVER: [&str; 2] = ["\r\naccess-control-", "\r\nserver:"];

/// The conditions of these options.
pub fn admission(options: &str) -> Result<Admission, String> {
    let arguments = std::iter::once("pendularm").chain(options.split(' '));
    let options = match Options::parse(arguments) {
        Ok(Parsed::Serve(options)) => *options,
        other => return Err(format!("{other:?}")),
    };
    Ok(Admission {
        #[cfg(feature = "web")]
        site: {
            let access = Access {
                token: options.token.clone(),
                hosts: options.web.hosts,
                origins: options.web.origins,
                strict_origin: options.web.strict_origin,
            };
            Site::new(access, "no-report".into(), &options.web.frames)
        },
        token: options.token,
        ..Admission::default()
    })
}

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

    /// Takes the frames that were received already and all that arrive within `time`.
    async fn take_for(&mut self, time: Duration) -> Vec<Value> {
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
    async fn count(
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

    /// The frames that have come and were not received, without those of periodic topics.
    async fn rest(&mut self) -> Vec<Value> {
        let mut rest = self.take_for(SOON).await;
        let is_periodic = |value: &Value| PERIODIC.iter().any(|topic| value["topic"] == *topic);
        rest.retain(|value| !is_periodic(value) && *value != "the end");
        rest
    }
}

/// A runtime, its clients by their names, and the values that patterns have bound.
struct World {
    gateway: Gateway,
    links: usize,
    admission: Arc<Admission>,
    peers: BTreeMap<String, Peer>,
    bound: BTreeMap<String, Value>,
}

impl World {
    async fn start<const N: usize>() -> Self
    where
        Gains<N>: Default,
    {
        let gateway = Gateway::bare().await;
        let (registry, gauges) = (&gateway.registry, &gateway.gauges);
        work_in_this_thread(start_whole::<N>(registry, gauges, 1).await.pool);
        let (peers, bound) = (BTreeMap::new(), BTreeMap::new());
        Self {
            gateway,
            links: N,
            admission: Arc::default(),
            peers,
            bound,
        }
    }

    /// The client's end of a new connection.
    fn open(&self) -> DuplexStream {
        let (ours, theirs) = duplex(WIDE);
        let (registry, gauges) = (
            self.gateway.registry.clone(),
            Arc::clone(&self.gateway.gauges),
        );
        let local = SocketAddr::from(([127, 0, 0, 1], 9095));
        Connection::start_with(Arc::clone(&self.admission), local, theirs, registry, gauges);
        ours
    }

    async fn connect(&self, name: &str) -> Peer {
        let ours = self.open();
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

    /// Sends a request and checks its answers.
    #[cfg(feature = "web")]
    async fn request(&self, text: &str, wanted: &str) -> Result<(), String> {
        let text: String = serde_json::from_str(&format!("\"{text}\"")).map_err(|_| "no text")?;
        let mut stream = self.open();
        stream
            .write_all(text.as_bytes())
            .await
            .map_err(|_| "closed")?;
        stream.shutdown().await.map_err(|_| "closed")?;
        let mut came = Vec::new();
        let reading = timeout(PATIENCE, stream.read_to_end(&mut came));
        reading
            .await
            .map_err(|_| "no end")?
            .map_err(|_| "no orderly end")?;
        let came = String::from_utf8_lossy(&came);
        let answers: Vec<&str> = came.split("HTTP/1.").skip(1).collect();
        let statuses = answers.iter().filter_map(|answer| answer.get(2..5));
        let statuses = statuses.collect::<Vec<_>>().join(",");
        let (expected, part) = wanted.split_once(' ').unwrap_or((wanted, ""));
        let has_part = part
            .strip_prefix('!')
            .map_or_else(|| came.contains(part), |part| !came.contains(part));
        if statuses != expected || !has_part {
            return Err(format!("{statuses}: {came}"));
        }
        let first = answers.first().copied().unwrap_or_default();
        let head = first.to_ascii_lowercase();
        let head = head.split("\r\n\r\n").next().unwrap_or_default();
        let is_strict = STRICT.iter().all(|line| head.contains(line))
            && NEVER.iter().all(|line| !head.contains(line))
            && (head.contains("200 ok") || !head.contains("set-cookie"));
        if expected == "101" || is_strict {
            Ok(())
        } else {
            Err(format!("not strict: {first}"))
        }
    }

    async fn step(&mut self, line: &str) -> Result<(), String> {
        let (name, rest) = line.split_once(' ').unwrap_or((line, ""));
        let time = || rest.parse().map(Duration::from_millis);
        match name {
            "options" => self.admission = Arc::new(admission(rest)?),
            #[cfg(feature = "web")]
            "request" => {
                let (text, wanted) = rest.split_once(" = ").ok_or("no status")?;
                self.request(text, wanted).await?;
            }
            "floating" => {
                let none = json!(vec![0; self.links]);
                let gains = json!({"kp": none, "ki": none, "kd": none});
                for call in [
                    "call /arm_sim/set_params {\"gravity\":0}",
                    &format!("call /pid_controller/set_gains {gains}"),
                    "call /pid_controller/enable {\"data\":true}",
                ] {
                    self.step_of("first", call).await?;
                }
            }
            "pass" => sleep(time().map_err(|_| "no time")?).await,
            "stall" => advance(time().map_err(|_| "no time")?).await,
            _ => self.step_of(name, rest).await?,
        }
        Ok(())
    }

    /// A step of a client, which is connected with its first one.
    async fn step_of(&mut self, name: &str, rest: &str) -> Result<(), String> {
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
            "bytes" => {
                let text = expand(rest, &self.bound);
                peer.stream.send_bytes(text.as_bytes()).await;
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
            "forget" => drop(peer.take_for(SOON).await),
            "count" => peer.count(given, wanted, &mut self.bound).await?,
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

/// A number, or the limit of that name.
fn number(text: &str) -> Option<usize> {
    let limit = LIMITS.iter().find(|(name, _)| *name == text);
    limit.map_or_else(|| text.parse().ok(), |(_, limit)| Some(*limit))
}

/// The text to send.
fn expand(text: &str, bound: &BTreeMap<String, Value>) -> String {
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

fn check(pattern: &str, got: &Value, bound: &mut BTreeMap<String, Value>) -> Result<(), String> {
    let wanted = serde_json::from_str(pattern).map_err(|error| format!("{error}: {pattern}"))?;
    if matches(&wanted, Some(got), bound) {
        return Ok(());
    }
    Err(format!("{pattern}: {got}"))
}

/// Whether a number is within the range between two texts.
fn is_within((low, high): (&str, &str), number: f64) -> bool {
    let bounds = low.parse::<f64>().ok().zip(high.parse::<f64>().ok());
    bounds.is_some_and(|(low, high)| (low..=high).contains(&number))
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

/// A step and the number of its line.
type Step = (usize, String);

/// The steps with their loops unrolled.
fn unroll(mut steps: &[Step]) -> Vec<Step> {
    let mut all = Vec::new();
    while let Some((step, rest)) = steps.split_first() {
        steps = rest;
        let Some(header) = step.1.strip_prefix("for ") else {
            all.push(step.clone());
            continue;
        };
        let (names, rows) = header.split_once(" in").expect("a loop has values");
        let count = steps.iter().take_while(|(_, line)| line.starts_with("| "));
        let (below, rest) = steps.split_at(count.count());
        let range = rows
            .split_once("..")
            .and_then(|(first, end)| Some(number(first.trim())?..number(end)?));
        let rows: Vec<String> = match range {
            Some(range) => range.map(|number| number.to_string()).collect(),
            None if rows.is_empty() => below.iter().map(|(_, line)| line[2..].to_owned()).collect(),
            None => rows.trim().split("; ").map(str::to_owned).collect(),
        };
        let mut depth = 1;
        let ends = |(_, line): &Step| {
            depth += i32::from(line.starts_with("for ")) - i32::from(line == "end");
            depth == 0
        };
        let length = rest.iter().position(ends).expect("a loop has an end");
        for row in rows {
            let values: Vec<(&str, &str)> = names.split(" | ").zip(row.split(" | ")).collect();
            let body = rest[..length].iter();
            let body = body.map(|(number, line)| (*number, replace(line, &values)));
            all.extend(unroll(&body.collect::<Vec<_>>()));
        }
        steps = &rest[length + 1..];
    }
    all
}

/// The line with values in place of the names.
fn replace(line: &str, values: &[(&str, &str)]) -> String {
    values.iter().fold(line.to_owned(), |line, (name, value)| {
        line.replace(&format!("@{name}"), value)
    })
}

/// Runs one exchange.
async fn run<const N: usize>(file: &str, title: &str, steps: &[Step]) -> Result<(), String>
where
    Gains<N>: Default,
{
    let mut world = World::start::<N>().await;
    let is_guarded = steps
        .first()
        .is_some_and(|(_, step)| step.starts_with("options "));
    for quiet in ["/arm_sim/pause {\"data\":true}", "/arm_sim/reset"] {
        if !is_guarded {
            world.step(&format!("first call {quiet}")).await?;
        }
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
}

/// Runs the exchanges of a file; each that fails is named with its line.
fn play(file: &str) {
    let path = format!("{}/exchanges/{file}.txt", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap();
    let named = text.lines().map_while(|line| line.strip_prefix("let "));
    let named: Vec<(&str, &str)> = named.map(|line| line.split_once(" = ").unwrap()).collect();
    let lines: Vec<Step> = text
        .lines()
        .map(|line| replace(line, &named))
        .enumerate()
        .skip(named.len())
        .collect();
    let mut failures = Vec::new();
    for exchange in lines
        .split(|(_, line)| line.is_empty())
        .filter(|lines| !lines.is_empty())
    {
        let ((_, title), steps) = exchange.split_first().unwrap();
        assert!(title.starts_with("# "), "{file}: no title: {title}");
        let failure = match unroll(steps).as_slice() {
            [(_, first), steps @ ..] if first == "3 links" => {
                in_virtual_time(run::<3>(file, title, steps))
            }
            steps => in_virtual_time(run::<2>(file, title, steps)),
        };
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

#[test]
fn goals_of_inverse_kinematics() {
    play("goals");
}

#[test]
fn trials() {
    play("trials");
}

#[test]
fn paths() {
    play("paths");
}

#[test]
fn frames_for_web_viewers() {
    play("tf_web");
}

#[cfg(feature = "web")]
#[test]
fn exchanges_over_websocket() {
    play("web");
}

#[cfg(feature = "web")]
#[test]
fn requests_over_http() {
    play("http");
}

/// Under either prefix, and with or without the leading slash.
#[test]
fn every_question_of_rosapi_is_answered_with_the_fields_of_the_catalogue() {
    in_virtual_time(async {
        let mut peer = World::start::<2>().await.connect("a").await;
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
