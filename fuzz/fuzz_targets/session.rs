//! Whole connections in virtual time: three clients over TCP or WebSocket, and a registry. Behind it is a node that is
//! prompt, slow or forgetful, or the runtime's own nodes: the arm, inverse kinematics, goals, trials, rosapi.
//!
//! Asserted: everything in [`pendularm_fuzz::session`], and that every published position and velocity is a number.
//!
//! Input: whether memory is scarce, whether clients use WebSocket, whether the runtime's own nodes serve, and the
//! script.

#![no_main]

use libfuzzer_sys::fuzz_target;
use pendularm_client::codec::Framing;
use pendularm_fuzz::limits::{DOING, hold};
use pendularm_fuzz::session::{Step, play};

fuzz_target!(|script: (bool, bool, bool, Vec<Step<'_>>)| {
    let (is_scarce, is_socket, has_arm, steps) = script;
    let framing = if is_socket {
        Framing::WebSocket
    } else {
        Framing::Lines
    };
    hold(0, DOING, || play(framing, is_scarce, has_arm, &steps));
});
