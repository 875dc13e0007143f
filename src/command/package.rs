//! Completions for shells and pages of the manual, which a package has beside the program. Both are made from the
//! command line as it is read.
//!
//! **Invariant:** they have every command and option of this build, and no others.

use std::io;
use std::path::{Path, PathBuf};

use clap::builder::PathBufValueParser;
use clap::{Arg, ArgMatches, Command, value_parser};
use clap_complete::Shell;
use clap_mangen::Man;

use super::error::CommandError;

/// The name of the command that prints completions.
pub const COMPLETIONS: &str = "completions";
/// The name of the command that writes the manual.
pub const MAN: &str = "man";

/// The two commands.
#[must_use]
pub fn tools() -> [Command; 2] {
    let shell = Arg::new("shell").value_name("SHELL").required(true);
    let folder = Arg::new("folder").value_name("FOLDER").required(true);
    [
        Command::new(COMPLETIONS)
            .about("Print the completions of a shell")
            .after_help(
                "Examples:\n  source <(pendularm completions bash)\n  \
                 pendularm completions fish > ~/.config/fish/completions/pendularm.fish",
            )
            .arg(shell.value_parser(value_parser!(Shell)).help("Which shell")),
        Command::new(MAN)
            .about("Write the pages of the manual, one for each command")
            .after_help("Example:\n  pendularm man . && man ./pendularm-topic-echo.1")
            .arg(
                folder
                    .value_parser(PathBufValueParser::new())
                    .help("The folder for them, which has to be there"),
            ),
    ]
}

/// The shell that was asked for.
#[must_use]
pub fn shell(given: &ArgMatches) -> Shell {
    given.get_one("shell").copied().unwrap_or(Shell::Bash)
}

/// The folder that was asked for.
#[must_use]
pub fn folder(given: &ArgMatches) -> PathBuf {
    given
        .get_one::<PathBuf>("folder")
        .cloned()
        .unwrap_or_default()
}

/// The completions of `command` for a shell.
#[must_use]
pub fn complete(shell: Shell, mut command: Command) -> String {
    let name = command.get_name().to_owned();
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut command, name, &mut script);
    String::from_utf8_lossy(&script).into_owned()
}

/// Writes the manual of `command` and of each command in it.
///
/// # Errors
/// [`CommandError::System`] with the system's word.
pub fn pages(mut command: Command, folder: &Path) -> Result<(), CommandError> {
    command.build();
    write(command, folder).map_err(|why| CommandError::System {
        what: "the manual's folder",
        why,
    })
}

fn write(command: Command, folder: &Path) -> io::Result<()> {
    for one in command.get_subcommands() {
        write(one.clone(), folder)?;
    }
    let page = Man::new(command).source(concat!("pendularm ", env!("CARGO_PKG_VERSION")));
    page.generate_to(folder).map(drop)
}
