//! The plan of a seed: its features, faults and hostile behaviours, with their probabilities.
//!
//! A seed has only some of them (swarm testing). So a fault that one feature hides is visible in seeds without that
//! feature.

use std::fmt;

use crate::court::Court;

macro_rules! named {
    ($(#[$doc:meta])* $name:ident { $($(#[$one:meta])* $variant:ident),+ $(,)? }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
        pub enum $name { $($(#[$one])* $variant),+ }
        impl $name {
            pub const ALL: &[Self] = &[$(Self::$variant),+];
        }
    };
}

named! {
    /// Actions of honest clients.
    Feature {
        Ask, DriveArm, Setpoint, Publish, Subscribe, Unsubscribe, Throttle, Pieces, Cbor, Provide, Withdraw, CallOut, Compute,
        Action, Goal, Trial, Watch, Rosapi, Mistake, FragmentIn, Wait,
    }
}

named! {
    /// Faults of honest clients' connections and of the runtime.
    Fault { Stall, Vanish, ResetMidFrame, PanicInPipe, HalfClose, Jump, PanicInComputation, ProviderLost }
}

named! {
    /// Actions of hostile clients.
    Hostility {
        SlowNumbers, LongIds, GoalWithLongId, PingFlood, Deaf, FragmentBomb, Encodings, StepByHand, Registrations, DayLongCalls,
        Unfinished, Dribble, Garbage, TinyTimestep, Computations, Impersonate, Vanish, Silent, Foreign, ManyCalls, Throttles,
    }
}

named! {
    /// Actions of several honest clients together, or repeated ones.
    Burst { Stream, Flood, LongComputation, CancelAnothers }
}

/// Virtual time, room and probabilities of one seed.
#[derive(Debug)]
pub struct Plan {
    pub links: usize,
    pub honest: usize,
    pub hostile: usize,
    pub steps: usize,
    /// Probability that a client uses a WebSocket.
    pub socket: f64,
    /// Bytes that a pipe holds.
    pub room: usize,
    /// Bytes that a client writes at a time.
    pub piece: usize,
    /// Whether memory is scarce for all clients together.
    pub scarce: bool,
    pub features: Vec<(Feature, f64)>,
    pub faults: Vec<(Fault, f64)>,
    pub hostilities: Vec<(Hostility, f64)>,
    /// Probability that a step is a fault or a hostile action.
    pub fault: f64,
    pub hostility: f64,
    pub bursts: Vec<(Burst, f64)>,
    /// Probability that a step is a burst.
    pub burst: f64,
    /// Whether consecutive messages of a client are sent in one write.
    pub together: bool,
}

impl Plan {
    pub fn draw(court: &Court) -> Self {
        let has_faults = court.chance(0.6);
        let has_enemies = court.chance(0.6);
        let room = court.among(&[48, 200, 4096, 1 << 16, 1 << 20]);
        let hostile = if has_enemies { 1 + court.below(4) } else { 0 };
        let mut features = swarm(court, Feature::ALL, 0.6);
        // Without calls and waiting nothing much can happen.
        for one in [Feature::Ask, Feature::Wait] {
            features.retain(|(feature, _)| *feature != one);
            features.push((one, 2.0 + court.fraction() * 4.0));
        }
        Self {
            links: 2 + court.below(2),
            honest: 1 + court.below(5),
            hostile,
            steps: court.among(&[20, 40, 80, 160]),
            socket: court.among(&[0.0, 0.5, 1.0]),
            room,
            piece: court.among(&[1 << 20, 1 << 20, 100, 7]),
            scarce: court.chance(0.15),
            features,
            faults: swarm(court, Fault::ALL, 0.5),
            hostilities: swarm(court, Hostility::ALL, 0.4),
            fault: share(court, has_faults, 0.02, 0.1),
            hostility: share(court, has_enemies, 0.05, 0.5),
            bursts: swarm(court, Burst::ALL, 0.6),
            burst: 0.02 + 0.06 * court.fraction(),
            together: court.chance(0.5),
        }
    }
}

/// A probability between `least` and `least + span`, or none.
fn share(court: &Court, is_any: bool, least: f64, span: f64) -> f64 {
    if is_any {
        least + span * court.fraction()
    } else {
        0.0
    }
}

/// A random subset, each entry with a weight.
fn swarm<T: Copy + fmt::Debug>(court: &Court, all: &[T], share: f64) -> Vec<(T, f64)> {
    let mut chosen = all.to_vec();
    chosen.retain(|_| court.chance(share));
    let chosen = chosen.into_iter();
    let weighed = chosen.map(|one| (one, 0.2 + court.fraction() * 3.0));
    // Removed after the draw, so that the rest of the plan does not change.
    let without = std::env::var("WITHOUT").unwrap_or_default();
    let is_left_out = |one: &T| {
        let one = format!("{one:?}");
        without.split(',').any(|name| name == one)
    };
    weighed.filter(|(one, _)| !is_left_out(one)).collect()
}
