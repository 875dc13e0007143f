//! `pendularm replay --serve`: a record in the arm's place. Its topics are published as they were recorded, at a chosen
//! speed, forward and back; what is asked about the arm is answered as it was then.
//!
//! **Invariant:** nothing can be changed but the place in the record and the speed.

mod arm;
mod launch;
mod settings;
mod wire;

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::time::Duration;

use actix::prelude::*;
use serde_json::Value;
use tokio::time::Instant;

pub use self::launch::{NotReplayed, start};
use self::settings::{RecordedSettings, SettingsFollower};
pub use self::wire::list_only_what_is_served;
use crate::actors::arm::sim::SimulationTime;
use crate::actors::node::{Ask, Call, Interest, Publish};
use crate::protocol::catalog::Topic;
use crate::record::{Moment, ReadError, Reel, ReelPlace};

/// Largest speed, either way: a tick is a second and a half of the record then.
pub const MAX_RATE: f64 = 100.0;
/// Messages that are published at one tick; what is due beyond waits for the next.
pub const MAX_AT_ONCE: usize = 4096;
/// Time between two ticks.
const TICK: Duration = Duration::from_micros(16_667);
/// After a longer stall the record goes on from where it stood.
const CATCH_UP: Duration = Duration::from_millis(250);
/// While the record stands, its present messages are published again so often, for who comes late.
const REPEAT: Duration = Duration::from_secs(1);
/// A message is present for so long: the slowest topic has one a second.
const PRESENT: Duration = Duration::from_millis(1500);
/// At the record's beginning a topic's first message is present already, if it comes so soon.
const SOON: Duration = Duration::from_millis(100);

// ---- messages -------------------------------------------------------------------------------------------------------

/// Drives the record, or asks how it stands. From clients, by `/rosbag2_player/*`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DriveRecord {
    /// Stands still, or goes on.
    Pause(bool),
    /// Does the other of the two.
    Toggle,
    /// Goes at this speed: 1 as it was recorded, negative numbers backward.
    Rate(f64),
    /// Goes to this time since the record's beginning.
    Seek(Duration),
    /// Nothing: asks.
    Look,
}

/// How the record stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlayerState {
    /// Whether it stands still.
    pub is_paused: bool,
    /// Its speed.
    pub rate: f64,
    /// Time since its beginning.
    pub position: Duration,
    /// Its length.
    pub duration: Duration,
}

// ---- state ----------------------------------------------------------------------------------------------------------

/// The player of a record of an arm of `N` links.
pub struct Player<const N: usize> {
    tape: PlayedRecord<N>,
    publish: Recipient<Publish>,
    /// Topics that somebody subscribes to.
    wanted: BTreeSet<Topic>,
    is_paused: bool,
    rate: f64,
    /// In nanoseconds since the record's beginning.
    position: u64,
    /// When the position was reckoned.
    ticked: Instant,
    /// When the present messages are published again, if it stands still then.
    repeat: Instant,
    /// Which message of each latched topic has been published last.
    latched: BTreeMap<Topic, ReelPlace>,
}

/// A record that can be played.
pub struct PlayedRecord<const N: usize> {
    reel: Reel<File>,
    settings: Vec<(u64, RecordedSettings<N>)>,
}

impl<const N: usize> PlayedRecord<N> {
    /// Reads the record once.
    ///
    /// # Errors
    /// If it is none, or damaged before its end.
    pub fn open(file: File) -> Result<Self, ReadError> {
        let mut follower = SettingsFollower::new();
        let reel = Reel::open(file, |time, note| follower.take(time, note))?;
        let settings = follower.settings();
        Ok(Self { reel, settings })
    }
}

