//! (being written: kinematics)
