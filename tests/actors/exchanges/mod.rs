//! Exchanges of frames between clients and a whole runtime, in virtual time.
//!
//! A text file beside this one has the exchanges of one subject. An exchange begins with `# ` and its statement, which is
//! the name of its test, and ends with an empty line. It runs against a
//! new runtime with an arm of 2 links, which is paused at its starting pose. If its first step is `3 links`, the arm has 3. A line of it is one
//! step:
//!
//! | step | meaning |
//! | --- | --- |
//! | `a > text` | client `a` sends this frame; clients whose names begin with `w` use WebSocket |
//! | `a bytes text` | client `a` sends this text without a line end |
//! | `w raw text` | sends the bytes of this text, which has the escapes of JSON: `\u0089` is one byte |
//! | `a < pattern` | the next frame that `a` receives matches |
//! | `a << pattern` | a later frame matches; the frames before it are dropped |
//! | `a ~ text` | the frame that `a` received last contains this text, byte by byte |
//! | `a told text` | client `a` sends this frame, and the next frame that it receives is a status that informs it |
//! | `a listen topic` | subscribes to a topic and receives the confirmation |
//! | `a call service args = pattern` | the call succeeds, and its values match |
//! | `a refused service args = text` | the call fails with a status that contains this text |
//! | `a goal action args = text` | the goal is refused with a reason that contains this text |
//! | `a error text = part` | the frame is followed by an error status that contains this part |
//! | `a quiet` | no frame has arrived |
//! | `a forget` | all received frames are dropped |
//! | `a count ms pattern = 3` | time passes, and this number of the frames received by then match; all of them are dropped |
//! | `a leave` | disconnects |
//! | `options text` | from here on clients are admitted as with these options; as a first step, the arm is neither paused nor reset |
//! | `request text = 200,404 part` | a new connection sends this request and ends; the answers have these statuses, and contain this part, or with `!` do not |
//! | `pass ms` | virtual time passes |
//! | `stall ms` | virtual time passes, and no actor runs in it |
//! | `mark`, `elapsed 1..2` | at `elapsed`, this many ms have passed since `mark` |
//! | `a room n`, `a take n` | connects by a pipe that holds this many bytes, takes this many out of it |
//! | `a finish` | stops sending |
//! | `a read 200,404 part` | the bytes up to the end are answers to requests, as those of `request` |
//! | `held`, `memory frames bytes` | as a first step: in place of all nodes there are two that keep their calls, `steps` of `/arm_sim/integration_step` and `params` of `/arm_sim/set_params`; with `memory`, all clients share this memory |
//! | `steps = 1`, `params = 1` | this many calls are kept |
//! | `answer steps json` | the oldest of them succeeds with these values, or with none, and ends; `reply` leaves it open until `release`, `refuse steps why` refuses it, `lose steps` drops it, and `gone steps` drops it if its client has left |
//! | `connections = 1`, `dropped = 1`, `taken = 1` | clients that are served, messages that were dropped, memory for long frames and answers that is taken, in whole frames of 4 MiB |
//! | `workers busy`, `workers full`, `workers free` | from here on all threads for long frames and for lists are occupied, or those for medium ones too, or none |
//! | `shutting down`, `finish all` | the two messages by which the runtime ends its clients |
//! | `floating` | gravity and gains are zero and the controller is on: an arm at rest stays where it is |
//! | `for x \| y in 1 \| a; 2 \| b` | the steps up to `end` run once for each row, with its values in place of `@x` and `@y` |
//! | `for x in 1; 2 do step` | the same for this one step |
//! | `for x in 0..9` | the same for each number, without the last, which may be a limit |
//! | `for x in` | the same for each row of the lines below it, which begin with `\| ` |
//!
//! A file may begin with lines `let name = text`: `@name` is that text in each step.
//!
//! The text of a request has the escapes of JSON. The first answer to it has the headers that keep a browser
//! strict.
//!
//! A number may be a limit by its name, times in ms, and `LIMIT - 1` or `LIMIT + 1`. In a sent text, `%3*x%` is `xxx`, and
//! `%MAX_NAME*x%` repeats `x` up to that limit. `%cr%` is a carriage return, `%lf%` is a line feed, and `$name` is a value
//! that a pattern has bound. A pattern is JSON. An object may have more members than its pattern. The texts `*`, `-`, `~part`
//! and `$name` match any value, no value, a value that contains this part, and the value that the name is bound to. The text `1..2` matches
//! numbers from 1 to 2, also as texts. `{"=": value}` matches this value only. At the end, no client has a frame that was not received, other than messages of
//! topics that are published periodically.

