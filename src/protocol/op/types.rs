//! The parts of operations: subscriptions, goals, and what a client serves to others.
//!
//! **Invariant:** merging two encodings gives no fragment size to a binary one.

use std::time::Duration;

use crate::protocol::messages::Level;
use crate::protocol::wire::json::Payload;

/// Longest `timeout` of a forwarded call: a day.
pub const MAX_TIMEOUT: Duration = Duration::from_secs(24 * 3600);
/// Longest `throttle_rate`: a year; beyond it, a delivery is never due in a connection's lifetime.
pub const MAX_THROTTLE: Duration = Duration::from_secs(365 * 24 * 3600);
/// Largest `queue_length`. The [outbox](crate::protocol::outbox) bounds held messages by bytes, and no message has
/// fewer than 40.
pub const MAX_QUEUE_LENGTH: usize = 100_000;

/// A finite number of seconds as a duration of at most `longest`. A negative number gives `longest`.
pub(super) fn duration(seconds: f64, longest: Duration) -> Duration {
    Duration::try_from_secs_f64(seconds).map_or(longest, |duration| duration.min(longest))
}

/// The lowest severity of statuses that a client gets; `None` for no status at all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Verbosity(pub Option<Level>);

impl Verbosity {
    /// Every status: the default over raw TCP.
    pub const ALL: Self = Self(Some(Level::Info));
    /// No status: the default over WebSocket.
    pub const NONE: Self = Self(None);

    /// Whether the client gets a status of that level.
    #[must_use]
    pub fn wants(self, level: Level) -> bool {
        self.0.is_some_and(|least| level >= least)
    }
}

/// A subscription.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Subscribe {
    /// Topic name.
    pub topic: String,
    /// Message type, if given.
    pub type_name: Option<String>,
    /// Least time between deliveries; zero for no throttling; at most [`MAX_THROTTLE`].
    pub throttle: Duration,
    /// Most messages that may wait or be held by throttling; 0 if it is not given; at most [`MAX_QUEUE_LENGTH`].
    pub queue_length: usize,
    /// The form of its messages.
    pub encoding: Encoding,
}

/// The form of a subscriber's messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Encoding {
    /// The encoding.
    pub compression: Compression,
    /// Longest piece of a message in JSON, in bytes, a power of two. Longer messages are sent in fragments. Without
    /// it, and for binary messages, a message is one piece.
    pub fragment_size: Option<usize>,
    /// Whether stamps also have the names of ROS 1. The registry sets it by the topic's type.
    pub ros1_stamps: bool,
}

impl Encoding {
    /// Whether frames of `length` bytes are sent unchanged in this form.
    #[must_use]
    pub fn keeps(self, length: usize) -> bool {
        let is_short = self.fragment_size.is_none_or(|size| length <= size);
        self.compression == Compression::None && is_short && !self.ros1_stamps
    }

    /// Combines two subscriptions of one client: the denser encoding, the smaller pieces, and all names of stamps.
    #[must_use]
    pub fn merged(self, other: Self) -> Self {
        let compression = self.compression.max(other.compression);
        let sizes = self.fragment_size.into_iter().chain(other.fragment_size);
        Self {
            compression,
            fragment_size: sizes.min().filter(|_| compression == Compression::None),
            ros1_stamps: self.ros1_stamps || other.ros1_stamps,
        }
    }
}

/// The encoding of a message. If a client requests several, the last one in this order applies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum Compression {
    /// JSON. It is also used for `png`, which saves nothing on short messages.
    #[default]
    None,
    /// CBOR, with typed arrays.
    Cbor,
    /// CDR in CBOR.
    CborRaw,
}

/// A goal.
#[derive(Debug, Clone)]
pub struct ActionGoal {
    /// Action name.
    pub action: String,
    /// Action type, if given.
    pub type_name: Option<String>,
    /// Its fields.
    pub args: Payload,
    /// Whether the client gets feedback.
    pub feedback: bool,
}

/// The final status of a goal, as in `action_msgs/msg/GoalStatus`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GoalStatus {
    /// Never accepted.
    Unknown = 0,
    /// Reached.
    Succeeded = 4,
    /// Cancelled by a client.
    Canceled = 5,
    /// Replaced by another goal or ended by a reset.
    Aborted = 6,
}

/// The kinds of names that a client can serve to others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Served {
    /// Its calls are answered.
    Service,
    /// Its goals are executed.
    Action,
}

impl Served {
    /// The word for it, which is also the member with its name.
    #[must_use]
    pub const fn noun(self) -> &'static str {
        match self {
            Self::Service => "service",
            Self::Action => "action",
        }
    }
}

/// An operation of a client that serves. If it concerns one call or goal, the frame's id identifies that.
#[derive(Debug, Clone)]
pub enum ProviderOp {
    /// The sender serves the name from now on.
    Advertise {
        /// Its type, if given.
        type_name: Option<String>,
    },
    /// Ends this registration.
    Unadvertise,
    /// Answers a call.
    Respond {
        /// Any value.
        values: Payload,
        /// Whether the call succeeded.
        result: bool,
        /// The provider's own `status`, if given.
        status: Option<String>,
    },
    /// Forwards feedback of a goal.
    Feedback {
        /// Any value.
        values: Payload,
    },
    /// Forwards the result of a goal.
    End {
        /// Any value.
        values: Payload,
        /// The status, a value of `action_msgs/msg/GoalStatus`.
        status: u8,
        /// Whether the goal has a result.
        result: bool,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_subscription_with_stamps_of_ros_1_suffices_for_a_client() {
        let plain = Encoding::default();
        let old = Encoding {
            ros1_stamps: true,
            ..plain
        };
        for (one, other, merged) in [(plain, old, old), (old, plain, old), (plain, plain, plain)] {
            assert_eq!(one.merged(other), merged);
        }
    }
}
