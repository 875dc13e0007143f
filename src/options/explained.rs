//! Reports of `clap`, in words of ours.
//!
//! **Invariant:** a text that was asked for is not a refusal, and every refusal is one line.

use std::error::Error as _;

use clap::error::{ContextKind, ContextValue, ErrorKind};

use super::usage::UsageError;

/// Turns what `clap` reports into what we say: a text that was asked for, or a refusal on one line.
pub(super) fn explained(error: &clap::Error) -> Result<String, UsageError> {
    let context = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => text.clone(),
        _ => String::new(),
    };
    // The argument as the user gave it, and the option as the help shows it, share this place.
    let argument = match error.kind() {
        ErrorKind::InvalidSubcommand => context(ContextKind::InvalidSubcommand),
        _ => context(ContextKind::InvalidArg),
    };
    let list = |kind| match error.get(kind) {
        Some(ContextValue::Strings(all)) => all.join(", "),
        _ => String::new(),
    };
    Err(match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
            return Ok(error.to_string());
        }
        ErrorKind::UnknownArgument | ErrorKind::InvalidSubcommand if argument == "help" => {
            UsageError::Help
        }
        ErrorKind::UnknownArgument | ErrorKind::InvalidSubcommand => {
            UsageError::UnknownArgument { argument }
        }
        ErrorKind::MissingSubcommand => UsageError::MissingCommand {
            before: context(ContextKind::InvalidSubcommand),
            known: list(ContextKind::ValidSubcommand),
        },
        ErrorKind::MissingRequiredArgument => UsageError::MissingArgument {
            arguments: list(ContextKind::InvalidArg),
        },
        ErrorKind::InvalidValue if list(ContextKind::ValidValue).is_empty() => {
            UsageError::MissingValue { option: argument }
        }
        ErrorKind::InvalidValue => UsageError::Value {
            argument,
            needs: format!("must be one of {}", list(ContextKind::ValidValue)),
            value: context(ContextKind::InvalidValue),
        },
        ErrorKind::ValueValidation => UsageError::Value {
            argument,
            needs: error.source().map(ToString::to_string).unwrap_or_default(),
            value: context(ContextKind::InvalidValue),
        },
        ErrorKind::ArgumentConflict => match context(ContextKind::PriorArg) {
            other if other.is_empty() || other == argument => {
                UsageError::Repeated { option: argument }
            }
            other => UsageError::Conflict { argument, other },
        },
        ErrorKind::TooManyValues => UsageError::UnexpectedValue {
            option: argument,
            value: context(ContextKind::InvalidValue),
        },
        kind => UsageError::Arguments { kind },
    })
}
