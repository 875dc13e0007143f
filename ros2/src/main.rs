//! `pendularm-ros2`: connects a running pendularm to a ROS 2 graph on Zenoh, with the wire format of `rmw_zenoh`.
//!
//! [`convention`], [`interfaces`] and [`translation`] are pure. [`actors`] connects the two sides. [`package`] writes
//! the types for a ROS 2 workspace. Types, their CDR and the catalog come from pendularm itself.
//!
//! **Invariant:** the program connects, and never listens.

mod actors;
mod convention;
mod interfaces;
mod options;
mod package;
mod report;
mod translation;

use std::path::Path;

use actix::{Actor, System};

use crate::actors::graph::GraphBridge;

fn main() -> std::io::Result<()> {
    let options = options::read();
    if let Some(folder) = &options.interfaces {
        write_package(folder);
        return Ok(());
    }
    let system = System::new();
    system.block_on(async { GraphBridge::new(options).start() });
    system.run()
}

/// Writes the package of types, and prints its path.
fn write_package(folder: &Path) {
    let path = folder.join(package::NAME);
    match package::write(&path) {
        Ok(count) => report::say(&format!("{}: {count} types", path.display())),
        Err(error) => {
            report::say(&format!("{}: {error}", path.display()));
            std::process::exit(1);
        }
    }
}
