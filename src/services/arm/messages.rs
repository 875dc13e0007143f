//! Messages of clients to the arm: efforts on `/effort_controller/commands`. Setpoints are in
//! [`trajectory`](crate::services::trajectory).
//!
//! **Invariant:** a message is taken as a whole, or refused with the reason.

use crate::protocol::catalog::Topic;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::protocol::wire::json::Payload;

/// Names of the joints, base first.
const JOINT_NAMES: [&str; 3] = ["joint1", "joint2", "joint3"];

/// The names of an arm's joints, base first.
#[must_use]
pub fn joint_names<const N: usize>() -> [&'static str; N] {
    std::array::from_fn(|i| JOINT_NAMES.get(i).copied().unwrap_or_default())
}

/// Reads the efforts \[N m\] of a `std_msgs/msg/Float64MultiArray`. Its layout is ignored.
///
/// # Errors
/// If the message does not hold one for each joint.
pub fn read_effort<const N: usize>(msg: &Payload) -> Result<[f64; N], Rejections> {
    let mut fields = Fields::of_message(msg, Topic::EffortCommands)?;
    let effort = fields.array("data", Bound::Finite);
    effort.ok_or_else(|| fields.finish())
}