mod held;
mod patterns;
mod peer;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use self::held::KeptCalls;
use self::patterns::{check, expand, number, range};
use self::peer::{LONG_PATIENCE, Peer, SHORT_PATIENCE, ask};
use crate::stage::Stage;
use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, WIDE, settle};
use pendularm::actors::gateway::connection::admission::Admission;
use pendularm::actors::gateway::registry::{FinishAll, RefuseCalls};
use pendularm::actors::resources::long_work::{THREADS_OF_A_KIND, WorkKind, WorkPermit};
use pendularm::actors::resources::memory::Memory;
use pendularm::options::{Options, Parsed};
use pendularm::protocol::catalog::{Rosapi, Service};
#[cfg(feature = "web")]
use pendularm::web::Site;
use pendularm_client::pipe;
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream};
use tokio::time::{Instant, advance, sleep, timeout};

/// Longest virtual time until a frame arrives after others.
const PATIENCE: Duration = Duration::from_secs(10);
/// Longest delay of an event after its time \[ms\].
const GRAIN: usize = 20;

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
fn admission(options: &str) -> Result<Admission, String> {
    let arguments = std::iter::once("pendularm").chain(options.split(' '));
    let options = match Options::parse(arguments) {
        Ok(Parsed::Serve(options)) => *options,
        other => return Err(format!("{other:?}")),
    };
    Ok(Admission {
        #[cfg(feature = "web")]
        site: {
            let mut access = options.access;
            access.token.clone_from(&options.token);
            Site::new(access, "no-report".into(), &options.allow_frame)
        },
        token: options.token,
        ..Admission::default()
    })
}

