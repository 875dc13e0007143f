//! An option, and what was given for it.
//!
//! **Invariant:** an option wins over its variable, which is then not looked at.

use std::ffi::OsString;

use clap::ArgMatches;

use super::usage::Origin;

/// An option and the environment variable that stands in for it.
pub(super) struct LaunchOption {
    pub(super) option: &'static str,
    pub(super) variable: &'static str,
    /// The value's name in the help.
    pub(super) value: &'static str,
    pub(super) about: &'static str,
    /// The value without either, as the help shows it.
    pub(super) default: &'static str,
    /// Given without a value it is true.
    pub(super) is_switch: bool,
}

/// A value that somebody gave, and where.
pub(super) struct Given {
    pub(super) origin: Origin,
    /// The value as text: a byte that is no UTF-8 becomes a sign that no valid value holds.
    pub(super) value: String,
}

/// Returns the value given for `setting`, if there is one.
pub(super) fn given(
    setting: &LaunchOption,
    matches: &ArgMatches,
    environment: impl Fn(&str) -> Option<OsString>,
) -> Option<Given> {
    let text = |value: &OsString| value.to_string_lossy().into_owned();
    if let Some(value) = matches.get_one::<OsString>(setting.option) {
        return Some(Given {
            origin: Origin::Option(setting.option),
            value: text(value),
        });
    }
    let value = environment(setting.variable).filter(|value| !value.is_empty())?;
    Some(Given {
        origin: Origin::Variable(setting.variable),
        value: text(&value),
    })
}
