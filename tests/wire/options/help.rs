//! `--help` and `--version`.

use super::parse;
use pendularm::options::Parsed;

#[test]
fn the_help_shows_every_option_with_its_variable_and_default() {
    let Ok(Parsed::Show(help)) = parse(&["--help"]) else {
        panic!("--help is to be shown");
    };
    for (option, variable, default) in [
        ("--links <N>", "ARM_SIM_LINKS", "2"),
        ("--bind <ADDRESS>", "ARM_SIM_BIND", "127.0.0.1:9095"),
        ("--clients <N>", "ARM_SIM_CLIENTS", "256"),
        ("--seed <N>", "ARM_SIM_SEED", ""),
        ("--log <LEVEL>", "ARM_SIM_LOG", "info"),
        ("--log-format <FORMAT>", "ARM_SIM_LOG_FORMAT", "text"),
        ("--token <TOKEN>", "ARM_SIM_TOKEN", ""),
        #[cfg(feature = "record")]
        ("--record <FILE>", "ARM_SIM_RECORD", ""),
        #[cfg(feature = "record")]
        ("--record-dir <FOLDER>", "ARM_SIM_RECORD_DIR", ""),
        #[cfg(feature = "web")]
        ("--allow-host <HOSTS>", "ARM_SIM_ALLOW_HOST", ""),
        #[cfg(feature = "web")]
        ("--allow-origin <ORIGINS>", "ARM_SIM_ALLOW_ORIGIN", ""),
        #[cfg(feature = "web")]
        (
            "--strict-origin[=<SWITCH>]",
            "ARM_SIM_STRICT_ORIGIN",
            "false",
        ),
        #[cfg(feature = "web")]
        ("--allow-frame <ORIGINS>", "ARM_SIM_ALLOW_FRAME", ""),
        #[cfg(feature = "web")]
        ("--report <FOLDER>", "ARM_SIM_REPORT", "report"),
    ] {
        let line = help.lines().find(|line| line.contains(option)).unwrap();
        let mut expected = format!("[env: {variable}]");
        if !default.is_empty() {
            expected += &format!(" [default: {default}]");
        }
        assert!(line.ends_with(&expected), "{line}");
    }
    assert!(help.contains("--version"), "{help}");
    let usage = "\nUsage: pendularm [OPTIONS]\n       pendularm <COMMAND>\n";
    assert!(help.contains(usage), "{help}");
}

#[test]
fn help_is_a_command_too() {
    assert_eq!(parse(&["help"]), parse(&["--help"]));
    assert_eq!(parse(&["help", "plan"]), parse(&["plan", "--help"]));
}
