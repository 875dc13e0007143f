//! The course of one seed: clients come, do what they do while faults and hostile clients come between, then all of that ends and
//! everything that is owed must come, then all leave and nothing must be left.

use std::rc::Rc;
use std::time::Duration;

use pendularm::actors::resources::budget::MODEST;
use tokio::time::Instant;

use crate::client::{Client, Door};
use crate::court::{Court, Failure, Verdict};
use crate::honest::{Computed, Expect, Honest, Phase};
use crate::hostile::Hostile;
use crate::model::{Model, Provided};
use crate::pipe::Fate;
use crate::plan::{Burst, Fault, Feature, Plan};
use crate::workload::{Numbers, Workload, waits};
use crate::world::{SCARCE, World, in_virtual_time};

/// Turns within which a light call is answered whose caller reads, all others' frames of those turns included.
const LIGHT_TURNS: u64 = 30_000;
/// Turns within which a computation is done, once the client's one before is, for each client that may have some too: what takes longest
/// of what honest clients have computed takes some 1,000 where nobody else computes.
const COMPUTED_TURNS: u64 = 2_000;
/// The same for what is computed in a few turns: in two thousand seeds one took 43, beside a flood, and all others fewer than 40.
const SHORT_TURNS: u64 = 80;
/// A light call's patience in virtual time.
const LIGHT_TIME: Duration = Duration::from_secs(1);
/// Once the faults are over, all that is owed has come within so much virtual time.
const LIVENESS: Duration = Duration::from_secs(40);
/// When all have left, nothing is held for anybody after so much virtual time.
const EMPTY: Duration = Duration::from_secs(100);
/// Bytes in a pipe, and in a write, without which what a flood brings would be on its way for too long.
const FLOODED_ROOM: usize = 4096;
const FLOODED_PIECE: usize = 100;
/// Processor time that everybody's turns after one deed may take, however slow the machine is: an arm whose steps are too short to keep up
/// takes seconds, as tests are built to be compiled quickly.
const STANDSTILL: Duration = Duration::from_secs(10);
/// How much more than the limit clients hold at most until whoever gives way is gone.
const BESIDE: usize = 1 << 21;

/// The outcome of a seed.
pub struct Outcome {
    pub plan: String,
    pub failure: Option<Failure>,
    pub hash: u64,
    pub log: Vec<String>,
    pub tally: std::collections::BTreeMap<&'static str, u64>,
}

/// Plays one seed; with bursts, if it is no older than they are.
pub fn play(seed: u64, is_newest: bool, keeps_log: bool) -> Outcome {
    in_virtual_time(async {
        let court = Rc::new(Court::new(seed, keeps_log));
        let mut plan = Plan::draw(&court);
        if is_newest {
            plan = plan.with_bursts(&court);
        }
        let text = plan.to_string();
        let mut course = Course::new(&court, plan, seed).await;
        course.run().await;
        let (hash, log) = court.record();
        let tally = court.tally.take();
        Outcome {
            plan: text,
            failure: court.failure(),
            hash,
            log,
            tally,
        }
    })
}

struct Course {
    court: Rc<Court>,
    plan: Plan,
    world: World,
    model: Model,
    numbers: Numbers,
    honest: Vec<Honest>,
    hostile: Vec<Hostile>,
    /// Honest clients so far.
    clients: u64,
    /// Clients that were cut off because they held the most.
    cut_off: u64,
}

impl Course {
    async fn new(court: &Rc<Court>, plan: Plan, seed: u64) -> Self {
        let world = World::start(court, plan.links, plan.scarce, seed).await;
        let model = Model {
            is_scarce: plan.scarce,
            links: plan.links,
            is_reshaped: plan.hostile > 0,
            ..Model::default()
        };
        let mut course = Self {
            court: Rc::clone(court),
            plan,
            world,
            model,
            numbers: Numbers::default(),
            honest: Vec::new(),
            hostile: Vec::new(),
            clients: 0,
            cut_off: 0,
        };
        for _ in 0..course.plan.honest {
            let one = course.enter();
            course.honest.push(one);
        }
        for _ in 0..course.plan.hostile {
            let one = course.intrude();
            course.hostile.push(one);
        }
        course
    }