/// Checks the statuses of the answers over HTTP, and a part of them.
#[cfg(feature = "web")]
fn answers(came: &str, wanted: &str) -> Result<(), String> {
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

/// A runtime, its clients by their names, and the values that patterns have bound.
struct World {
    gateway: Gateway,
    links: usize,
    admission: Arc<Admission>,
    peers: BTreeMap<String, Peer>,
    bound: BTreeMap<String, Value>,
    kept: KeptCalls,
    marked: Instant,
    /// The places for long work that are occupied.
    busy: Vec<WorkPermit>,
}

impl World {
    async fn start<const N: usize>() -> Self {
        let stage = Stage::<N>::start().await;
        stage.compute();
        Self::at(stage.gateway, N, KeptCalls::default())
    }

    /// A gateway with the two nodes that keep their calls.
    async fn held(memory: Memory) -> Self {
        let kept = KeptCalls::default();
        Self::at(kept.gateway(memory).await, 2, kept)
    }

    fn at(gateway: Gateway, links: usize, kept: KeptCalls) -> Self {
        Self {
            gateway,
            links,
            admission: Arc::default(),
            peers: BTreeMap::new(),
            bound: BTreeMap::new(),
            kept,
            marked: Instant::now(),
            busy: Vec::new(),
        }
    }

    fn open(&self, room: usize) -> DuplexStream {
        self.gateway.open(Arc::clone(&self.admission), room)
    }

    async fn connect(&self, name: &str, room: usize) -> Peer {
        let ours = self.open(room);
        let stream = if name.starts_with('w') {
            pipe::Client::web_on(ours, LONG_PATIENCE).await
        } else {
            pipe::Client::on(ours, LONG_PATIENCE)
        };
        Peer::new(stream)
    }

    /// Sends a request and checks its answers.
    #[cfg(feature = "web")]
    async fn request(&self, text: &str, wanted: &str) -> Result<(), String> {
        let text: String = serde_json::from_str(&format!("\"{text}\"")).map_err(|_| "no text")?;
        let mut stream = self.open(WIDE);
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
        answers(&String::from_utf8_lossy(&came), wanted)
    }

    async fn step(&mut self, line: &str) -> Result<(), String> {
        let (name, rest) = line.split_once(' ').unwrap_or((line, ""));
        let time = || number(rest).map(|ms| Duration::from_millis(ms as u64));
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
            "pass" => sleep(time().ok_or("no time")?).await,
            "stall" => advance(time().ok_or("no time")?).await,
            "mark" => self.marked = Instant::now(),
            "elapsed" => {
                let (low, high) = range(rest).ok_or("no time")?;
                let elapsed = self.marked.elapsed();
                let high = if low == high { high + GRAIN } else { high };
                if !(low..=high).contains(&(elapsed.as_millis() as usize)) {
                    return Err(format!("{elapsed:?}"));
                }
            }
            "connections" | "dropped" | "taken" | "steps" | "params" => {
                self.kept
                    .count(&self.gateway, name, &expand(rest, &self.bound))?;
            }
            "answer" | "reply" | "refuse" | "lose" | "gone" => self.kept.decide(name, rest).await?,
            "release" => self.kept.release().await,
            "workers" => {
                self.busy.clear();
                let kinds: &[_] = match rest {
                    "full" => &[WorkKind::Long, WorkKind::Listing, WorkKind::Usual],
                    "busy" => &[WorkKind::Long, WorkKind::Listing],
                    _ => &[],
                };
                for kind in kinds.repeat(THREADS_OF_A_KIND) {
                    self.busy.extend(WorkPermit::take(kind).await);
                }
                settle().await;
            }
            "shutting" => {
                let refuse = RefuseCalls("shutting down");
                let sent = self.gateway.registry.send(refuse).await;
                sent.map_err(|error| error.to_string())?;
            }
            "finish" => {
                let sent = self.gateway.registry.send(FinishAll).await;
                sent.map_err(|error| error.to_string())?;
                settle().await;
            }
            _ => self.step_of(name, rest).await?,
        }
        Ok(())
    }

    /// A step of a client, which is connected with its first one.
    async fn step_of(&mut self, name: &str, rest: &str) -> Result<(), String> {
        if !self.peers.contains_key(name) {
            let room = rest.strip_prefix("room ").map_or(Some(WIDE), number);
            let peer = self.connect(name, room.ok_or("no room")?).await;
            self.peers.insert(name.to_owned(), peer);
        }
        let peer = self.peers.get_mut(name).ok_or("no client")?;
        let (verb, rest) = rest.split_once(' ').unwrap_or((rest, ""));
        let (given, wanted) = rest.split_once(" = ").unwrap_or((rest, ""));
        let (service, args) = given.split_once(' ').unwrap_or((given, "{}"));
        match verb {
            ">" => {
                peer.send(&expand(rest, &self.bound)).await;
                settle().await;
            }
            "bytes" => {
                let text = expand(rest, &self.bound);
                peer.stream.send_bytes(text.as_bytes()).await;
            }
            "raw" => {
                let text: String =
                    serde_json::from_str(&format!("\"{}\"", expand(rest, &self.bound)))
                        .map_err(|error| error.to_string())?;
                let bytes: Vec<u8> = text.chars().map(|one| one as u8).collect();
                peer.stream.send_bytes(&bytes).await;
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
            "listen" | "told" => {
                let subscribe = json!({"op": "subscribe", "topic": rest}).to_string();
                let told = expand(rest, &self.bound);
                peer.send(if verb == "told" { &told } else { &subscribe })
                    .await;
                let got = peer.next().await?;
                check(
                    "{\"op\":\"status\",\"level\":\"info\"}",
                    &got,
                    &mut self.bound,
                )?;
            }
            "call" | "refused" | "goal" | "error" => {
                let [name, args, text] = [service, args, given].map(|it| expand(it, &self.bound));
                ask(peer, verb, [&name, &args, &text, wanted], &mut self.bound).await?;
            }
            "quiet" => {
                let rest = peer.rest().await;
                if !rest.is_empty() {
                    return Err(format!("came too: {rest:?}"));
                }
            }
            "forget" => drop(peer.take_for(SHORT_PATIENCE).await),
            "room" => {}
            "take" => {
                let mut bytes = vec![0; number(rest).ok_or("no number")?];
                let taken = peer.stream.stream().read_exact(&mut bytes).await;
                taken.map_err(|error| error.to_string())?;
                settle().await;
            }
            "finish" => {
                peer.stream.finish().await;
                settle().await;
            }
            #[cfg(feature = "web")]
            "read" => {
                let mut bytes = Vec::new();
                let reading = peer.stream.stream().read_to_end(&mut bytes);
                let read = timeout(LONG_PATIENCE, reading).await;
                read.map_err(|_| "no end")?.map_err(|_| "no orderly end")?;
                answers(&String::from_utf8_lossy(&bytes), rest)?;
            }
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
        let (header, only) = match header.split_once(" do ") {
            Some((header, only)) => (header, Some([(step.0, only.to_owned())])),
            None => (header, None),
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
            let begins = line.starts_with("for ") && !line.contains(" do ");
            depth += i32::from(begins) - i32::from(line == "end");
            depth == 0
        };
        let (body, rest) = match &only {
            Some(only) => (&only[..], rest),
            None => {
                let length = rest.iter().position(ends).expect("a loop has an end");
                (&rest[..length], &rest[length + 1..])
            }
        };
        for row in rows {
            let values: Vec<(&str, &str)> = names.split(" | ").zip(row.split(" | ")).collect();
            let body = body.iter();
            let body = body.map(|(number, line)| (*number, replace(line, &values)));
            all.extend(unroll(&body.collect::<Vec<_>>()));
        }
        steps = rest;
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
async fn run<const N: usize>(file: &str, title: &str, steps: &[Step]) -> Result<(), String> {
    let first = steps.first().map_or("", |(_, step)| step);
    let words: Vec<&str> = first.split(' ').collect();
    let (mut world, steps) = match words[..] {
        ["held"] => (World::held(Memory::default()).await, &steps[1..]),
        ["memory", frames, bytes] => {
            let room = number(frames).zip(number(bytes)).ok_or("no room")?;
            (World::held(Memory::of(room.0, room.1)).await, &steps[1..])
        }
        ["options", ..] => (World::start::<N>().await, steps),
        _ => {
            let mut world = World::start::<N>().await;
            for quiet in ["/arm_sim/pause {\"data\":true}", "/arm_sim/reset"] {
                world.step(&format!("first call {quiet}")).await?;
            }
            (world, steps)
        }
    };
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

/// Runs the exchange of a file with this title.
fn play(file: &str, title: &str) {
    let path = format!("{}/exchanges/{file}.txt", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap();
    let named = text.lines().map_while(|line| line.strip_prefix("let "));
    let named: Vec<(&str, &str)> = named.map(|line| line.split_once(" = ").unwrap()).collect();
    let is_title = |line: &str| line.strip_prefix("# ") == Some(title);
    let begin = text.lines().position(is_title).unwrap();
    let lines = text.lines().enumerate().skip(begin + 1);
    let lines = lines.take_while(|(_, line)| !line.is_empty());
    let steps: Vec<Step> = lines
        .map(|(number, line)| (number, replace(line, &named)))
        .collect();
    let result = match unroll(&steps).as_slice() {
        [(_, first), steps @ ..] if first == "3 links" => {
            in_virtual_time(run::<3>(file, title, steps))
        }
        steps => in_virtual_time(run::<2>(file, title, steps)),
    };
    result.unwrap();
}

// A test of each exchange, by `build.rs`.
include!(concat!(env!("OUT_DIR"), "/exchanges.rs"));

/// Under either prefix, and with or without the leading slash.
#[test]
fn every_question_of_rosapi_is_answered_with_the_fields_of_the_catalogue() {
    in_virtual_time(async {
        let mut peer = World::start::<2>().await.connect("a", WIDE).await;
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
