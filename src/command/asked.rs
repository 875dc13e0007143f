//! A command with what was given to it.
//!
//! **Invariant:** values are read before anything is sent: who asks wrongly has changed nothing.

use std::time::Duration;

use clap::ArgMatches;
use serde_json::Value;
use serde_json::value::RawValue;

use super::error::{CommandError, plain};
use super::field::FieldPath;
use super::output::print;
use super::session::Session;
use super::{spelling, yaml};
use crate::protocol::op::token::Token;

/// The name of the option that shows a token; its value is read where the environment is.
pub(super) const TOKEN: &str = "token";

/// A command, and what was given to it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Asked {
    subject: String,
    verb: String,
    given: ArgMatches,
    token: Option<Token>,
}

impl Asked {
    /// The command of a subject that `given` names, with the token to be shown.
    #[must_use]
    pub fn new(subject: &str, given: &ArgMatches, token: Option<Token>) -> Self {
        let (verb, given) = given.subcommand().unwrap_or(("", given));
        Self {
            subject: subject.to_owned(),
            verb: verb.to_owned(),
            given: given.clone(),
            token,
        }
    }

    /// Subject and verb.
    pub(super) fn path(&self) -> (&str, &str) {
        (&self.subject, &self.verb)
    }

    /// An argument that `clap` saw to, or an empty text.
    pub(super) fn text(&self, name: &str) -> &str {
        let value = self.given.get_one::<String>(name);
        value.map(String::as_str).unwrap_or_default()
    }

    /// A type that was given.
    pub(super) fn type_name(&self) -> Option<&str> {
        self.given.get_one::<String>("type").map(String::as_str)
    }

    /// Whether a switch is on.
    pub(super) fn has(&self, name: &str) -> bool {
        self.given.get_flag(name)
    }

    /// A number that was given.
    pub(super) fn number<T: Copy + Send + Sync + 'static>(&self, name: &str) -> Option<T> {
        self.given.get_one(name).copied()
    }

    /// How often, by `--once` or `--times`; none is for ever.
    pub(super) fn times(&self) -> Option<usize> {
        let once = self.has("once").then_some(1);
        once.or_else(|| self.number("times"))
    }

    /// A part of a message that was named.
    pub(super) fn field(&self) -> Option<&FieldPath> {
        self.given.get_one("field")
    }

    /// A value in JSON or YAML.
    pub(super) fn value(&self, name: &str, shown: &'static str) -> Result<Value, CommandError> {
        read(self.text(name), shown)
    }

    /// Type and value, either of which may be left out; no value is `{}`, as `ros2` has it.
    pub(super) fn typed_value(
        &self,
        shown: &'static str,
    ) -> Result<(Option<&str>, Value), CommandError> {
        let (first, second) = (self.type_name(), self.given.get_one::<String>("value"));
        let is_type = |text: &&str| {
            text.contains('/')
                && text
                    .chars()
                    .all(|one| one.is_alphanumeric() || "_/".contains(one))
        };
        let (type_name, text) = match second {
            Some(value) => (first, value.as_str()),
            None if first.is_none_or(|first| is_type(&first)) => (first, "{}"),
            None => (None, first.unwrap_or_default()),
        };
        Ok((type_name, read(text, shown)?))
    }

    /// Connects.
    pub(super) fn open(&self) -> Result<Session, CommandError> {
        let patience = self.number("timeout").map(Duration::from_secs_f64);
        Session::open(self.text("connect"), self.token.as_ref(), patience)
    }

    /// Prints an answer.
    pub(super) fn show(&self, raw: &RawValue) -> Result<(), CommandError> {
        self.spell(raw, "")
    }

    /// Prints one of several answers, each a document of its own in YAML.
    pub(super) fn show_next(&self, raw: &RawValue) -> Result<(), CommandError> {
        self.spell(raw, "---\n")
    }

    fn spell(&self, raw: &RawValue, end: &str) -> Result<(), CommandError> {
        if self.has("json") {
            return print(&spelling::json_line(raw));
        }
        spelling::print_yaml(raw, end, &mut print)
    }

    /// Prints names, and their types if they are to be shown.
    pub(super) fn list(
        &self,
        names: &[String],
        mut type_of: impl FnMut(&str) -> Result<String, CommandError>,
    ) -> Result<(), CommandError> {
        let mut text = String::new();
        for name in names {
            let type_name = if self.has("show-types") {
                Some(type_of(name)?)
            } else {
                None
            };
            text += &match (type_name, self.has("json")) {
                (None, true) => serde_json::json!({"name": name}).to_string(),
                (Some(type_name), true) => {
                    serde_json::json!({"name": name, "type": type_name}).to_string()
                }
                (None, false) => plain(name),
                (Some(type_name), false) => plain(&format!("{name} [{type_name}]")),
            };
            text.push('\n');
        }
        print(&text)
    }
}

fn read(text: &str, argument: &'static str) -> Result<Value, CommandError> {
    yaml::read(text).map_err(|why| CommandError::Unreadable {
        argument,
        why: plain(&why),
    })
}

/// An address with a port; the name in it is looked up when it is needed.
pub(super) fn read_address(text: &str) -> Result<String, String> {
    let (host, port) = text.rsplit_once(':').unwrap_or_default();
    if host.is_empty() || port.parse::<u16>().is_err() {
        return Err("must be a host with a port, such as 127.0.0.1:9095".to_owned());
    }
    Ok(text.to_owned())
}

/// A number greater than 0, and no more than a day or a million.
pub(super) fn read_positive(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok();
    number
        .filter(|number| *number >= 1e-6 && *number <= 1e6)
        .ok_or_else(|| "must be a number from 1e-6 to 1e6".to_owned())
}

/// A count, 1 at least.
pub(super) fn read_count(text: &str) -> Result<usize, String> {
    let number = text.parse().ok();
    number
        .filter(|number| (1..=1_000_000).contains(number))
        .ok_or_else(|| "must be a whole number from 1 to 1000000".to_owned())
}
