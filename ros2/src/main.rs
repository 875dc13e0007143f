//! `pendularm-ros2`: joins a running pendularm to a ROS 2 graph, on Zenoh, by the wire conventions of `rmw_zenoh`.
//!
//! [`convention`], [`interfaces`] and [`translation`] are pure; [`actors`] joins the two sides; [`package`] writes types
//! down for a workspace of ROS 2. Types, their CDR and the list of all that there is come from pendularm itself.
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

/// Writes the package of types, and says where it is.
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
