//! The specification's own tests: black box, over TCP, against any server of the protocol.
//!
//! A rule is a sentence, the expected outcome, the words of the specification that it rests on, and a function that checks
//! it. `rules/rules.txt` has the texts, and the files in `rules/` have the functions. All follow the sections of the specification. Reference
//! values come from formulas in this crate (`arm.rs`, `method.rs`), from closed forms and from conservation laws, never
//! from a server.
//!
//! | module | what |
//! | --- | --- |
//! | [`peer`], [`bench`] | a connection; an arm in a known state |
//! | [`run`] | what the connections of a run share |
//! | [`rules`] | the checks |
//! | [`launch`] | a server that the suite starts itself |
//! | [`mistakes`] | usual mistakes as models, for the cause of a wrong answer |
//! | [`report`], [`export`] | the results for a reader, and for programs |
//! | [`command`] | a whole run |
//! | [`points`] | what each rule is worth in a course |
//! | [`sabotage`] | servers with a planted fault |

pub mod arm;
pub mod bench;
pub mod command;
pub mod export;
pub mod launch;
pub mod method;
pub mod mistakes;
pub mod peer;
pub mod points;
pub mod report;
pub mod rules;
pub mod run;
pub mod sabotage;
pub mod values;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use bench::{Bench, Found};
use mistakes::{Diagnosis, Subject};
use points::Points;
use run::{Frame, PATIENCE, Run};
use serde_json::{Value, json};

/// The specification's categories of grading.
pub const CATEGORIES: [&str; 4] = ["Integrators", "PID control", "Dynamics and service contract", "Inverse kinematics"];

/// The heading of rules that do not count.
pub const REMARKS: &str = "Remarks";

/// The outcome of a check: a description of the answer, as a success or as a failure.
pub type Got = Result<String, String>;

/// The id of a rule, and the function that checks it.
pub type Check = (&'static str, fn(&mut Bench) -> Got);

/// A rule of the specification.
#[derive(Debug, Clone, Copy)]
pub struct Rule {
    /// The section of the specification and a number in it.
    pub id: &'static str,
    /// The category that it counts for; a remark counts for none.
    pub category: &'static str,
    /// The number of links that it is for. `None`: any.
    pub links: Option<usize>,
    /// The rule in plain words.
    pub says: &'static str,
    /// The expected outcome.
    pub expected: &'static str,
    /// The words of the specification that it rests on. Empty: it rests on common sense alone.
    pub rests_on: &'static str,
    /// Checks it.
    pub check: fn(&mut Bench) -> Got,
}

impl Rule {
    /// Whether the rule is for an arm with this many links.
    #[must_use]
    pub fn applies_to(&self, links: usize) -> bool {
        self.links.is_none_or(|one| one == links)
    }

    /// Whether the rule counts. A remark does not.
    #[must_use]
    pub fn counts(&self) -> bool {
        CATEGORIES.contains(&self.category)
    }
}

/// The result of a rule.
#[derive(Debug)]
pub struct Row {
    /// The rule.
    pub rule: Rule,
    /// The outcome.
    pub got: Got,
    /// Whether the rule could not be judged at this server. It does not count then.
    pub is_aside: bool,
    /// Services that the rule needs, and that did not accept its calls.
    pub needs: BTreeSet<String>,
    /// The latest frames of a rule that does not hold.
    pub frames: Vec<Frame>,
    /// The mistake that explains the outcome.
    pub cause: Option<String>,
    /// The expected series and the server's, for a trajectory.
    pub plot: Option<[Vec<f64>; 2]>,
    /// The time that it took.
    pub time: Duration,
}

impl Row {
    /// A result alone.
    #[must_use]
    pub fn of(rule: Rule, got: Got) -> Self {
        let (needs, frames) = (BTreeSet::new(), Vec::new());
        Self { rule, got, is_aside: false, needs, frames, cause: None, plot: None, time: Duration::ZERO }
    }

    /// Whether the rule holds.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.got.is_ok()
    }

    /// Whether the rule counts for this category; for any if the name is empty.
    #[must_use]
    pub fn counts_for(&self, category: &str) -> bool {
        self.rule.counts() && !self.is_aside && (category.is_empty() || self.rule.category == category)
    }

    /// Whether the rule counts against the server.
    #[must_use]
    pub fn fails(&self) -> bool {
        !self.holds() && !self.is_aside && self.rule.counts()
    }
}

