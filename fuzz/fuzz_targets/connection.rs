//! Whole connections over plain TCP, in virtual time: three clients, a registry, and a node that is prompt, slow or forgetful.
//!
//! [`pendularm_fuzz::session`] says what is asserted.
//!
//! Input: whether room is scarce, the script.

#![no_main]

use libfuzzer_sys::fuzz_target;
use pendularm_fuzz::client::Door;
use pendularm_fuzz::limits::{DOING, hold};
use pendularm_fuzz::session::{Step, play};

fuzz_target!(|script: (bool, Vec<Step<'_>>)| {
    let (is_scarce, steps) = script;
    hold(0, DOING, || play(Door::Plain, is_scarce, &steps));
});
