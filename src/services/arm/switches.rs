//! Services with one field, `data`: `/arm_sim/pause` and `/pid_controller/enable`.
//!
//! **Invariant:** setting a switch to its present position changes nothing, except that a commanded effort
//! ends.

use bytes::Bytes;

use crate::protocol::op::fields::{Fields, Rejections};
use crate::services::{Address, Echo};

fn write_switch(echo: &Echo<bool>, to: &Address) -> Bytes {
    to.response(&object! { data: echo.values }, &echo.rejected.status())
}

request! {
    /// Freezes or resumes simulation time. The answer is whether it is frozen.
    pub struct Pause -> Echo<bool>, |fields| {
        /// True to freeze it.
        paused: Option<bool> = fields.boolean("data"),
    }

    fn write(echo: Echo<bool>, to: &Address) -> Bytes {
        write_switch(&echo, to)
    }
}

request! {
    /// Switches the controller on or off. The answer is whether it is on.
    pub struct Enable -> Echo<bool>, |fields| {
        /// True to switch it on.
        enabled: Option<bool> = fields.boolean("data"),
    }

    fn write(echo: Echo<bool>, to: &Address) -> Bytes {
        write_switch(&echo, to)
    }
}
