//! The command line and the environment: what is taken, what is refused, and in which words.
//!
//! **Invariant:** the tests of the values hand arguments and variables in; only the last few start the program itself.

use std::ffi::OsString;
use std::process::{Command, Output, Stdio};

use crate::common;
use pendularm::logging::LogFormat;
use pendularm::options::{DEFAULT_BIND, Links, Options, Parsed, UsageError};
use proptest::prelude::*;
use tracing::level_filters::LevelFilter;

fn parse(arguments: &[&str], variables: &[(&str, &str)]) -> Result<Parsed, UsageError> {
    let arguments = ["pendularm"].iter().chain(arguments);
    Options::parse(arguments, |name| {
        let found = variables.iter().find(|(variable, _)| *variable == name)?;
        Some(OsString::from(found.1))
    })
}

#[track_caller]
fn options(arguments: &[&str], variables: &[(&str, &str)]) -> Options {
    match parse(arguments, variables) {
        Ok(Parsed::Serve(options)) => options,
        other => panic!("not to be served: {other:?}"),
    }
}

#[track_caller]
fn refusal(arguments: &[&str], variables: &[(&str, &str)]) -> String {
    parse(arguments, variables).unwrap_err().to_string()
}

#[test]
fn without_arguments_and_variables_the_defaults_hold() {
    assert_eq!(options(&[], &[]), Options::default());
    let Options {
        links,
        bind,
        is_default_bind,
        seed,
        log,
        token,
        ..
    } = Options::default();
    assert_eq!(links, Links::Two);
    assert_eq!(
        (bind.to_string().as_str(), is_default_bind),
        ("127.0.0.1:9095", true)
    );
    assert_eq!((seed, log, token), (None, LevelFilter::INFO, None));
}

#[test]
fn an_empty_variable_counts_as_unset() {
    let empty = [
        ("ARM_SIM_LINKS", ""),
        ("ARM_SIM_BIND", ""),
        ("ARM_SIM_SEED", ""),
        ("ARM_SIM_LOG", ""),
        ("ARM_SIM_LOG_FORMAT", ""),
        ("ARM_SIM_TOKEN", ""),
        ("ARM_SIM_RECORD", ""),
        ("ARM_SIM_RECORD_DIR", ""),
        ("ARM_SIM_ALLOW_HOST", ""),
        ("ARM_SIM_ALLOW_ORIGIN", ""),
        ("ARM_SIM_STRICT_ORIGIN", ""),
        ("ARM_SIM_REPORT", ""),
    ];
    assert_eq!(options(&[], &empty), Options::default());
}

#[test]
fn two_and_three_links_are_taken_from_the_option_and_from_the_variable() {
    for (value, links, count) in [("2", Links::Two, 2), ("3", Links::Three, 3)] {
        assert_eq!(options(&["--links", value], &[]).links, links);
        assert_eq!(options(&[&format!("--links={value}")], &[]).links, links);
        assert_eq!(options(&[], &[("ARM_SIM_LINKS", value)]).links, links);
        assert_eq!(links.count(), count);
    }
}

#[test]
fn any_other_number_of_links_is_refused_by_name_and_value() {
    for value in ["1", "4", "02", " 2", "2.0", "two", "-2"] {
        let expected = format!("must be 2 or 3, got {value:?}");
        let option = refusal(&[&format!("--links={value}")], &[]);
        assert_eq!(option, format!("--links {expected}"));
        let variable = refusal(&[], &[("ARM_SIM_LINKS", value)]);
        assert_eq!(variable, format!("ARM_SIM_LINKS {expected}"));
    }
}

#[test]
fn an_option_wins_over_its_variable_which_is_not_looked_at() {
    let variables = [("ARM_SIM_LINKS", "seven"), ("ARM_SIM_SEED", "1")];
    let options = options(&["--links", "3", "--seed", "2"], &variables);
    assert_eq!((options.links, options.seed), (Links::Three, Some(2)));
}

#[test]
fn loopback_addresses_are_taken_and_only_the_default_one_brings_the_other_family() {
    for address in [
        "127.0.0.1:0",
        "127.0.0.2:9095",
        "[::1]:9095",
        "127.0.0.1:9096",
    ] {
        let options = options(&["--bind", address], &[]);
        assert_eq!(
            (options.bind.to_string().as_str(), options.is_default_bind),
            (address, false)
        );
    }
    let options = options(&[], &[("ARM_SIM_BIND", "127.0.0.1:9095")]);
    assert_eq!(
        (options.bind, options.is_default_bind),
        (DEFAULT_BIND, true)
    );
}

