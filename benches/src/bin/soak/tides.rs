//! The course of a soak: start, tides of clients with an ebb after each, the end.
//!
//! **Invariant:** at an ebb and at the end, whoever came with the tide is gone on our side before the program is asked what
//! it still holds.

use std::cell::Cell;
use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::json;
use tokio::signal::unix::{SignalKind, signal};
use tokio::task::{JoinSet, LocalSet};
use tokio::time::sleep;

use crate::clients::{KINDS, Kind};
use crate::ledger::success;
use crate::operator::{diagnose, operate};
use crate::watch::{Record, Watch};
use crate::wire::{Client, Door};
use crate::world::{Deeds, Diagnosis, Fault, PATIENCE, World, is_wanted};
use pendularm_benches::program::{Log, Program, Vitals, vitals};

/// Longest tide: room for a client that is disconnected for not reading, after 20 s.
const TIDE: Duration = Duration::from_secs(40);
/// How long the program has to let go of what it still holds: half-open clients are owed answers for 15 s.
const LET_GO: Duration = Duration::from_secs(25);
/// How long nothing happens at an ebb before memory is looked at: an allocator with its own defaults gives freed memory back over ten seconds.
const QUIET: Duration = Duration::from_secs(13);
/// Processor time that the program does not use within [`LET_GO`] for the residents alone \[s\].
const BUSY: f64 = 3.0;
/// Lives at once, and new ones a second.
const AT_ONCE: usize = 80;
const PER_SECOND: f64 = 40.0;
/// Connections at an ebb: the operator, the reader of `/diagnostics`, the healthy clients.
const RESIDENTS: u64 = 2 + Watch::CONNECTIONS;

