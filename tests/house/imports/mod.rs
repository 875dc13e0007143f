//! Imports of the source, file by file: no circle between files, none between rooms, and the floors of the house. The
//! bridge to ROS 2 is a house of its own, whose floors are not looked at.
//!
//! **Rule:** an arrow runs from the file that names an item to the file that defines it. `mod` and `pub use` only
//! declare or re-export: they are no arrows, and re-exported names are followed. Unit tests may name any item.
//!
//! **Invariant:** the source is read token by token, so that comments, text and the lines of a path make no difference.

mod arrows;
mod circles;
mod files;
mod floors;
