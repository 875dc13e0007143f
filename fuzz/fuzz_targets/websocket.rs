//! Whole connections over WebSocket, in virtual time: three clients, a registry, and a node that is prompt, slow or forgetful.
//!
//! What holds is said in [`pendularm_fuzz::session`].
//!
//! Input: the script.

#![no_main]

use libfuzzer_sys::fuzz_target;
use pendularm_fuzz::client::Door;
use pendularm_fuzz::session::{Step, play};

fuzz_target!(|steps: Vec<Step<'_>>| play(Door::Socket, &steps));