    fn enter(&mut self) -> Honest {
        let (client, fate) = self.connect(self.plan.room);
        self.clients += 1;
        self.court.count("honest clients");
        Honest::new(self.clients, client, fate)
    }

    fn intrude(&self) -> Hostile {
        // Theirs are wide: what they send is to arrive.
        let (client, fate) = self.connect(1 << 16);
        self.court.count("hostile clients");
        Hostile::new(client, fate)
    }

    fn connect(&self, room: usize) -> (Client, Rc<std::cell::Cell<Fate>>) {
        let (stream, fate) = self.world.connect(room);
        let door = if self.court.chance(self.plan.socket) {
            Door::Socket
        } else {
            Door::Plain
        };
        let piece = if room == self.plan.room {
            self.plan.piece
        } else {
            room
        };
        (Client::new(door, stream, piece), fate)
    }

    async fn run(&mut self) {
        self.settle_in().await;
        for _ in 0..self.plan.steps {
            self.step().await;
            if self.court.failure().is_some() {
                return;
            }
        }
        for _ in 0..self.world.gauges.memory().cut_off() {
            self.court.count("clients that held the most");
        }
        self.come_to_rest().await;
        if self.court.failure().is_none() {
            self.leave().await;
        }
    }

    /// Everybody listens to something, and somebody provides what others call: else most of what follows is in vain.
    async fn settle_in(&mut self) {
        let provides = self
            .plan
            .features
            .iter()
            .any(|(one, _)| *one == Feature::CallOut);
        for at in 0..self.honest.len() {
            self.workload(at).perform(Feature::Subscribe);
            self.workload(at).perform(Feature::Subscribe);
            if provides && self.court.chance(0.7) {
                self.workload(at).perform(Feature::Provide);
            }
        }
        self.world.turns(100).await;
        self.look();
    }

    async fn step(&mut self) {
        let worked = processor_time();
        if self.court.chance(self.plan.fault)
            && let Some(fault) = self.court.weighed(&self.plan.faults)
        {
            self.court.count("faults");
            self.fault(fault).await;
        } else if self.court.chance(self.plan.hostility)
            && let Some(deed) = self.court.weighed(&self.plan.hostilities)
        {
            let at = self.court.below(self.hostile.len());
            self.court.note("hostile", format!("{deed:?}").as_bytes());
            self.court.count("hostile deeds");
            if self.hostile[at].client.has_ended() {
                self.hostile[at] = self.intrude();
            }
            self.hostile[at].perform(deed, &self.court, &self.honest);
        } else if !self.plan.bursts.is_empty() && self.court.chance(self.plan.burst) {
            if let Some(burst) = self.court.weighed(&self.plan.bursts) {
                self.court.count("bursts");
                self.burst(burst).await;
            }
        } else if let Some(feature) = self.court.weighed(&self.plan.features) {
            self.feature(feature).await;
        }
        let turns = 1 + self.court.below(20);
        self.world.turns(turns).await;
        self.look();
        self.stand_still(worked);
    }

    fn stand_still(&self, worked: Option<Duration>) {
        let (Some(before), Some(now)) = (worked, processor_time()) else {
            return;
        };
        let took = now.saturating_sub(before);
        if took > STANDSTILL {
            self.court.fail(
                Verdict::NoProgress,
                format!("a deed kept the processor for {took:?}"),
            );
        }
    }

    async fn feature(&mut self, feature: Feature) {
        if feature == Feature::Wait {
            let time = self.court.among(&[1, 5, 20, 100, 400, 1500]);
            return self.pass(Duration::from_millis(time)).await;
        }
        let at = self.somebody();
        self.workload(at).perform(feature);
    }

    /// A client that can do something, by its place.
    fn somebody(&mut self) -> usize {
        let at = self.court.below(self.honest.len());
        if !self.honest[at].is_active() {
            self.honest[at] = self.replace(at);
        }
        at
    }