impl<const N: usize> Player<N> {
    /// Plays `tape` from its beginning.
    #[must_use]
    pub fn new(tape: PlayedRecord<N>, publish: Recipient<Publish>) -> Self {
        let now = Instant::now();
        Self {
            tape,
            publish,
            wanted: BTreeSet::new(),
            is_paused: false,
            rate: 1.0,
            position: 0,
            ticked: now,
            repeat: now,
            latched: BTreeMap::new(),
        }
    }
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<const N: usize> Actor for Player<N> {
    type Context = Context<Self>;

    fn started(&mut self, ctx: &mut Context<Self>) {
        self.ticked = Instant::now();
        ctx.run_interval(TICK, |player, _| player.tick());
    }
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl Ask for DriveRecord {
    type Answer = PlayerState;
}

impl<const N: usize> Handler<Call<DriveRecord>> for Player<N> {
    type Result = ();

    fn handle(&mut self, call: Call<DriveRecord>, _: &mut Context<Self>) {
        self.drive(call.ask);
        call.reply.conclude(self.state());
    }
}

impl<const N: usize> Handler<Interest> for Player<N> {
    type Result = ();

    fn handle(&mut self, interest: Interest, _: &mut Context<Self>) {
        let topic = interest.topic;
        self.latched.remove(&topic);
        if interest.wanted {
            self.wanted.insert(topic);
            self.attempt(|player| {
                player.publish_latched()?;
                player.publish_present(&BTreeSet::from([topic]))
            });
        } else {
            self.wanted.remove(&topic);
        }
    }
}

impl<const N: usize> Handler<SimulationTime> for Player<N> {
    type Result = f64;

    fn handle(&mut self, _: SimulationTime, _: &mut Context<Self>) -> f64 {
        let mut time = 0.0;
        self.attempt(|player| {
            if let Some(clock) = player.present(&BTreeSet::from([Topic::Clock]))?.first() {
                let clock = clock.message()?;
                let part = |path: &str| clock.pointer(path).and_then(Value::as_f64);
                let part = |path: &str| part(path).unwrap_or_default();
                time = part("/clock/sec") + 1e-9 * part("/clock/nanosec");
            }
            Ok(())
        });
        time
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl<const N: usize> Player<N> {
    fn drive(&mut self, how: DriveRecord) {
        self.tick();
        match how {
            DriveRecord::Pause(is_paused) => self.is_paused = is_paused,
            DriveRecord::Toggle => self.is_paused = !self.is_paused,
            DriveRecord::Rate(rate) => self.rate = rate,
            DriveRecord::Seek(to) => self.seek(to),
            DriveRecord::Look => {}
        }
    }

    fn state(&self) -> PlayerState {
        PlayerState {
            is_paused: self.is_paused,
            rate: self.rate,
            position: Duration::from_nanos(self.position),
            duration: Duration::from_nanos(self.tape.reel.duration()),
        }
    }

    /// A record that can't be read on stands still.
    fn attempt(&mut self, what: impl FnOnce(&mut Self) -> Result<(), ReadError>) {
        if let Err(error) = what(self) {
            tracing::error!(%error, "the record stands still");
            self.is_paused = true;
        }
    }

    /// Whether there is nothing more to come in the direction in which it goes.
    fn is_over(&self) -> bool {
        if self.rate > 0.0 {
            self.position >= self.tape.reel.duration()
        } else {
            self.position == 0
        }
    }

    fn tick(&mut self) {
        let now = Instant::now();
        let passed = (now - self.ticked).min(CATCH_UP);
        self.ticked = now;
        if !self.is_paused && !self.is_over() {
            self.attempt(|player| player.play(passed.mul_f64(player.rate.abs())));
        } else if now >= self.repeat {
            self.repeat = now + REPEAT;
            self.attempt(Self::publish_all_present);
        }
    }

    /// Publishes what comes within so much time of the record.
    fn play(&mut self, passed: Duration) -> Result<(), ReadError> {
        let passed = u64::try_from(passed.as_nanos()).unwrap_or(u64::MAX);
        let is_forward = self.rate > 0.0;
        let until = if is_forward {
            let end = self.tape.reel.duration();
            self.position.saturating_add(passed).min(end)
        } else {
            self.position.saturating_sub(passed)
        };
        for _ in 0..MAX_AT_ONCE {
            let moment = if is_forward {
                self.tape.reel.forward(until)?
            } else {
                self.tape.reel.backward(until)?
            };
            let Some(moment) = moment else {
                self.position = until;
                break;
            };
            self.position = moment.time;
            if !moment.topic.is_latched() && self.wanted.contains(&moment.topic) {
                self.publish(&moment);
            }
        }
        self.publish_latched()
    }

    fn seek(&mut self, to: Duration) {
        let to = u64::try_from(to.as_nanos()).unwrap_or(u64::MAX);
        self.position = to.min(self.tape.reel.duration());
        self.attempt(|player| {
            player.tape.reel.wind(player.position)?;
            player.publish_all_present()
        });
    }

    fn publish(&self, moment: &Moment) {
        match moment.frame() {
            Ok(frame) => self.publish.do_send(Publish {
                topic: moment.topic,
                frame: frame.into(),
            }),
            Err(error) => tracing::warn!(%error, "a message of the record is left out"),
        }
    }

    fn publish_all_present(&mut self) -> Result<(), ReadError> {
        self.publish_latched()?;
        let wanted = self.wanted.clone();
        self.publish_present(&wanted)
    }

    /// Publishes the last message of each of these topics, oldest first.
    fn publish_present(&mut self, topics: &BTreeSet<Topic>) -> Result<(), ReadError> {
        for moment in self.present(topics)?.iter().rev() {
            self.publish(moment);
        }
        Ok(())
    }

    /// The last message of each of these topics, newest first, as far as they have one that is not long past.
    fn present(&mut self, topics: &BTreeSet<Topic>) -> Result<Vec<Moment>, ReadError> {
        let mut missing: BTreeSet<Topic> = topics
            .iter()
            .copied()
            .filter(|topic| !topic.is_latched())
            .collect();
        let place = self.tape.reel.place();
        let past = u64::try_from(PRESENT.as_nanos()).unwrap_or(u64::MAX);
        let past = self.position.saturating_sub(past);
        let mut found = Vec::new();
        for _ in 0..MAX_AT_ONCE {
            if missing.is_empty() {
                break;
            }
            let Some(moment) = self.tape.reel.backward(past)? else {
                break;
            };
            if missing.remove(&moment.topic) {
                found.push(moment);
            }
        }
        self.tape.reel.come_back(place);
        let soon = u64::try_from(SOON.as_nanos()).unwrap_or(u64::MAX);
        if self.position < soon {
            for _ in 0..MAX_AT_ONCE {
                let Some(moment) = self.tape.reel.forward(soon)? else {
                    break;
                };
                if missing.remove(&moment.topic) {
                    found.insert(0, moment);
                }
            }
            self.tape.reel.come_back(place);
        }
        Ok(found)
    }

    /// Publishes the messages of latched topics that hold here and did not before.
    fn publish_latched(&mut self) -> Result<(), ReadError> {
        let wanted: Vec<Topic> = self
            .wanted
            .iter()
            .copied()
            .filter(|topic| topic.is_latched())
            .collect();
        for topic in wanted {
            let place = self.tape.reel.latched(topic, self.position);
            if let Some(place) = place
                && self.latched.get(&topic) != Some(&place)
            {
                self.latched.insert(topic, place);
                if let Some(moment) = self.tape.reel.moment(place)? {
                    self.publish(&moment);
                }
            }
        }
        Ok(())
    }

    /// The arm's settings as they were.
    fn settings(&self) -> Option<&RecordedSettings<N>> {
        let settings = &self.tape.settings;
        let after = settings.partition_point(|(time, _)| *time <= self.position);
        let (_, settings) = settings.get(after.saturating_sub(1))?;
        Some(settings)
    }
}