#[test]
fn an_address_that_other_machines_could_reach_needs_a_token() {
    for address in [
        "0.0.0.0:9095",
        "[::]:9095",
        "192.0.2.1:9095",
        "[::ffff:127.0.0.1]:9095",
    ] {
        let expected = format!(
            "must be a loopback address, such as 127.0.0.1:9095, unless --token gives something to ask for, got {address:?}"
        );
        assert_eq!(
            refusal(&["--bind", address], &[]),
            format!("--bind {expected}")
        );
        assert_eq!(
            refusal(&[], &[("ARM_SIM_BIND", address)]),
            format!("ARM_SIM_BIND {expected}")
        );
        let arguments = ["--bind", address, "--token", "open-sesame-once-more"];
        let options = options(&arguments, &[]);
        assert_eq!(options.bind.to_string(), address);
        assert!(options.token.unwrap().matches("open-sesame-once-more"));
    }
}

#[test]
fn what_is_no_address_with_a_port_is_refused() {
    for text in [
        "localhost:9095",
        "127.0.0.1",
        "9095",
        ":9095",
        "127.0.0.1:65536",
        "::1:9095",
    ] {
        let refused = refusal(&[], &[("ARM_SIM_BIND", text)]);
        assert!(
            refused.starts_with("ARM_SIM_BIND must be an IP address with a port"),
            "{refused}"
        );
        assert!(refused.ends_with(&format!("got {text:?}")), "{refused}");
    }
}

#[test]
fn a_seed_is_any_number_of_64_bits() {
    assert_eq!(options(&["--seed", "0"], &[]).seed, Some(0));
    let largest = u64::MAX.to_string();
    assert_eq!(
        options(&[], &[("ARM_SIM_SEED", &largest)]).seed,
        Some(u64::MAX)
    );
    for value in ["18446744073709551616", "1.5", "x"] {
        let expected = format!(
            "ARM_SIM_SEED must be a whole number from 0 to 18446744073709551615, got {value:?}"
        );
        assert_eq!(refusal(&[], &[("ARM_SIM_SEED", value)]), expected);
    }
    for negative in [&["--seed=-1"][..], &["--seed", "-1"]] {
        let refused = refusal(negative, &[]);
        assert!(refused.starts_with("--seed must be"), "{refused}");
        assert!(refused.ends_with("got \"-1\""), "{refused}");
    }
}

#[test]
fn every_log_level_has_a_name_and_other_names_are_refused() {
    let levels = [
        ("off", LevelFilter::OFF),
        ("error", LevelFilter::ERROR),
        ("warn", LevelFilter::WARN),
        ("info", LevelFilter::INFO),
        ("debug", LevelFilter::DEBUG),
        ("trace", LevelFilter::TRACE),
    ];
    for (name, level) in levels {
        assert_eq!(options(&[], &[("ARM_SIM_LOG", name)]).log, level);
        assert_eq!(options(&["--log", name], &[]).log, level);
    }
    assert_eq!(
        refusal(&[], &[("ARM_SIM_LOG", "loud")]),
        "ARM_SIM_LOG must be one of off, error, warn, info, debug, trace, got \"loud\""
    );
}

#[test]
fn the_log_is_text_or_json() {
    assert_eq!(options(&[], &[]).log_format, LogFormat::Text);
    assert_eq!(
        options(&["--log-format=json"], &[]).log_format,
        LogFormat::Json
    );
    let variable = [("ARM_SIM_LOG_FORMAT", "json")];
    assert_eq!(options(&[], &variable).log_format, LogFormat::Json);
    assert_eq!(
        refusal(&["--log-format", "xml"], &variable),
        "--log-format must be text or json, got \"xml\""
    );
}

#[test]
fn arguments_that_do_not_exist_are_refused_by_name() {
    for argument in ["--speed", "-x", "fly", "--link"] {
        let expected = format!("unknown argument {argument:?}; --help shows all of them");
        assert_eq!(refusal(&[argument], &[]), expected);
    }
    for help in [&["help"][..], &["plan", "help"]] {
        let expected = "help is an option, behind any command: use --help";
        assert_eq!(refusal(help, &[]), expected);
    }
    assert!(refusal(&["--speed=3"], &[]).starts_with("unknown argument \"--speed\""));
    assert!(refusal(&["--links", "2", "3"], &[]).starts_with("unknown argument \"3\""));
}

