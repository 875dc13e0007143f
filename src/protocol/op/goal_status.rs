//! The end of a goal, as the number of `action_msgs`.
//!
//! **Invariant:** the numbers are those of `action_msgs/msg/GoalStatus`.

/// How a goal stands at its end, as `action_msgs/msg/GoalStatus` counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GoalStatus {
    /// Never accepted.
    Unknown = 0,
    /// Reached.
    Succeeded = 4,
    /// Ended because somebody asked for it.
    Canceled = 5,
    /// Ended because another goal or a reset took its place.
    Aborted = 6,
}
