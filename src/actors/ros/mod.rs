//! The nodes by which a client of ROS finds its way: rosapi, parameters, rosout, and frames for web viewers.
//!
//! **Invariant:** these nodes hold no state of the arm; they ask for it.

pub mod parameters;
pub mod rosapi;
pub mod rosout;
pub mod tf_web;
