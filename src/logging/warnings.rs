//! Warnings and errors for whoever listens in the program itself.
//!
//! **Invariant:** a listener that does not keep up holds nobody up.

use std::fmt::{self, Write as _};
use std::sync::{Mutex, PoisonError};

use tokio::sync::mpsc::Sender;
use tracing::field::{Field, Visit};
use tracing::level_filters::LevelFilter;
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::layer::Context;

/// A warning or an error, for whoever listens in the program itself.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Warning {
    /// The level as ROS has it: 30 is a warning, 40 an error.
    pub level: u8,
    /// The node that it comes from.
    pub node: &'static str,
    /// The event, in words.
    pub text: String,
    /// The source file.
    pub file: &'static str,
    /// The line in it.
    pub line: u32,
}

/// The listener to warnings.
static LISTENER: Mutex<Option<Sender<Warning>>> = Mutex::new(None);

/// Warnings and errors go to `listener` too from now on, whatever the log's level; `None`: to nobody. What does not fit
/// into the channel is not waited for.
pub fn hear_warnings(listener: Option<Sender<Warning>>) {
    *LISTENER.lock().unwrap_or_else(PoisonError::into_inner) = listener;
}

/// Hands warnings to the listener.
pub(super) struct Warnings;

impl<S: Subscriber> Layer<S> for Warnings {
    fn max_level_hint(&self) -> Option<LevelFilter> {
        Some(LevelFilter::WARN)
    }

    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let metadata = event.metadata();
        let level = match *metadata.level() {
            Level::ERROR => 40,
            Level::WARN => 30,
            _ => return,
        };
        let listener = LISTENER.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(listener) = &*listener {
            let mut text = Text::default();
            event.record(&mut text);
            let _ = listener.try_send(Warning {
                level,
                node: node_of(metadata.target()),
                text: text.0,
                file: metadata.file().unwrap_or_default(),
                line: metadata.line().unwrap_or_default(),
            });
        }
    }
}

/// The actor in whose module something was reported: `registry` of `pendularm::actors::gateway::registry::ops`.
fn node_of(target: &'static str) -> &'static str {
    let modules = target.split("::").skip_while(|part| *part != "actors");
    let modules: Vec<&'static str> = modules.skip(1).take(2).collect();
    match modules[..] {
        ["arm", "sim"] => "arm_sim",
        // Folders, in which the actors stand.
        ["arm" | "compute" | "gateway" | "resources" | "ros", actor] | [actor, ..] => actor,
        [] => "pendularm",
    }
}

/// An event as one line: the message, then the fields.
#[derive(Default)]
struct Text(String);

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        // A `String` takes whatever is written to it.
        let _ = if field.name() == "message" {
            let fields = std::mem::take(&mut self.0);
            write!(self.0, "{value:?}{fields}")
        } else {
            write!(self.0, " {}={value:?}", field.name())
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_warning_names_the_actor_and_not_the_folder_in_which_it_stands() {
        for (target, node) in [
            ("pendularm::actors::arm::sim::telemetry", "arm_sim"),
            ("pendularm::actors::arm::ik_action", "ik_action"),
            ("pendularm::actors::gateway::registry::ops", "registry"),
            ("pendularm::actors::gateway::connection", "connection"),
            ("pendularm::actors::compute::workers", "workers"),
            ("pendularm::actors::runtime", "runtime"),
            ("pendularm::logging", "pendularm"),
        ] {
            assert_eq!(node_of(target), node, "{target}");
        }
    }
}