/// Which rules to try, and for how long.
#[derive(Debug, Clone)]
pub struct Selection {
    /// The longest time of a whole run; rules that are not tried by then fail.
    pub time: Duration,
    /// The longest wait for an answer to one call.
    pub patience: Duration,
    /// A category whose name contains this text.
    pub category: Option<String>,
    /// Rules whose id starts with this text.
    pub rule: Option<String>,
    /// Leaves out rules that rest on common sense alone.
    pub is_strict: bool,
    /// The number of links that the server must have. `None`: any.
    pub links: Option<usize>,
    /// Ends the run early once it is true.
    pub ending: Arc<AtomicBool>,
}

impl Default for Selection {
    fn default() -> Self {
        let time = Duration::from_secs(180);
        Self { time, patience: PATIENCE, category: None, rule: None, is_strict: false, links: None, ending: Arc::default() }
    }
}

impl Selection {
    /// The selected rules for this many links.
    #[must_use]
    pub fn rules(&self, links: usize) -> Vec<Rule> {
        rules::all().filter(|rule| rule.applies_to(links) && self.includes(rule)).collect()
    }

    /// Whether a rule has the selected category, id and ground.
    #[must_use]
    pub fn includes(&self, rule: &Rule) -> bool {
        let name = rule.category.to_lowercase();
        self.category.as_ref().is_none_or(|part| name.contains(&part.to_lowercase()))
            && !(self.is_strict && rule.rests_on.is_empty())
            && self.rule.as_ref().is_none_or(|start| rule.id == start || rule.id.starts_with(&format!("{start}-")))
    }
}

/// The results of a run.
#[derive(Debug)]
pub struct Results {
    /// The server's address.
    pub address: String,
    /// The number of links of the arm.
    pub links: usize,
    /// One for each rule that was tried.
    pub rows: Vec<Row>,
    /// Sentences about the run: another program moved the arm, the server is gone, a setting is not restored.
    pub notes: Vec<String>,
    /// Services that accepted no call.
    pub lacking: BTreeSet<String>,
    /// The time of the run.
    pub time: Duration,
    /// What the rules are worth, if that is given.
    pub points: Option<Points>,
}

impl Results {
    /// Whether every rule holds that counts, and nothing disturbed the run.
    #[must_use]
    pub fn is_good(&self) -> bool {
        self.notes.is_empty() && !self.rows.iter().any(Row::fails)
    }
}

/// Tries the selected rules one after another against the server at `address`, and reports each result as it comes, with
/// the number of rules. Afterwards the server has the settings that it had before.
///
/// # Errors
/// If no rosbridge server answers at the address, or if it does not have the selected number of links.
pub fn run(address: &str, selection: &Selection, mut tell: impl FnMut(&Row, usize)) -> Result<Results, String> {
    let began = Instant::now();
    let run = Arc::new(Run::new(selection.patience, &selection.ending));
    let found = Found::at(address, &run)?;
    if let Some(links) = selection.links.filter(|links| *links != found.links) {
        return Err(format!("the server at {address} has {} links instead of {links}", found.links));
    }
    let rules = selection.rules(found.links);
    let mut watch = Watch::start(address, &run);
    let (mut rows, mut notes, mut causes) = (Vec::new(), BTreeSet::new(), BTreeMap::new());
    for rule in &rules {
        if run.is_ending() {
            notes.insert(format!("interrupted before {}: {} of {} rules were tried", rule.id, rows.len(), rules.len()));
            break;
        }
        run.take();
        let (mut is_aside, mut is_gone, start) = (false, false, Instant::now());
        let got = if began.elapsed() < selection.time {
            match Bench::prepared(address, &found, &run) {
                Ok(mut bench) => {
                    let got = (rule.check)(&mut bench);
                    is_aside = bench.is_aside;
                    got
                }
                Err(why) => {
                    is_gone = !is_there(address, &run);
                    Err(format!("while preparing: {why}"))
                }
            }
        } else {
            Err(format!("not tried: the run had taken {} s; --rule {} tries it alone", selection.time.as_secs(), rule.id))
        };
        if is_gone && !run.is_ending() {
            let last = rows.last().map_or("the first rule", |row: &Row| row.rule.id);
            notes.insert(format!("the server is gone since {last}: {} of {} rules were tried", rows.len(), rules.len()));
            break;
        }
        if run.is_ending() {
            continue;
        }
        notes.extend(watch.looked(rule, &run));
        let (needs, frames) = run.take();
        let frames = if got.is_ok() { Vec::new() } else { frames };
        let subject = Subject::of(rule.id).filter(|_| got.is_err() && !is_aside && began.elapsed() < selection.time);
        let known = subject.map(|subject| {
            let ask = || Bench::prepared(address, &found, &run).and_then(|mut bench| subject.diagnose(&mut bench)).ok();
            causes.entry(subject).or_insert_with(ask).clone()
        });
        let Diagnosis { cause, plot } = known.flatten().unwrap_or_default();
        let row = Row { cause, plot, is_aside, needs, frames, time: start.elapsed(), ..Row::of(*rule, got) };
        tell(&row, rules.len());
        rows.push(row);
    }
    if is_there(address, &run) || run.is_ending() {
        notes.extend(found.restore(address));
    }
    let notes = notes.into_iter().collect();
    Ok(Results {
        address: address.to_owned(),
        links: found.links,
        rows,
        notes,
        lacking: run.lacking(),
        time: began.elapsed(),
        points: None,
    })
}

