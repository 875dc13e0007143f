//! Servers with one fault, which is planted by a proxy before a right server: an exercise, and the self-test of the rules.
//!
//! | module | what |
//! | --- | --- |
//! | [`faults`] | the table of faults, at least one for each rule |
//! | [`proxy`] | changes the frames between clients and the server |

pub mod faults;
pub mod proxy;