/// All that a soak has found out.
pub struct Outcome {
    /// The deeds, by name.
    pub counts: Vec<(&'static str, u64)>,
    /// Faults of clients.
    pub faults: u64,
    /// The program before its first client, and once all are gone.
    pub before: Vitals,
    /// The same at the end.
    pub after: Vitals,
    /// The program every second, with the time since its start \[s\].
    pub course: Vec<(f64, Vitals)>,
    /// The same at every ebb.
    pub ebbs: Vec<(f64, Vitals)>,
    /// The healthy clients' record.
    pub record: Record,
    /// When the arm's clock was touched.
    pub deeds: Deeds,
    /// The kinds of clients that there were, from when to when.
    pub lives: Vec<(&'static str, Instant, Instant)>,
    /// The latest `/diagnostics`, and the worst.
    pub diagnosis: Diagnosis,
    /// The program's lines on standard error.
    pub log: Log,
    /// How long it took to end, and its exit status.
    pub ended: Result<(Duration, Option<i32>), String>,
    /// Processor time of the program and of the soak itself \[s\].
    pub cpu: (f64, f64),
}

/// Runs the whole soak against the program at `path`.
pub fn soak(path: &str, time: Duration, seed: u64) -> Result<Outcome, String> {
    let own = std::env::current_exe().map_err(|error| error.to_string())?;
    let bare = Program::start(&own.to_string_lossy(), &["tick"])?;
    let program = Program::start(
        path,
        &[
            "--bind",
            "127.0.0.1:0",
            "--log",
            "warn",
            "--clients",
            "1024",
        ],
    )?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build();
    let runtime = runtime.map_err(|error| error.to_string())?;
    let course = Course::start(program.pid());
    let world = Rc::new(World::new(program.address));
    let rng = fastrand::Rng::with_seed(seed);
    let swum = LocalSet::new().block_on(&runtime, async {
        let mut terminate = signal(SignalKind::terminate()).map_err(|error| error.to_string())?;
        // Either way the program is stopped when this function ends.
        tokio::select! {
            swum = swim(&world, &program, &bare, time, rng) => swum,
            _ = terminate.recv() => Err("ended by SIGTERM".to_owned()),
            _ = tokio::signal::ctrl_c() => Err("interrupted".to_owned()),
        }
    });
    let course = course.finish();
    let (before, after, ebbs, record) = swum?;
    let cpu = (
        after.cpu,
        vitals(std::process::id()).map_or(0.0, |own| own.cpu),
    );
    let log = program.log();
    let ended = program.end();
    let (deeds, diagnosis) = (
        world.deeds.borrow().clone(),
        world.diagnosis.borrow().clone(),
    );
    let (counts, faults, lives) = (world.counts(), world.faults(), world.lives.take());
    Ok(Outcome {
        counts,
        faults,
        before,
        after,
        course,
        ebbs,
        record,
        deeds,
        lives,
        diagnosis,
        log,
        ended,
        cpu,
    })
}

/// Descriptors that the first subscriber has the program open for good: that by which Linux is asked how much each has
/// not read.
const OPENED_ONCE: usize = if cfg!(target_os = "linux") { 1 } else { 0 };

/// Everything that happens while the program runs.
async fn swim(
    world: &Rc<World>,
    program: &Program,
    bare: &Program,
    time: Duration,
    mut rng: fastrand::Rng,
) -> Result<(Vitals, Vitals, Vec<(f64, Vitals)>, Record), String> {
    let gone = || "the program is gone".to_owned();
    let pid = program.pid();
    sleep(Duration::from_millis(500)).await;
    let at_launch = vitals(pid).ok_or_else(gone)?;
    let before = Vitals {
        descriptors: at_launch.descriptors + OPENED_ONCE,
        ..at_launch
    };
    let watch = Watch::start(program, bare.address)?;
    let stop = Rc::new(Cell::new(false));
    let residents = [
        resident(
            world,
            operate(Rc::clone(world), rng.fork(), Rc::clone(&stop)),
        ),
        resident(world, diagnose(Rc::clone(world), Rc::clone(&stop))),
    ];
    let began = Instant::now();
    let mut ebbs = Vec::new();
    let tides = (time.as_secs_f64() / TIDE.as_secs_f64()).ceil().max(3.0);
    for tide in 0..tides as u32 {
        flood(world, time.div_f64(tides), &mut rng).await;
        let held = Vitals {
            descriptors: before.descriptors + RESIDENTS as usize,
            ..before
        };
        ebb(world, pid, held).await;
        let now = vitals(pid).ok_or_else(gone)?;
        ebbs.push((began.elapsed().as_secs_f64(), now));
        println!(
            "ebb {} of {tides}: {:.0} s, {:.0} kB, {} descriptors, {} threads, {} faults",
            tide + 1,
            began.elapsed().as_secs_f64(),
            now.resident,
            now.descriptors,
            now.threads,
            world.faults()
        );
    }
    stop.set(true);
    for resident in residents {
        let _ = resident.await;
    }
    let record = watch.finish();
    settle(pid, before).await;
    sleep(QUIET).await;
    let after = vitals(pid).ok_or_else(gone)?;
    if let Err(fault) = still_answers(world).await {
        world.report(fault);
    }
    Ok((before, after, ebbs, record))
}

/// A client that stays; it must not end by itself.
fn resident(
    world: &Rc<World>,
    life: impl Future<Output = Result<(), Fault>> + 'static,
) -> tokio::task::JoinHandle<()> {
    let world = Rc::clone(world);
    tokio::task::spawn_local(async move {
        if let Err(fault) = life.await {
            world.report(fault);
        }
    })
}

/// Clients come for so long, and then until the last has gone.
async fn flood(world: &Rc<World>, time: Duration, rng: &mut fastrand::Rng) {
    let ends = Instant::now() + time;
    world.end_tide_at(ends);
    let mut lives: JoinSet<(&'static str, Result<(), Fault>)> = JoinSet::new();
    let mut alive: HashMap<&'static str, usize> = HashMap::new();
    let leave = |done: Result<(&'static str, Result<(), Fault>), tokio::task::JoinError>,
                 alive: &mut HashMap<&'static str, usize>| match done {
        Ok((name, outcome)) => {
            alive.entry(name).and_modify(|count| *count -= 1);
            if let Err(fault) = outcome {
                world.report(fault);
            }
        }
        Err(error) => world.report(Fault::of("soak", format!("a client broke: {error}"))),
    };
    while Instant::now() < ends {
        let kind = pick(rng);
        let of_kind = alive.entry(kind.name).or_default();
        if *of_kind < kind.at_once && lives.len() < AT_ONCE {
            *of_kind += 1;
            world.count(kind.name, 1);
            let life = (kind.live)(Rc::clone(world), rng.fork());
            let (world, began) = (Rc::clone(world), Instant::now());
            lives.spawn_local(async move {
                let outcome = life.await;
                world
                    .lives
                    .borrow_mut()
                    .push((kind.name, began, Instant::now()));
                (kind.name, outcome)
            });
        }
        sleep(Duration::from_secs_f64(2.0 * rng.f64() / PER_SECOND)).await;
        while let Some(done) = lives.try_join_next() {
            leave(done, &mut alive);
        }
    }
    let drained = async {
        while let Some(done) = lives.join_next().await {
            leave(done, &mut alive);
        }
    };
    if tokio::time::timeout(4 * PATIENCE, drained).await.is_err() {
        let stuck: Vec<_> = alive.iter().filter(|(_, count)| **count > 0).collect();
        world.report(Fault::of(
            "soak",
            format!("clients that never end: {stuck:?}"),
        ));
    }
}

/// A kind of client, by weight.
fn pick(rng: &mut fastrand::Rng) -> &'static Kind {
    let wanted = || KINDS.iter().filter(|kind| is_wanted(kind.name));
    let total: u32 = wanted().map(|kind| kind.weight).sum();
    let mut at = rng.u32(..total.max(1));
    for kind in wanted() {
        if at < kind.weight {
            return kind;
        }
        at -= kind.weight;
    }
    // Attacks are picked by their own names.
    KINDS.last().unwrap_or(&KINDS[0])
}

/// Waits until the program holds what it should with only the residents there; a fault if it does not let go.
async fn ebb(world: &World, pid: u32, held: Vitals) {
    settle(pid, held).await;
    sleep(QUIET).await;
    let deadline = Instant::now() + LET_GO;
    while world.diagnosis.borrow().connections != RESIDENTS && Instant::now() < deadline {
        sleep(Duration::from_millis(200)).await;
    }
    let connections = world.diagnosis.borrow().connections;
    let now = vitals(pid);
    let (descriptors, threads) = now.map_or((0, 0), |now| (now.descriptors, now.threads));
    if connections != RESIDENTS || descriptors != held.descriptors || threads != held.threads {
        let what = format!(
            "at an ebb the program holds {descriptors} descriptors, {threads} threads and {connections} connections, \
             not {}, {} and {RESIDENTS}",
            held.descriptors, held.threads
        );
        world.report(Fault::of("soak", what));
    }
}

/// Waits until descriptors and threads are back to what they should be, or long enough.
async fn settle(pid: u32, held: Vitals) {
    let mut deadline = Instant::now() + LET_GO;
    let last = Instant::now() + 4 * LET_GO;
    let mut worked = 0.0;
    while Instant::now() < deadline.min(last) {
        match vitals(pid) {
            Some(now) if (now.descriptors, now.threads) == (held.descriptors, held.threads) => {
                break;
            }
            Some(now) => {
                // Requests of clients that have gone are still carried out: that may take a while on a busy machine.
                if now.cpu > worked + BUSY {
                    (worked, deadline) = (now.cpu, Instant::now() + LET_GO);
                }
                sleep(Duration::from_millis(100)).await;
            }
            None => break,
        }
    }
}

/// A new client is served as the first was.
async fn still_answers(world: &Rc<World>) -> Result<(), Fault> {
    let mut client = Client::connect(world, "last client", Door::Tcp).await?;
    client.push_call("/arm_sim/set_params", json!({}), json!({}), true, success());
    client.settle(|_| Ok(())).await?;
    client.subscribe("/joint_states", json!({})).await?;
    client.next(PATIENCE).await.map(|_| ())
}

/// Looks at the program every second, from a thread of its own.
struct Course {
    stop: Arc<AtomicBool>,
    looking: JoinHandle<Vec<(f64, Vitals)>>,
}

impl Course {
    fn start(pid: u32) -> Self {
        let stop: Arc<AtomicBool> = Arc::default();
        let stopped = Arc::clone(&stop);
        let looking = std::thread::spawn(move || {
            let began = Instant::now();
            let mut course = Vec::new();
            while let (false, Some(now)) = (stopped.load(Ordering::Relaxed), vitals(pid)) {
                course.push((began.elapsed().as_secs_f64(), now));
                std::thread::sleep(Duration::from_secs(1));
            }
            course
        });
        Self { stop, looking }
    }

    fn finish(self) -> Vec<(f64, Vitals)> {
        self.stop.store(true, Ordering::Relaxed);
        self.looking.join().unwrap_or_default()
    }
}