/// Whether something listens at the address. A server that restarts gets a moment.
fn is_there(address: &str, run: &Arc<Run>) -> bool {
    (0..5).any(|_| {
        peer::Peer::connect(address, run).is_ok() || {
            std::thread::sleep(Duration::from_millis(200));
            false
        }
    })
}

/// The topic on which each run tells its name.
const RUNS: &str = "/conformance/run";

/// A connection that sees what other programs do to the arm.
struct Watch {
    peer: Option<peer::Peer>,
    /// Whether trajectories come back with the name of the run, so that those of other programs can be told from them.
    has_names: bool,
    had_goals: bool,
}

impl Watch {
    fn start(address: &str, run: &Arc<Run>) -> Self {
        let mut peer = peer::Peer::connect(address, run).ok();
        let advertise = json!({"op": "advertise", "topic": RUNS, "type": "std_msgs/msg/String"});
        let subscribe = |topic| json!({"op": "subscribe", "id": format!("see {topic}"), "topic": topic});
        for frame in [advertise, subscribe(RUNS), subscribe("/joint_trajectory")] {
            peer = peer.and_then(|mut peer| peer.send(&frame).is_ok().then_some(peer));
        }
        Self { peer, has_names: false, had_goals: false }
    }

    /// What other programs did during a rule.
    fn looked(&mut self, rule: &Rule, run: &Run) -> Vec<String> {
        let Some(mut peer) = self.peer.take() else { return Vec::new() };
        // Goals and trials have trajectories of the server's own.
        let has_goals = ["goal-", "trial-"].iter().any(|start| rule.id.starts_with(start));
        let is_judged = !has_goals && !std::mem::replace(&mut self.had_goals, has_goals);
        let hello = json!({"op": "publish", "topic": RUNS, "msg": {"data": run.name}});
        let (mut seen, mut is_open) = (Vec::new(), peer.send(&hello).is_ok());
        for _ in 0..100 {
            let frame = match peer.receive(Instant::now() + Duration::from_millis(1)) {
                Ok(frame) => frame,
                Err(trouble) => {
                    is_open &= trouble == peer::Trouble::Silence;
                    break;
                }
            };
            let name = |topic, member| frame.pointer(member).and_then(Value::as_str).filter(|_| peer::is_message(&frame, topic));
            if name(RUNS, "/msg/data").is_some_and(|name| name != run.name) {
                seen.push("another conformance run tests this server at the same time: these results are not reliable".to_owned());
            }
            match name("/joint_trajectory", "/msg/header/frame_id") {
                Some(name) if name == run.name => self.has_names = true,
                Some(_) if self.has_names && is_judged => {
                    seen.push(format!("another program moved the arm during {}: these results are not reliable", rule.id));
                }
                _ => {}
            }
        }
        self.peer = is_open.then_some(peer);
        seen
    }
}
