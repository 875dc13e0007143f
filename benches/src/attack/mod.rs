//! Attacks of hostile clients, each for a few seconds, at one address of loopback.
//!
//! An attack is a list of [clients](script::Client) and a description. [`stage`] plays it. So `make attack` measures
//! its effect on a healthy client, and `make soak` mixes attacks.
//!
//! **Invariant:** an attack needs only sockets, and is bounded in connections, bytes at once, and time.

pub mod admission;
pub mod arm;
pub mod computing;
pub mod crowds;
pub mod forms;
pub mod gateway;
pub mod holding;
pub mod memory;
pub mod names;
pub mod reading;
pub mod script;
pub mod stage;
pub mod websocket;

use script::Client;

/// The token that every client sends if the server requires one.
pub const TOKEN: &str = "a-token-that-nobody-guesses-0123456789";

/// An attack.
#[derive(Clone, Copy)]
pub struct Attack {
    /// Its name, for `--only`.
    pub name: &'static str,
    /// Its actions.
    pub what: &'static str,
    /// Its clients.
    pub cast: fn() -> Vec<Client>,
    /// The arguments that the program is started with.
    pub options: &'static [&'static str],
    /// Whether the program is started with the token.
    pub locked: bool,
    /// All places are taken, as the limits allow, so new clients may be refused.
    pub fills: bool,
    /// Moves the arm or changes its settings.
    pub moves: bool,
    /// Holds what long frames and long answers need, so newcomers ask for both and have the time of a permit.
    pub holds: bool,
}

impl Attack {
    /// An attack on a program with default options.
    pub const fn new(name: &'static str, what: &'static str, cast: fn() -> Vec<Client>) -> Self {
        Self {
            name,
            what,
            cast,
            options: &[],
            locked: false,
            fills: false,
            moves: false,
            holds: false,
        }
    }

    /// On a program that was started with options.
    pub const fn with(self, options: &'static [&'static str]) -> Self {
        Self { options, ..self }
    }

    /// An attack on a program that requires the token.
    pub const fn locked(self) -> Self {
        Self {
            locked: true,
            ..self
        }
    }

    /// An attack that takes all places.
    pub const fn fills(self) -> Self {
        Self {
            fills: true,
            ..self
        }
    }

    /// An attack that holds what long frames and long answers need.
    pub const fn holds(self) -> Self {
        Self {
            holds: true,
            ..self
        }
    }

    /// An attack that moves the arm or changes its settings.
    pub const fn moves(self) -> Self {
        Self {
            moves: true,
            ..self
        }
    }
}

/// Whether `words` select a name: it contains one of them, or there are none.
pub fn picks(words: &str, name: &str) -> bool {
    words.is_empty() || words.split(',').any(|word| name.contains(word))
}

/// All attacks, by their target.
pub fn groups() -> [(&'static str, &'static [Attack]); 11] {
    [
        ("gateway", gateway::ATTACKS),
        ("websocket", websocket::ATTACKS),
        ("arm", arm::ATTACKS),
        ("computing", computing::ATTACKS),
        ("memory", memory::ATTACKS),
        ("holding", holding::ATTACKS),
        ("forms", forms::ATTACKS),
        ("names", names::ATTACKS),
        ("reading", reading::ATTACKS),
        ("crowds", crowds::ATTACKS),
        ("admission", admission::ATTACKS),
    ]
}
