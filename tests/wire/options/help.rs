//! `--help` and `--version`.

use super::parse;
use pendularm::options::Parsed;

#[test]
fn the_help_shows_every_option_with_its_variable_and_default() {
    let Ok(Parsed::Show(help)) = parse(&["--help"], &[("ARM_SIM_LINKS", "no matter")]) else {
        panic!("--help is to be shown");
    };
    for (option, variable, default) in [
        ("--links <N>", "ARM_SIM_LINKS", "2"),
        ("--bind <ADDRESS>", "ARM_SIM_BIND", "127.0.0.1:9095"),
        ("--seed <N>", "ARM_SIM_SEED", "a new seed at every start"),
        ("--log <LEVEL>", "ARM_SIM_LOG", "info"),
        ("--log-format <FORMAT>", "ARM_SIM_LOG_FORMAT", "text"),
        ("--token <TOKEN>", "ARM_SIM_TOKEN", "none"),
        #[cfg(feature = "record")]
        ("--record <FILE>", "ARM_SIM_RECORD", "none"),
        #[cfg(feature = "record")]
        ("--record-dir <FOLDER>", "ARM_SIM_RECORD_DIR", "none"),
        #[cfg(feature = "web")]
        ("--allow-host <HOSTS>", "ARM_SIM_ALLOW_HOST", "none"),
        #[cfg(feature = "web")]
        ("--allow-origin <ORIGINS>", "ARM_SIM_ALLOW_ORIGIN", "none"),
        #[cfg(feature = "web")]
        (
            "--strict-origin[=<SWITCH>]",
            "ARM_SIM_STRICT_ORIGIN",
            "false",
        ),
        #[cfg(feature = "web")]
        ("--report <FOLDER>", "ARM_SIM_REPORT", "report"),
    ] {
        let line = help.lines().find(|line| line.contains(option)).unwrap();
        assert!(
            line.contains(&format!("[env: {variable}] [default: {default}]")),
            "{line}"
        );
    }
    assert!(help.contains("--version"), "{help}");
    let usage = "\nUsage: pendularm [OPTIONS] [COMMAND]\n";
    assert!(help.contains(usage), "{help}");
    let build = if cfg!(feature = "web") {
        "This build has the web feature"
    } else {
        "This build is without the web feature"
    };
    assert!(help.contains(build), "{help}");
}

#[test]
fn the_version_is_the_packages_and_says_what_is_in_this_build() {
    let web = if cfg!(feature = "web") {
        "web"
    } else {
        "without web"
    };
    let expected = format!("pendularm {} ({web})\n", env!("CARGO_PKG_VERSION"));
    assert_eq!(parse(&["--version"], &[]), Ok(Parsed::Show(expected)));
}
