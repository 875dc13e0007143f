//! The nodes by which a client of ROS finds its way: rosapi and rosout.
//!
//! **Invariant:** these nodes hold no state of the arm; they ask for it.

pub mod rosapi;
pub mod rosout;
