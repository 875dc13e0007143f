//! Imports of the source, file by file: no cycle between files, none between folders, and only allowed layers. The
//! layers of the bridge to ROS 2 are not checked. Also impls: the own functions of a type are in one file.
//!
//! **Rule:** an arrow runs from the file that names an item to the file that defines it. `mod` and `pub use` only
//! declare or re-export: they are no arrows, and re-exported names are followed. Unit tests may name any item.
//!
//! **Invariant:** the source is read token by token, so comments, texts and line breaks have no effect.

mod arrows;
mod cycles;
mod files;
mod impls;
mod layers;