    async fn burst(&mut self, burst: Burst) {
        self.court.note("burst", format!("{burst:?}").as_bytes());
        let at = self.somebody();
        match burst {
            // A message in the second half of each interval: what a throttle may let through too early.
            Burst::Stream => {
                let who = self.honest[at].who;
                let count = 10 + self.court.below(20);
                for _ in 0..count {
                    if self.honest[at].who != who || !self.honest[at].is_active() {
                        return;
                    }
                    let interval = self.workload(at).stream();
                    let apart = interval.mul_f64(0.55 + 0.4 * self.court.fraction());
                    self.pass(apart).await;
                }
            }
            // More than an outbox holds, while somebody does not read.
            Burst::Flood => {
                if self.plan.scarce
                    || self.plan.room < FLOODED_ROOM
                    || self.plan.piece < FLOODED_PIECE
                {
                    return;
                }
                if let Some(deaf) = self.workload(at).flood() {
                    self.stall(deaf);
                }
            }
            Burst::LongComputation => self.workload(at).compute_long(),
            Burst::CancelAnothers => self.workload(at).cancel_anothers(),
        }
    }

    /// A client reads nothing for a while.
    fn stall(&mut self, at: usize) {
        let time = Duration::from_millis(100 + self.court.below(12_000) as u64);
        let one = &mut self.honest[at];
        one.client.pause(true);
        one.is_hampered = true;
        one.stalled_until = Some(Instant::now() + time);
    }

