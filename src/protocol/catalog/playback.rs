//! The services by which a record that is replayed is driven. One row each.
//!
//! Names and types are those of rosbag2's player, as far as it has them. They are served by `pendularm replay --serve`
//! alone.
//!
//! **Invariant:** every row is named under [`PLAYER_PREFIX`].

use super::entry::{Field, ServiceEntry, required, service};
use super::node::Node;
use super::table::{fields, table};
use super::topics::ARM_STATE;

/// The prefix of the services' names.
pub const PLAYER_PREFIX: &str = "/rosbag2_player/";

table! {
    /// One of them.
    pub enum Playback of ServiceEntry {
        /// Stands still.
        Pause = of_player("/rosbag2_player/pause", "rosbag2_interfaces/srv/Pause").supersedes(ARM_STATE),
        /// Goes on.
        Resume = of_player("/rosbag2_player/resume", "rosbag2_interfaces/srv/Resume"),
        /// Stands still if it goes on, and goes on if it stands still.
        TogglePaused = of_player("/rosbag2_player/toggle_paused", "rosbag2_interfaces/srv/TogglePaused")
            .supersedes(ARM_STATE),
        /// Whether it stands still.
        IsPaused = of_player("/rosbag2_player/is_paused", "rosbag2_interfaces/srv/IsPaused")
            .response(fields![required("paused", "bool", "")]),
        /// How fast it goes: 1 as it was recorded, negative numbers backward.
        SetRate = of_player("/rosbag2_player/set_rate", "rosbag2_interfaces/srv/SetRate")
            .request(&RATE)
            .response(&SUCCESS)
            .supersedes(ARM_STATE),
        /// Sets how fast it goes.
        GetRate = of_player("/rosbag2_player/get_rate", "rosbag2_interfaces/srv/GetRate")
            .response(&RATE),
        /// Goes to a time since the record's beginning.
        Seek = of_player("/rosbag2_player/seek", "rosbag2_interfaces/srv/Seek")
            .request(fields![required("time", "builtin_interfaces/msg/Time", "s, ns")])
            .response(&SUCCESS)
            .supersedes(ARM_STATE),
        /// Where it is, and how long the record is.
        GetPosition = of_player("/rosbag2_player/get_position", "pendularm_interfaces/srv/GetPosition")
            .response(fields![
                required("position", "float64", "s"),
                required("duration", "float64", "s"),
            ]),
    }
}

const fn of_player(name: &'static str, type_name: &'static str) -> ServiceEntry {
    service(name, type_name, Node::Gateway).all_or_nothing()
}

const RATE: [Field; 1] = [required("rate", "float64", "1")];
const SUCCESS: [Field; 1] = [required("success", "bool", "")];

impl Playback {
    /// The service without its prefix: `seek`.
    #[must_use]
    pub fn short_name(self) -> &'static str {
        let name = self.entry().name;
        name.strip_prefix(PLAYER_PREFIX).unwrap_or(name)
    }

    /// The service of that absolute name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|one| one.entry().name == name)
    }
}
