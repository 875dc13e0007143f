//! The command line.
//!
//! **Invariant:** no option makes the program listen. It connects to the arm and to a router.

use std::path::PathBuf;

use clap::{Arg, Command, value_parser};
use pendularm::address;

/// The options, with their defaults.
#[derive(Debug, Clone)]
pub struct Options {
    /// Host and port of the arm.
    pub connect: String,
    /// The endpoint of the Zenoh router.
    pub router: String,
    /// The ROS domain.
    pub domain: u32,
    /// Empty, or a namespace with a leading slash.
    pub namespace: String,
    /// The arm's token.
    pub token: Option<String>,
    /// The folder for the package of types. With it the program only writes the package.
    pub interfaces: Option<PathBuf>,
}

const ABOUT: &str = "\
Joins a running pendularm to a ROS 2 graph: its topics, services and actions, by the wire conventions of rmw_zenoh \
(Jazzy).

For several arms, run one of these for each, with a namespace of its own.";

const AFTER_HELP: &str = "\
On the ROS side: `ros2 run rmw_zenoh_cpp rmw_zenohd`, and RMW_IMPLEMENTATION=rmw_zenoh_cpp everywhere.
The program never listens. It reconnects while the arm or the router is not running.
With `--interfaces src` in a workspace, `colcon build` builds the types that are this project's own.
Exit status: 2 for a bad option, 1 if the package could not be written.";

/// Reads the command line, or ends the program with an error message.
#[must_use]
pub fn read() -> Options {
    let matches = command().get_matches();
    let text = |name: &str| matches.get_one::<String>(name).cloned();
    Options {
        connect: text("connect").unwrap_or_default(),
        router: text("router").unwrap_or_default(),
        domain: matches.get_one("domain").copied().unwrap_or_default(),
        namespace: text("namespace").unwrap_or_default(),
        token: text("token").or_else(token_of_environment),
        interfaces: matches.get_one("interfaces").cloned(),
    }
}

/// The variable of the arm's program.
fn token_of_environment() -> Option<String> {
    std::env::var("ARM_SIM_TOKEN")
        .ok()
        .filter(|token| !token.is_empty())
}

fn command() -> Command {
    Command::new("pendularm-ros2")
        .version(env!("CARGO_PKG_VERSION"))
        .about(ABOUT)
        .after_help(AFTER_HELP)
        .arg(
            option("connect", "ADDRESS")
                .default_value("127.0.0.1:9095")
                .value_parser(read_address)
                .help("Address of the arm: a port, a host, both, or a URL"),
        )
        .arg(
            option("router", "ENDPOINT")
                .default_value("tcp/127.0.0.1:7447")
                .help("Endpoint of a Zenoh router; nothing is encrypted or authenticated"),
        )
        .arg(
            option("domain", "N")
                .default_value("0")
                .value_parser(value_parser!(u32).range(0..=232))
                .help("The ROS domain, 0 to 232"),
        )
        .arg(
            option("namespace", "/NAME")
                .value_parser(read_namespace)
                .help("Prefix of every name, for one of several arms"),
        )
        .arg(option("token", "TOKEN").help(
            "Token of the arm; prefer the variable ARM_SIM_TOKEN, because other users can see options",
        ))
        .arg(
            option("interfaces", "FOLDER")
                .value_parser(value_parser!(PathBuf))
                .help("Only write the source of the ROS 2 package pendularm_interfaces into FOLDER"),
        )
}

/// An option, with the name of its value.
fn option(name: &'static str, value: &'static str) -> Arg {
    Arg::new(name).long(name).value_name(value)
}

/// Host and port.
fn read_address(text: &str) -> Result<String, &'static str> {
    address::read_url(text).ok_or("it must be a port, a host, both or a URL without TLS")
}

/// A valid ROS 2 namespace with a leading slash.
fn read_namespace(text: &str) -> Result<String, String> {
    let names = text.strip_prefix('/').unwrap_or(text);
    if names.is_empty() {
        return Ok(String::new());
    }
    let is_name = |name: &str| {
        name.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_')
            && name
                .chars()
                .all(|one| one.is_ascii_alphanumeric() || one == '_')
    };
    if names.split('/').all(is_name) {
        Ok(format!("/{names}"))
    } else {
        Err(
            "it must be names of letters, digits and underscores, each after a slash, such as /left"
                .to_owned(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_namespace_has_one_slash_in_front_and_none_behind() {
        assert_eq!(read_namespace("left"), Ok("/left".to_owned()));
        assert_eq!(
            read_namespace("/robots/left"),
            Ok("/robots/left".to_owned())
        );
        assert_eq!(read_namespace("/"), Ok(String::new()));
        for wrong in ["/left/", "//left", "/2nd", "/le ft", "/a*", "/%", "/a$"] {
            assert!(read_namespace(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn an_address_is_a_port_a_host_or_both() {
        let address = |text: &str| {
            let matches = command()
                .try_get_matches_from(["", "--connect", text])
                .ok()?;
            matches.get_one::<String>("connect").cloned()
        };
        for (text, found) in [
            ("9096", "127.0.0.1:9096"),
            ("localhost", "localhost:9095"),
            ("ws://10.0.0.1:80/", "10.0.0.1:80"),
        ] {
            assert_eq!(address(text).as_deref(), Some(found));
        }
        for wrong in ["", "host:port", "host:99999", "wss://host"] {
            assert_eq!(address(wrong), None, "{wrong}");
        }
    }
}
