//! Readers for values on the command line and in the environment, for `clap`.
//!
//! **Invariant:** a refusal begins with the name of the option or variable of the value.

use std::ffi::OsStr;
use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;

use clap::builder::TypedValueParser;
use clap::error::{Error, ErrorKind};
use clap::parser::ValueSource;
use clap::{Arg, Command};

/// Reads a value from its text. A byte that is not UTF-8 becomes a character that is in no valid value.
///
/// clap's own readers name the option if the variable is wrong (clap issue 5202).
#[derive(Clone)]
pub(crate) struct ValueReader<T>(pub(crate) fn(&str) -> Result<T, String>);

impl<T: Clone + Send + Sync + 'static> TypedValueParser for ValueReader<T> {
    type Value = T;

    fn parse_ref(&self, command: &Command, arg: Option<&Arg>, value: &OsStr) -> Result<T, Error> {
        self.parse_ref_(command, arg, value, ValueSource::CommandLine)
    }

    fn parse_ref_(
        &self,
        _: &Command,
        arg: Option<&Arg>,
        value: &OsStr,
        source: ValueSource,
    ) -> Result<T, Error> {
        let Self(read) = self;
        read(&value.to_string_lossy()).map_err(|why| {
            let variable = arg.and_then(Arg::get_env);
            let origin = match (source, variable, arg.and_then(Arg::get_long)) {
                (ValueSource::EnvVariable, Some(variable), _) => {
                    variable.to_string_lossy().into_owned()
                }
                (_, _, Some(option)) => format!("--{option}"),
                _ => arg.map(ToString::to_string).unwrap_or_default(),
            };
            Error::raw(ErrorKind::ValueValidation, format!("{origin} {why}"))
        })
    }
}

/// A number within the bounds.
pub(crate) fn within<T: FromStr + PartialOrd + Display>(
    range: &RangeInclusive<T>,
    kind: &str,
    text: &str,
) -> Result<T, String> {
    let number = text.parse().ok().filter(|number| range.contains(number));
    let needs = format!("{kind} from {} to {}", range.start(), range.end());
    needed(number, &needs, text)
}

/// The value, or a refusal of `text` with the needed kind of value.
pub(crate) fn needed<T>(value: Option<T>, needs: &str, text: &str) -> Result<T, String> {
    value.ok_or_else(|| format!("must be {needs}, got {text:?}"))
}

/// The value of one of these names.
pub(crate) fn one_of<T: Copy>(values: &[(&str, T)], text: &str) -> Result<T, String> {
    let value = values.iter().find(|(name, _)| *name == text);
    let names: Vec<&str> = values.iter().map(|(name, _)| *name).collect();
    let needs = match names.split_last() {
        Some((last, others)) => format!("{} or {last}", others.join(", ")),
        None => String::new(),
    };
    needed(value.map(|(_, value)| *value), &needs, text)
}

/// The number of links.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Links {
    /// A 2-link arm.
    Two,
    /// A 3-link arm.
    Three,
}

impl Links {
    /// The number itself.
    #[must_use]
    pub const fn count(self) -> usize {
        match self {
            Self::Two => 2,
            Self::Three => 3,
        }
    }
}

pub(crate) fn read_links(text: &str) -> Result<Links, String> {
    one_of(&[("2", Links::Two), ("3", Links::Three)], text)
}