#[test]
fn a_report_is_asked_for_with_its_directory_its_sections_and_its_haste() {
    let report = |arguments: &[&str]| {
        let all = ["pendularm", "report"].iter().chain(arguments);
        match Options::parse(all, |_| None) {
            Ok(Parsed::Report(report)) => report,
            other => panic!("no report: {other:?}"),
        }
    };
    let plain = report(&[]);
    assert_eq!((plain.out.to_str(), plain.quick), (Some("report"), false));
    assert!(plain.only.is_empty());
    let all = report(&["--out", "here", "--only", "error,budget", "--quick"]);
    assert_eq!((all.out.to_str(), all.quick), (Some("here"), true));
    assert_eq!(all.only, ["error", "budget"]);
    assert!(refusal(&["--links", "2", "report"], &[]).starts_with("unknown argument \"--links\""));
    assert!(refusal(&["report", "--speed"], &[]).starts_with("unknown argument \"--speed\""));
    for (names, wrong) in [("error,colour", "colour"), ("", "")] {
        let refused = refusal(&["report", "--only", names], &[]);
        let known = pendularm::report::names();
        let expected = format!("--only <NAMES> must be one of {known}, got {wrong:?}");
        assert_eq!(refused, expected);
    }
}

#[test]
fn a_plan_is_asked_for_with_what_can_be_planned() {
    let plan = |more: &[&'static str]| [&["plan", "--error", "0.01"], more].concat();
    assert!(parse(&plan(&["--duration", "1000"]), &[]).is_ok());
    assert!(parse(&plan(&["--duration=servo", "--setpoint", "-1,2"]), &[]).is_ok());
    for free in [
        &["--setpoint", "1,2"][..],
        &["--setpoint=1,2", "--duration=2"],
    ] {
        let refused = refusal(&plan(free), &[]);
        let expected = "--setpoint must be left out without --duration servo, got \"1,2\"";
        assert!(refused.starts_with(expected), "{refused}");
    }
    assert_eq!(
        refusal(&plan(&["--duration", "-1"]), &[]),
        "--duration must be a number greater than 0, got \"-1\""
    );
    assert_eq!(
        refusal(&plan(&["--duration", "5000"]), &[]),
        "--duration must be at most 1000 s, got \"5000\""
    );
}

#[test]
fn an_option_without_its_value_or_given_twice_is_refused_by_name() {
    assert_eq!(refusal(&["--links"], &[]), "--links <N> needs a value");
    assert_eq!(
        refusal(&["--bind", "--links", "2"], &[]),
        "--bind <ADDRESS> needs a value"
    );
    assert_eq!(
        refusal(&["--links="], &[]),
        "--links must be 2 or 3, got \"\""
    );
    let twice = ["--links", "2", "--links", "2"];
    assert_eq!(refusal(&twice, &[]), "--links <N> is given more than once");
    assert_eq!(
        refusal(&["--help=3"], &[]),
        "--help takes no value, got \"3\""
    );
}

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

#[test]
fn a_token_is_printable_and_never_shown() {
    let options = options(&[], &[("ARM_SIM_TOKEN", "a-Secret_that_is_long")]);
    assert!(!format!("{options:?}").contains("Secret"));
    assert!(options.token.unwrap().matches("a-Secret_that_is_long"));
    let long = "s".repeat(257);
    for (value, why) in [
        ("my secret", "must be printable ASCII without spaces"),
        ("schlüssel", "must be printable ASCII without spaces"),
        ("15-bytes-are-it", "must be at least 16 bytes long, got 15"),
        (&long, "must be at most 256 bytes long, got 257"),
    ] {
        let refused = refusal(&[], &[("ARM_SIM_TOKEN", value)]);
        assert_eq!(refused, format!("ARM_SIM_TOKEN {why}"));
    }
    assert_eq!(
        refusal(&["--token="], &[]),
        "--token must be at least 16 bytes long, got 0"
    );
}

#[cfg(feature = "web")]
#[test]
fn hosts_and_origins_are_lists_and_the_switch_needs_no_value() {
    let given = options(
        &[
            "--allow-host=Arm.Example, other:80",
            "--allow-origin",
            "https://Example.org,null,file://",
            "--strict-origin",
            "--report=somewhere",
        ],
        &[],
    );
    let hosts: Vec<String> = given.web.hosts.iter().map(ToString::to_string).collect();
    assert_eq!(hosts, ["arm.example", "other:80"]);
    let origins: Vec<&str> = given.web.origins.iter().map(|one| &**one).collect();
    assert_eq!(origins, ["https://example.org", "null", "file://"]);
    assert!(given.web.strict_origin);
    assert_eq!(given.web.report.to_str(), Some("somewhere"));
    for (value, on) in [("true", true), ("1", true), ("false", false), ("0", false)] {
        let options = options(&[], &[("ARM_SIM_STRICT_ORIGIN", value)]);
        assert_eq!(options.web.strict_origin, on);
    }
    assert!(!options(&["--strict-origin=false"], &[]).web.strict_origin);
}

#[cfg(feature = "web")]
#[test]
fn what_is_no_host_or_origin_or_switch_is_refused_by_name_and_value() {
    for value in ["a b", "http://a", "a,,b", "a:99999"] {
        let refused = refusal(&["--allow-host", value], &[]);
        let expected = "--allow-host must be hosts, with or without a port, separated by commas";
        assert_eq!(refused, format!("{expected}, got {value:?}"));
    }
    for value in ["example.org", "http://a/", "://a", "a,b", "*"] {
        let refused = refusal(&[], &[("ARM_SIM_ALLOW_ORIGIN", value)]);
        assert!(
            refused.starts_with("ARM_SIM_ALLOW_ORIGIN must be origins as browsers write them")
                && refused.ends_with(&format!("got {value:?}")),
            "{refused}"
        );
    }
    assert_eq!(
        refusal(&["--strict-origin=maybe"], &[]),
        "--strict-origin must be true or false, got \"maybe\""
    );
}

#[cfg(unix)]
#[test]
fn bytes_that_are_no_text_are_refused_like_any_other_value() {
    use std::os::unix::ffi::OsStringExt;
    let bytes = || OsString::from_vec(vec![b'2', 0xff]);
    let variable = Options::parse(["pendularm"], |_| Some(bytes())).unwrap_err();
    assert!(matches!(variable, UsageError::Token { .. }), "{variable}");
    let option = Options::parse(["pendularm".into(), "--links".into(), bytes()], |_| None);
    assert!(
        matches!(option, Err(UsageError::Links { .. })),
        "{option:?}"
    );
    let argument = Options::parse(["pendularm".into(), bytes()], |_| None);
    assert!(
        matches!(argument, Err(UsageError::UnknownArgument { .. })),
        "{argument:?}"
    );
}

proptest! {
    /// Any arguments give an answer, and a refusal is one line without control characters.
    #[test]
    fn no_arguments_and_no_variables_break_the_reader(
        arguments in prop::collection::vec(
            prop_oneof![
                ".{0,12}",
                "--(links|bind|seed|log|token|allow-host|allow-origin|strict-origin|report|help|version|)(=.{0,6})?",
                Just("2".to_owned()),
                Just("--".to_owned()),
            ],
            0..5,
        ),
        variable in ".{0,12}",
    ) {
        let arguments = std::iter::once("pendularm".to_owned()).chain(arguments);
        if let Err(error) = Options::parse(arguments, |_| Some(OsString::from(&variable))) {
            let line = error.to_string();
            prop_assert!(!line.is_empty() && !line.contains(char::is_control), "{line:?}");
        }
    }
}

#[cfg(feature = "record")]
#[test]
fn a_run_is_recorded_into_a_file_and_replayed_from_one() {
    let given = options(
        &["--record", "a/run.mcap"],
        &[("ARM_SIM_RECORD_DIR", "runs")],
    );
    assert_eq!(given.record.file.unwrap().to_str(), Some("a/run.mcap"));
    assert_eq!(given.record.folder.unwrap().to_str(), Some("runs"));
    match parse(&["replay", "run.mcap"], &[("ARM_SIM_RECORD", "other")]) {
        Ok(Parsed::Replay(replay)) => assert_eq!(replay.file.to_str(), Some("run.mcap")),
        other => panic!("not to be replayed: {other:?}"),
    }
    assert!(refusal(&["replay"], &[]).contains("--help"));
    let stray = refusal(&["--links=2", "replay", "run.mcap"], &[]);
    assert!(stray.contains("--links"), "{stray}");
    assert_eq!(given.record.replay, None);
}

#[cfg(feature = "record")]
#[test]
fn a_record_is_served_with_the_options_of_serving_that_fit_it() {
    let given = options(
        &["replay", "run.mcap", "--serve", "--bind", "127.0.0.1:0"],
        &[
            ("ARM_SIM_LOG", "off"),
            ("ARM_SIM_LINKS", "many"),
            ("ARM_SIM_RECORD", "other"),
        ],
    );
    assert_eq!(given.record.replay.unwrap().to_str(), Some("run.mcap"));
    assert_eq!(given.record.file, None);
    assert_eq!((given.bind.port(), given.log), (0, LevelFilter::OFF));
    let other = refusal(&["replay", "run.mcap", "--serve", "--links=2"], &[]);
    assert!(other.contains("--links"), "{other}");
    let alone = refusal(&["replay", "run.mcap", "--bind", "127.0.0.1:0"], &[]);
    assert!(alone.contains("--bind without --serve"), "{alone}");
    let open = refusal(
        &["replay", "run.mcap", "--serve", "--bind", "0.0.0.0:1"],
        &[],
    );
    assert!(open.contains("loopback"), "{open}");
}

/// The program itself with these arguments.
fn program(arguments: &[&str]) -> Command {
    let mut command = common::program();
    command.args(arguments).stdin(Stdio::null());
    command
}

#[track_caller]
fn is_bad_usage(output: &Output, names: &str) {
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(
        said.starts_with("pendularm: ") && said.contains(names),
        "{said}"
    );
    assert!(output.stdout.is_empty());
}

#[test]
fn bad_usage_ends_the_program_with_one_line_and_status_2() {
    is_bad_usage(
        &program(&["--links", "4"]).output().unwrap(),
        "--links must be 2 or 3, got \"4\"",
    );
    is_bad_usage(&program(&["fly"]).output().unwrap(), "\"fly\"");
    for variable in [
        "ARM_SIM_LINKS",
        "ARM_SIM_BIND",
        "ARM_SIM_SEED",
        "ARM_SIM_LOG",
    ] {
        is_bad_usage(
            &program(&[]).env(variable, "nonsense").output().unwrap(),
            variable,
        );
    }
    is_bad_usage(
        &program(&["--bind", "0.0.0.0:0"]).output().unwrap(),
        "loopback",
    );
}

/// The address is taken: by a listener of this test's own.
#[test]
fn as_json_the_reason_for_not_starting_is_an_object_too() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let output = program(&["--bind", &address, "--log-format", "json"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    let log = String::from_utf8(output.stderr).unwrap();
    let last: serde_json::Value = serde_json::from_str(log.lines().last().unwrap()).unwrap();
    assert_eq!(last["level"], "ERROR");
    assert!(
        last["message"].as_str().unwrap().contains(&address),
        "{log}"
    );
    let output = program(&["--bind", &address]).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(
        said.lines().last().unwrap().starts_with("pendularm: "),
        "{said}"
    );
}

/// Every write to `/dev/full` fails.
#[cfg(target_os = "linux")]
fn full() -> Stdio {
    let full = std::fs::File::options().write(true).open("/dev/full");
    Stdio::from(full.unwrap())
}

#[cfg(target_os = "linux")]
#[test]
fn output_that_is_lost_is_a_failure() {
    for arguments in [
        &["--help"][..],
        &["--version"],
        &["plan", "--error", "0.1", "--duration", "0.1"],
        #[cfg(feature = "cli")]
        &["completions", "bash"],
    ] {
        let output = program(arguments).stdout(full()).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {said}");
        assert!(said.starts_with("pendularm: standard output: "), "{said}");
        assert_eq!(said.lines().count(), 1, "{said}");
    }
}

#[test]
fn a_reader_that_is_gone_is_no_failure() {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let output = program(&["--help"]).stdout(writer).output().unwrap();
    assert_eq!((output.status.code(), output.stderr), (Some(0), vec![]));
}

#[cfg(target_os = "linux")]
#[test]
fn a_complaint_that_nobody_takes_changes_no_exit_status() {
    let status = |arguments: &[&str]| {
        let mut program = program(arguments);
        program.stdout(full()).stderr(full());
        program.status().unwrap().code()
    };
    assert_eq!(status(&["--help"]), Some(1));
    assert_eq!(status(&["--links", "4"]), Some(2));
}
