//! Whole connections with the runtime's own nodes behind them: the arm, inverse kinematics, goals, trials, rosapi.
//!
//! What holds is said in [`pendularm_fuzz::session`], and that every position and velocity that the arm publishes is a number.
//!
//! Input: the script; half of them speak through a WebSocket.

#![no_main]

use libfuzzer_sys::fuzz_target;
use pendularm_fuzz::client::Door;
use pendularm_fuzz::session::{Step, play_with_arm};

fuzz_target!(|script: (bool, Vec<Step<'_>>)| {
    let (is_socket, steps) = script;
    play_with_arm(if is_socket { Door::Socket } else { Door::Plain }, &steps);
});
