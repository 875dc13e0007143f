//! Commands that ask a running pendularm, in the words of `ros2`: one file per subject.
//!
//! They are a client as any other, over TCP; nothing here knows more of the runtime than what is on the wire.
//!
//! **Invariant:** no answer, no closed pipe and no signal makes a command panic, and its exit status says how it went.

mod action;
mod asked;
mod diagnostics;
mod error;
mod field;
mod output;
mod package;
mod param;
mod service;
mod session;
mod spelling;
mod timed;
mod topic;
mod verbs;
mod yaml;

use clap::Command;

pub use self::asked::Asked;
pub use self::error::CommandError;
pub use self::package::{COMPLETIONS, MAN, complete, folder, pages, shell, tools};

/// The subjects, each with its commands, as `clap` is to read them.
#[must_use]
pub fn subjects() -> [Command; 5] {
    [
        topic::command(),
        service::command(),
        action::command(),
        param::command(),
        diagnostics::command(),
    ]
}

/// Does what was asked, and prints what comes of it.
///
/// # Errors
/// [`CommandError`], which has the exit status.
pub fn run(asked: &Asked) -> Result<(), CommandError> {
    match asked.path() {
        ("topic", "list") => topic::list(asked),
        ("topic", "echo") => topic::echo(asked),
        ("topic", "hz") => topic::hz(asked),
        ("topic", _) => topic::publish(asked),
        ("service", "list") => service::list(asked),
        ("service", _) => service::call(asked),
        ("action", "list") => action::list(asked),
        ("action", _) => action::send_goal(asked),
        ("param", "list") => param::list(asked),
        ("param", "get") => param::get(asked),
        ("param", _) => param::set(asked),
        _ => diagnostics::show(asked),
    }
}
