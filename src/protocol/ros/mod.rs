//! The formats and names of ROS: rosapi, CDR, CBOR, URDF, parameters.
//!
//! **Invariant:** names and types defined by ROS are only here and in the catalog.

pub mod cbor;
pub mod cdr;
pub mod cdr_reader;
pub mod parameters;
pub mod rosapi;
mod sink;
pub mod srdf;
pub mod stamps;
pub mod urdf;
