//! A connection in virtual time: the delay of a slow client, and the writes of frames.
//! `exchanges/connections.txt` has its calls, its stalls and its ends.
//!
//! **Invariant:** no test depends on the machine's speed, because times are read from the paused clock.

mod pace;
mod writes;

use std::time::Duration;

use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, WIDE, settle};
use pendularm::actors::node::Publish;
use pendularm::protocol::catalog::Topic;
use pendularm::protocol::messages;
use serde_json::json;
use tokio::time::{sleep, sleep_until};