    fn workload(&mut self, at: usize) -> Workload<'_> {
        Workload {
            court: &self.court,
            plan: &self.plan,
            model: &mut self.model,
            numbers: &mut self.numbers,
            all: &mut self.honest,
            at,
        }
    }

    /// Another client in the place of one that is done for. Whatever that one sent last may not have arrived.
    fn replace(&mut self, at: usize) -> Honest {
        self.abandon(at);
        self.enter()
    }

    /// The connection of a client ends in a way that leaves nothing owed to it.
    fn abandon(&mut self, at: usize) {
        let one = &mut self.honest[at];
        for call in one.calls.values() {
            // Its provider may be told that nobody waits for the answer any more.
            if let Expect::Forwarded(number) = call.expect {
                self.model.forwards.remove(&number);
                self.model.orphans += 1;
            }
        }
        one.excuse();
        let (who, handled) = (one.who, one.handled);
        let doubtful: Vec<u64> = one
            .published
            .iter()
            .filter(|(_, order)| **order >= handled)
            .map(|(n, _)| *n)
            .collect();
        for other in &mut self.honest {
            for subscription in other.subscriptions.values_mut() {
                subscription.newest.remove(&who);
                let pending = subscription.pending.get_mut(&who).into_iter().flatten();
                pending.for_each(|(number, must)| *must &= !doubtful.contains(number));
            }
        }
        self.lose_provider(who);
    }

    /// A client provides nothing any more.
    fn lose_provider(&mut self, who: u64) {
        let forwards = self.model.forwards.values_mut();
        for one in forwards.filter(|one| one.heard_by == Some(who) && one.answered.is_none()) {
            one.orphaned.get_or_insert(Instant::now());
        }
        let changed = self.court.turns.get();
        for provided in self
            .model
            .services
            .values_mut()
            .filter(|one| one.provider == Some(who))
        {
            *provided = Provided {
                changed,
                ..Provided::default()
            };
        }
    }

    async fn fault(&mut self, fault: Fault) {
        self.court.note("fault", format!("{fault:?}").as_bytes());
        let at = self.court.below(self.honest.len());
        match fault {
            Fault::Stall => self.stall(at),
            Fault::Vanish => self.honest[at] = self.replace(at),
            Fault::ResetMidFrame => {
                self.abandon(at);
                self.honest[at]
                    .client
                    .send_bytes(b"{\"op\":\"publish\",\"topic\":\"/t0\",\"msg\":{\"unfin".to_vec());
                self.world.turns(3).await;
                self.look();
                self.honest[at] = self.replace(at);
            }
            Fault::PanicInPipe => {
                self.abandon(at);
                self.honest[at].fate.set(Fate::Panics);
                // A pipe that nobody uses would not get to it.
                self.honest[at].client.send_bytes(b" ".to_vec());
            }
            Fault::HalfClose => {
                let one = &mut self.honest[at];
                one.client.finish();
                one.has_finished = true;
                one.is_hampered = true;
                let who = one.who;
                // Its calls may be forgotten before their providers answer.
                self.model.orphans += one.calls.len() as u64;
                self.lose_provider(who);
            }
            Fault::Jump => {
                // Bytes under way arrive first: a jump within a frame is a frame that took too long.
                self.resume();
                self.world.until_quiet().await;
                self.look();
                // So do the answers that providers have just given; they give no others until then.
                self.world.until_quiet().await;
                self.listen(false);
                let time =
                    Duration::from_millis(self.court.among(&[250, 300, 1000, 9_000, 14_000]));
                self.world.jump(time).await;
                // Providers now answer what they would have answered in the meantime.
                let now = Instant::now();
                for (due, number, _) in self.honest.iter().flat_map(|one| &one.due_answers) {
                    if let Some(forward) = self.model.forwards.get_mut(number)
                        && let Some((when, ..)) = &mut forward.answered
                    {
                        *when = now.max(*due);
                    }
                }
                self.world.turns(100).await;
            }
            Fault::PanicInComputation => self.world.submit_panic(),
            Fault::ProviderLost => {
                let mut providers = self.model.services.values().filter_map(|one| one.provider);
                let lost =
                    providers.find_map(|who| self.honest.iter().position(|one| one.who == who));
                if let Some(lost) = lost {
                    self.honest[lost] = self.replace(lost);
                }
            }
        }
    }

    /// All who have stalled read again.
    fn resume(&mut self) {
        for one in &mut self.honest {
            one.client.pause(false);
            one.stalled_until = None;
        }
    }

    /// Lets virtual time pass, and looks now and then.
    async fn pass(&mut self, time: Duration) {
        let mut left = time;
        while !left.is_zero() && self.court.failure().is_none() {
            left -= self.world.glance(left).await;
            self.look();
        }
    }

    /// Takes what has come, and holds it against the model; providers answer.
    fn look(&mut self) {
        self.listen(true);
    }

    fn listen(&mut self, answers: bool) {
        let now = Instant::now();
        for at in 0..self.honest.len() {
            let one = &mut self.honest[at];
            if one.stalled_until.is_some_and(|until| until <= now) {
                one.stalled_until = None;
                one.client.pause(false);
            }
            for received in one.client.take() {
                self.model.hear(&self.court, &mut self.honest[at], received);
            }
            if answers {
                self.workload(at).answer_calls();
            }
            self.check_end(at);
            self.check_patience(at);
        }
        for one in &mut self.hostile {
            if !one.client.is_paused() {
                one.client.take_anything();
            }
        }
        if self.model.missed > self.world.gauges.messages_dropped() {
            let (missed, dropped) = (self.model.missed, self.world.gauges.messages_dropped());
            self.court.wrong(format!(
                "{missed} messages are missing, and {dropped} counted as dropped"
            ));
        }
        self.check_room();
    }

    /// Nobody is cut off, unless there is little room.
    fn check_end(&mut self, at: usize) {
        let one = &self.honest[at];
        if one.is_excused || one.has_finished || !(one.was_cut_off || one.client.has_ended()) {
            return;
        }
        if self.plan.scarce && self.cut_off < self.world.gauges.memory().cut_off() {
            self.cut_off += 1;
            self.court.count("honest clients that held the most");
            return self.abandon(at);
        }
        let (who, rest) = (one.who, one.client.rest());
        self.court
            .wrong(format!("client {who} was cut off: {rest}"));
    }

    fn check_patience(&mut self, at: usize) {
        let one = &self.honest[at];
        let (court, turns) = (&self.court, self.court.turns.get());
        if one.is_excused || one.is_hampered || self.plan.scarce {
            return;
        }
        for call in one.calls.values() {
            let Expect::Forwarded(number) = call.expect else {
                continue;
            };
            let forward = self.model.forwards.get(&number);
            let late = forward.is_some_and(|one| one.since.elapsed() > one.timeout + LIGHT_TIME);
            if late && court.jumps.get() == 0 {
                let words = format!("{} has taken longer than its caller waits", call.what);
                court.fail(Verdict::NoProgress, words);
            }
        }
        // Its computations are done one behind the other.
        let computations = one.calls.values().filter(|call| call.is_computation());
        if let Some(next) = computations.min_by_key(|call| call.order)
            && matches!(next.expect, Expect::Computed(_))
        {
            let taken = turns - next.turns.max(one.computed);
            court.at_most("most turns that a computation waits", taken);
            let clients = (self.honest.len() + self.hostile.len()) as u64;
            // Where nothing is long on its way, what is over in a few turns has them soon, whatever others compute.
            // In small pieces a client's own frames hold up its next one.
            let is_wide = self.plan.room >= 1 << 16 && self.plan.piece >= 1 << 16;
            let is_short = matches!(next.expect, Expect::Computed(Computed::Particle { .. }));
            let each = if is_wide && is_short {
                court.at_most("most turns that a short one waits", taken);
                SHORT_TURNS
            } else {
                COMPUTED_TURNS
            };
            if taken > each * (1 + clients) {
                let words = format!(
                    "{:.80} has waited for {taken} turns beside {clients} clients",
                    next.what
                );
                court.fail(Verdict::NoProgress, words);
            }
        }
        for (id, call) in one.calls.iter().filter(|(_, call)| call.is_light) {
            let (time, taken) = (call.since.elapsed(), turns - call.turns);
            if (time > LIGHT_TIME && court.jumps.get() == 0) || taken > LIGHT_TURNS {
                let words = format!(
                    "{} with id {id} is unanswered after {time:?} and {taken} turns",
                    call.what
                );
                court.fail(Verdict::NoProgress, words);
            }
        }
    }

    /// The limit is not exceeded.
    fn check_room(&self) {
        if !self.plan.scarce {
            return;
        }
        // Who holds no more than what is modest never gives way.
        let modest = MODEST * (self.honest.len() + self.hostile.len());
        let (held, most) = (self.world.held(), SCARCE.max(modest) + BESIDE);
        if held > most {
            let words = format!("{held} bytes are held, where {most} may be");
            self.court.wrong(words);
        }
    }

    /// Faults and hostile clients are gone: whatever is owed comes.
    async fn come_to_rest(&mut self) {
        self.hostile.clear();
        self.resume();
        // Bytes that were sent before arrive before those that follow.
        self.pass(Duration::from_millis(500)).await;
        // A goal ends when the arm is reset, and time passes when it is not paused.
        let mut sober = self.enter();
        for (id, service, args) in [
            ("\"end1\"", "/arm_sim/pause", "{\"data\":false}"),
            (
                "\"end2\"",
                "/arm_sim/set_integrator",
                "{\"method\":\"rk4\",\"timestep\":0.001}",
            ),
            ("\"end3\"", "/ik_trial/stop", "{}"),
            ("\"end4\"", "/arm_sim/reset", "{}"),
        ] {
            sober.send(&format!("{{\"op\":\"call_service\",\"id\":{id},\"service\":\"{service}\",\"args\":{args}}}"), 0);
            let is_arms = service.starts_with("/arm_sim");
            let expect = if is_arms {
                Expect::Arm { is_good: true }
            } else {
                Expect::Anything
            };
            sober.note_call(id, service, expect, true, &self.court);
        }
        self.honest.push(sober);
        let began = Instant::now();
        while began.elapsed() < LIVENESS && self.court.failure().is_none() && !self.is_at_rest() {
            self.pass(Duration::from_millis(100)).await;
        }
        if self.court.failure().is_some() {
            return;
        }
        self.world.compare().await;
        let waiting: Vec<String> = self
            .honest
            .iter()
            .filter(|one| !self.has_all(one))
            .map(waits)
            .collect();
        if !waiting.is_empty() {
            let words = format!(
                "{LIVENESS:?} after the last fault clients wait: {}",
                waiting.join(" | ")
            );
            return self.court.fail(Verdict::NoProgress, words);
        }
        self.check_messages();
    }

    /// Whether all that is owed has come. Calls that may wait for a day do not count, nor does whoever has stopped sending.
    fn has_all(&self, one: &Honest) -> bool {
        let may_wait = |call: &Expect| match call {
            Expect::Forwarded(number) => self
                .model
                .forwards
                .get(number)
                .is_some_and(|one| one.timeout > LIVENESS),
            _ => false,
        };
        let is_answered = one.calls.values().all(|call| may_wait(&call.expect));
        one.is_excused || one.has_finished || (is_answered && one.news.is_empty())
    }

    fn is_at_rest(&self) -> bool {
        let all_heard = |one: &Honest| {
            let pending = one
                .subscriptions
                .values()
                .flat_map(|one| one.pending.values().flatten());
            one.is_excused || one.has_finished || pending.filter(|(_, must)| *must).count() == 0
        };
        let throttled = |one: &Honest| {
            one.subscriptions
                .values()
                .any(|one| one.throttle.is_some() && !has_newest(one))
        };
        let quiet = |one: &Honest| {
            self.has_all(one)
                && all_heard(one)
                && (!throttled(one) || one.is_excused || one.has_finished)
        };
        self.honest.iter().all(quiet) && self.world.pool.is_idle()
    }

    /// Every message has come that had to, and of a throttled topic the newest.
    fn check_messages(&mut self) {
        for at in 0..self.honest.len() {
            let one = &self.honest[at];
            if one.is_excused || one.has_finished {
                continue;
            }
            let subscriptions = one.subscriptions.iter();
            let missing = |(topic, one): (&String, &crate::honest::Subscription)| {
                let must: Vec<u64> = one
                    .pending
                    .values()
                    .flatten()
                    .filter(|(_, must)| *must)
                    .map(|(n, _)| *n)
                    .collect();
                (!must.is_empty()).then(|| (must.len(), format!("{must:?} on {topic}")))
            };
            let missing: Vec<(usize, String)> = subscriptions.filter_map(missing).collect();
            let stale = one
                .subscriptions
                .iter()
                .find(|(_, one)| one.throttle.is_some() && !has_newest(one));
            // A hostile client's message may be newer.
            let is_quiet = !one.is_hampered && !self.plan.scarce && self.plan.hostile == 0;
            if let Some((topic, subscription)) = stale.filter(|_| is_quiet) {
                let (last, newest) = (subscription.last, &subscription.newest);
                self.court.wrong(format!(
                    "client {} has not heard the newest on {topic}: {last:?}, not {newest:?}",
                    one.who
                ));
            }
            for (count, which) in missing {
                self.model
                    .miss(&self.court, &self.honest[at], count, &which);
            }
        }
        let dropped = self.world.gauges.messages_dropped();
        if self.model.missed > dropped {
            self.court.wrong(format!(
                "{} messages are missing, and {dropped} counted as dropped",
                self.model.missed
            ));
        }
    }

    /// All leave, some politely; nothing is held for anybody then.
    async fn leave(&mut self) {
        for at in 0..self.honest.len() {
            if self.court.chance(0.5) {
                self.honest[at].client.finish();
            }
        }
        self.world.turns(20).await;
        self.honest.clear();
        let began = Instant::now();
        while began.elapsed() < EMPTY && !self.world.is_empty() && self.court.failure().is_none() {
            self.world.glance(Duration::from_millis(100)).await;
        }
        if !self.world.is_empty() {
            let (held, connections) = (self.world.held(), self.world.gauges.connections());
            let idle = self.world.pool.is_idle();
            self.court.wrong(format!(
                "{EMPTY:?} after all have left {connections} are connected, {held} bytes are held, and the pool is idle: {idle}"
            ));
        }
    }
}

/// Whether the last message that came is the last that somebody sent.
fn has_newest(one: &crate::honest::Subscription) -> bool {
    let last = one.last.map(|(number, _)| number);
    // Sent before the subscription, or by a client that is gone: it may be handled behind newer ones of others.
    let is_from_before = one
        .last_from
        .is_some_and(|from| !one.newest.contains_key(&from));
    one.phase != Phase::On
        || one.newest.is_empty()
        || is_from_before
        || one.newest.values().any(|newest| Some(*newest) <= last)
}

/// Processor time of this thread so far, where the system tells it.
fn processor_time() -> Option<Duration> {
    processor_time_of("thread-self")
}

/// Processor time of a thread, or of a process's first, so far.
pub fn processor_time_of(thread: &str) -> Option<Duration> {
    let text = std::fs::read_to_string(format!("/proc/{thread}/schedstat")).ok()?;
    let nanoseconds = text.split(' ').next()?.parse().ok()?;
    Some(Duration::from_nanos(nanoseconds))
}
