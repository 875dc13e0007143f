//! Services with one field, `data`: `/arm_sim/pause` and `/pid_controller/enable`.
//!
//! **Invariant:** setting a switch to its present position changes nothing, except that a commanded effort
//! ends.

use bytes::Bytes;

use crate::protocol::op::fields::{Fields, Rejections};
use crate::services::{Address, Answered, Ask, Echo, FieldByField};

fn write_switch(echo: &Echo<bool>, to: &Address) -> Bytes {
    to.response(&object! { data: echo.values }, &echo.rejected.status())
}

/// Freezes or resumes simulation time. The answer is whether it is frozen.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Pause {
    /// True to freeze it.
    pub paused: Option<bool>,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

impl Ask for Pause {
    type Answer = Echo<bool>;
}

impl FieldByField for Pause {
    fn from_fields(fields: &mut Fields<'_>) -> Self {
        Self {
            paused: fields.boolean("data"),
            rejected: fields.rejections(),
        }
    }
}

impl Answered for Pause {
    fn write(echo: Echo<bool>, to: &Address) -> Bytes {
        write_switch(&echo, to)
    }
}

/// Switches the controller on or off. The answer is whether it is on.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Enable {
    /// True to switch it on.
    pub enabled: Option<bool>,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

impl Ask for Enable {
    type Answer = Echo<bool>;
}

impl FieldByField for Enable {
    fn from_fields(fields: &mut Fields<'_>) -> Self {
        Self {
            enabled: fields.boolean("data"),
            rejected: fields.rejections(),
        }
    }
}

impl Answered for Enable {
    fn write(echo: Echo<bool>, to: &Address) -> Bytes {
        write_switch(&echo, to)
    }
}
