//! `pendularm replay --serve`: a record in the arm's place. Its topics are published as they were recorded, at a chosen
//! speed, forward and back; what is asked about the arm is answered as it was then.
//!
//! **Invariant:** nothing can be changed but the place in the record and the speed.

mod arm;
mod due;
mod launch;
mod settings;
mod wire;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fs::File;
use std::time::Duration;

use actix::prelude::*;
use tokio::time::Instant;

pub use self::launch::{NotReplayed, start};
use self::settings::{RecordedSettings, SettingsHistory};
pub use self::wire::list_only_what_is_served;
use crate::actors::arm::sim::SimulationTime;
use crate::actors::gateway::messages::PublishInTurn;
use crate::actors::node::{Ask, Call, Interest};
use crate::protocol::catalog::Topic;
use crate::record::{Moment, ReadError, Reel, ReelPlace};

/// Largest speed, either way: a tick is a second and a half of the record then.
pub const MAX_RATE: f64 = 100.0;
/// Messages of the record that are looked at from one tick to the next; what is due beyond waits for that.
pub const MAX_AT_ONCE: usize = 4096;
/// Time between two ticks.
const TICK: Duration = Duration::from_micros(16_667);

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
    publish: Recipient<PublishInTurn>,
    /// Topics that somebody subscribes to.
    wanted: BTreeSet<Topic>,
    /// Topics among them that somebody has come to, and whose present messages have not been looked for since.
    fresh: BTreeSet<Topic>,
    /// Whether that has been done since the last tick.
    has_looked: bool,
    /// Whether a place has been sought since the last tick.
    has_sought: bool,
    /// Messages that are published before the record goes on: what is present, for who has come.
    pending: VecDeque<Moment>,
    /// Where the record is to be by now, in nanoseconds since its beginning, if it is not there yet.
    target: Option<u64>,
    /// How many of its messages may still be looked at before the next tick.
    left: usize,
    /// Whether messages are on their way to subscribers.
    is_underway: bool,
    /// How many may be at once.
    at_once: usize,
    is_paused: bool,
    rate: f64,
    /// In nanoseconds since the record's beginning.
    position: u64,
    /// When the position was computed.
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
        let mut history = SettingsHistory::new();
        let reel = Reel::open(file, |time, note| history.take(time, note))?;
        let settings = history.settings();
        Ok(Self { reel, settings })
    }
}

impl<const N: usize> Player<N> {
    /// Plays `tape` from its beginning.
    #[must_use]
    pub fn new(tape: PlayedRecord<N>, publish: Recipient<PublishInTurn>) -> Self {
        let now = Instant::now();
        Self {
            tape,
            publish,
            wanted: BTreeSet::new(),
            fresh: BTreeSet::new(),
            has_looked: false,
            has_sought: false,
            pending: VecDeque::new(),
            target: None,
            left: MAX_AT_ONCE,
            is_underway: false,
            at_once: 1,
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
        ctx.run_interval(TICK, |player, ctx| {
            player.left = MAX_AT_ONCE;
            player.has_looked = false;
            player.has_sought = false;
            player.queue_fresh();
            player.tick();
            player.go_on(ctx);
        });
    }
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl Ask for DriveRecord {
    type Answer = Result<PlayerState, ReadError>;
}

impl<const N: usize> Handler<Call<DriveRecord>> for Player<N> {
    type Result = ();

    fn handle(&mut self, call: Call<DriveRecord>, ctx: &mut Context<Self>) {
        let driven = self.drive(call.ask, ctx);
        call.reply.conclude(driven.map(|()| self.state()));
    }
}

impl<const N: usize> Handler<Interest> for Player<N> {
    type Result = ();

    fn handle(&mut self, interest: Interest, ctx: &mut Context<Self>) {
        let topic = interest.topic;
        self.latched.remove(&topic);
        self.pending.retain(|moment| moment.topic != topic);
        if interest.wanted {
            self.wanted.insert(topic);
            self.fresh.insert(topic);
            self.queue_fresh();
            self.go_on(ctx);
        } else {
            self.wanted.remove(&topic);
            self.fresh.remove(&topic);
        }
    }
}

impl<const N: usize> Handler<SimulationTime> for Player<N> {
    type Result = f64;

    fn handle(&mut self, _: SimulationTime, _: &mut Context<Self>) -> f64 {
        let time = self.attempt(|player| {
            let present = player.present(&BTreeSet::from([Topic::Clock]))?;
            present.first().map_or(Ok(0.0), Moment::clock_time)
        });
        time.unwrap_or_default()
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl<const N: usize> Player<N> {
    fn drive(&mut self, how: DriveRecord, ctx: &mut Context<Self>) -> Result<(), ReadError> {
        self.tick();
        self.go_on(ctx);
        match how {
            DriveRecord::Pause(is_paused) => self.is_paused = is_paused,
            DriveRecord::Toggle => self.is_paused = !self.is_paused,
            DriveRecord::Rate(rate) => {
                self.rate = rate;
                // It may be the other way from here.
                self.target = None;
            }
            DriveRecord::Seek(to) => self.seek(to)?,
            DriveRecord::Look => {}
        }
        self.go_on(ctx);
        Ok(())
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
    fn attempt<T>(&mut self, what: impl FnOnce(&mut Self) -> Result<T, ReadError>) -> Option<T> {
        what(self).inspect_err(|error| self.stand_still(error)).ok()
    }

    fn stand_still(&mut self, error: &ReadError) {
        tracing::error!(%error, "the record stands still");
        self.is_paused = true;
        self.target = None;
    }

    /// Whether there is nothing more to come in the direction in which it goes.
    fn is_over(&self) -> bool {
        if self.rate > 0.0 {
            self.position >= self.tape.reel.duration()
        } else {
            self.position == 0
        }
    }

    /// Goes there, unless the record can't be read there.
    fn seek(&mut self, to: Duration) -> Result<(), ReadError> {
        let to = u64::try_from(to.as_nanos()).unwrap_or(u64::MAX);
        let to = to.min(self.tape.reel.duration());
        let wound = self.tape.reel.wind(to);
        wound.inspect_err(|error| self.stand_still(error))?;
        self.position = to;
        self.target = None;
        self.drop_pending();
        // All have come to another place.
        self.fresh.clone_from(&self.wanted);
        // The first place that is sought is looked at now, whoever has come before; another at the next tick.
        self.has_looked &= std::mem::replace(&mut self.has_sought, true);
        self.queue_fresh();
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
