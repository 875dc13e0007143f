//! `/rosapi/get_time`: the simulation time.
//!
//! **Invariant:** the answer has the names of ROS 2 and of ROS 1.

use bytes::Bytes;
use serde_json::json;

use crate::protocol::catalog::Service;
use crate::protocol::messages::Stamp;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Fields, Rejections};
use crate::services::{Address, Ask};

/// Asks for the simulation time \[s\].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GetTime;

impl Ask for GetTime {
    type Answer = f64;

    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        Fields::read(arguments, service)?;
        Ok(Self)
    }

    fn write(time: f64, to: &Address) -> Bytes {
        let Stamp { sec, nanosec } = Stamp::from_seconds(time);
        // ROS 1 has other names for the same; some clients know only those.
        let time = json!({"sec": sec, "nanosec": nanosec, "secs": sec, "nsecs": nanosec});
        to.response(&json!({"time": time}), "")
    }
}
