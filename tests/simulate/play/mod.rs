//! The course of one seed. Clients connect and work, among faults and hostile clients. Then faults and hostile clients
//! end, and every answer that is due must arrive. Then all clients leave, and nothing may remain.

mod faults;
mod looks;
mod rest;

use std::rc::Rc;
use std::time::Duration;

use pendularm_client::codec::Framing;

use crate::client::Client;
use crate::court::{Court, Failure, Verdict};
use crate::honest::Honest;
use crate::hostile::Hostile;
use crate::model::Model;
use crate::pipe::Fate;
use crate::plan::{Burst, Feature, Hostility, Plan};
use crate::workload::{UniqueNumbers, Workload};
use crate::world::{World, in_virtual_time};

/// Least bytes in a pipe and in a write for a flood. With fewer, its frames would arrive too late.
const FLOODED_ROOM: usize = 4096;
const FLOODED_PIECE: usize = 100;
/// Most processor time of all turns after one action, also on a slow machine. An arm with steps that are too short for
/// real time takes seconds, because tests are compiled with few optimisations.
const STANDSTILL: Duration = Duration::from_secs(10);

/// The outcome of a seed.
#[derive(Default)]
pub struct Outcome {
    pub plan: String,
    pub failure: Option<Failure>,
    pub hash: u64,
    pub log: Vec<String>,
    pub tally: std::collections::BTreeMap<&'static str, u64>,
}

/// Plays one seed.
pub fn play(seed: u64, keeps_log: bool) -> Outcome {
    in_virtual_time(async {
        let court = Rc::new(Court::new(seed, keeps_log));
        let plan = Plan::draw(&court);
        let text = format!("{plan:?}");
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
    numbers: UniqueNumbers,
    honest: Vec<Honest>,
    hostile: Vec<Hostile>,
    /// Honest clients so far.
    clients: u64,
}

impl Course {
    async fn new(court: &Rc<Court>, plan: Plan, seed: u64) -> Self {
        let world = World::start(court, plan.links, plan.scarce, seed).await;
        let model = Model {
            is_scarce: plan.scarce,
            ..Model::default()
        };
        let mut course = Self {
            court: Rc::clone(court),
            plan,
            world,
            model,
            numbers: UniqueNumbers::default(),
            honest: Vec::new(),
            hostile: Vec::new(),
            clients: 0,
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
        // Their pipes are wide, so their messages arrive.
        let (client, fate) = self.connect(1 << 16);
        self.court.count("hostile clients");
        Hostile::new(client, fate)
    }

    fn connect(&self, room: usize) -> (Client, Rc<std::cell::Cell<Fate>>) {
        let (stream, fate) = self.world.connect(room);
        let framing = match self.court.chance(self.plan.socket) {
            true => Framing::WebSocket,
            false => Framing::Lines,
        };
        let is_honest = room == self.plan.room;
        let piece = if is_honest { self.plan.piece } else { room };
        (Client::new(framing, stream, piece), fate)
    }

    async fn run(&mut self) {
        self.settle_in().await;
        for _ in 0..self.plan.steps {
            self.step().await;
            if self.court.failure().is_some() {
                return;
            }
        }
        self.come_to_rest().await;
        if self.court.failure().is_none() {
            self.leave().await;
        }
    }

    /// Each client subscribes to a topic, and one provides a service. Otherwise most later actions would have no
    /// effect.
    async fn settle_in(&mut self) {
        let mut features = self.plan.features.iter();
        let provides = features.any(|(one, _)| *one == Feature::CallOut);
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
            self.model.is_overrun |= deed == Hostility::StepByHand && self.plan.room < FLOODED_ROOM;
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
            let words = format!("a deed kept the processor for {took:?}");
            self.court.fail(Verdict::NoProgress, words);
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
            // A message in the second half of each interval: a throttle might let it through too early.
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
            // More than an outbox holds, while a client does not read.
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
}

/// Processor time of this thread so far, if the system has it.
fn processor_time() -> Option<Duration> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds = text.split(' ').next()?.parse().ok()?;
    Some(Duration::from_nanos(nanoseconds))
}
