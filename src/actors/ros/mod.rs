//! The nodes for ROS clients: rosapi, rosout, and frames for web viewers.
//!
//! **Invariant:** these nodes store no state of the arm. They request it.

pub mod rosapi;
pub mod rosout;
pub mod tf_web;
