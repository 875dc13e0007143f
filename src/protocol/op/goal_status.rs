//! The end of a goal, as the number of `action_msgs`.
//!
//! **Invariant:** the numbers are those of `action_msgs/msg/GoalStatus`.

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
