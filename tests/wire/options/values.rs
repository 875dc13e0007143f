//! Options: values that are accepted, and values that are refused by name and value.
//! `tests/house/readme/mod.rs` has the options of `--help`, their variables and defaults.

use std::path::Path;

use super::{options, parse, refusal};
use pendularm::logging::LogFormat;
use pendularm::options::{DEFAULT_BIND, Links, Parsed};
use tracing::level_filters::LevelFilter;

#[test]
fn without_arguments_the_defaults_hold() {
    let given = options(&[]);
    assert_eq!((given.links, given.bind), (Links::Two, DEFAULT_BIND));
    assert_eq!((given.seed, given.clients, given.token), (None, 256, None));
    let log = (given.log, given.log_format);
    assert_eq!(log, (LevelFilter::INFO, LogFormat::Text));
}

#[test]
fn values_within_their_bounds_are_accepted() {
    for (value, links, count) in [("2", Links::Two, 2), ("3", Links::Three, 3)] {
        assert_eq!(options(&["--links", value]).links, links);
        assert_eq!(options(&[&format!("--links={value}")]).links, links);
        assert_eq!(links.count(), count);
    }
    for (text, address) in [
        ("127.0.0.1:0", "127.0.0.1:0"),
        ("[::1]:9095", "[::1]:9095"),
        ("localhost:9096", "127.0.0.1:9096"),
        ("LOCALHOST", "127.0.0.1:9095"),
        ("9096", "127.0.0.1:9096"),
        (":0", "127.0.0.1:0"),
        ("127.0.0.2", "127.0.0.2:9095"),
        ("[::1]", "[::1]:9095"),
        ("::1", "[::1]:9095"),
    ] {
        assert_eq!(options(&["--bind", text]).bind.to_string(), address);
    }
    for clients in [1, 2, 256, 4096] {
        let text = clients.to_string();
        assert_eq!(options(&["--clients", &text]).clients, clients);
    }
    for seed in [0, u64::MAX] {
        assert_eq!(options(&[&format!("--seed={seed}")]).seed, Some(seed));
    }
    for level in ["off", "error", "warn", "info", "debug", "trace"] {
        let expected: LevelFilter = level.parse().unwrap();
        assert_eq!(options(&["--log", level]).log, expected);
    }
    for length in [16, 256] {
        let token = "x".repeat(length);
        let given = options(&["--token", &token]).token.unwrap();
        assert_eq!(given.reveal(), token);
    }
    let json = options(&["--log-format=json"]).log_format;
    assert_eq!(json, LogFormat::Json);
}

/// Arguments, and the whole refusal of each.
const REFUSED: &str = "\
--links=4 | --links must be 2 or 3, got \"4\"
--links=02 | --links must be 2 or 3, got \"02\"
--links= 2 | --links must be 2 or 3, got \" 2\"
--clients=0 | --clients must be a whole number from 1 to 4096, got \"0\"
--clients=4097 | --clients must be a whole number from 1 to 4096, got \"4097\"
--clients=-1 | --clients must be a whole number from 1 to 4096, got \"-1\"
--seed=18446744073709551616 | --seed must be a whole number from 0 to 18446744073709551615, got \"18446744073709551616\"
--seed=-1 | --seed must be a whole number from 0 to 18446744073709551615, got \"-1\"
--log=loud | --log must be off, error, warn, info, debug or trace, got \"loud\"
--log-format=xml | --log-format must be text or json, got \"xml\"
--token=my secret | --token must be printable ASCII without spaces
--token=schlüssel | --token must be printable ASCII without spaces
--token=15-bytes-are-it | --token must have 16 to 256 characters, got 15
--token= | --token must have 16 to 256 characters, got 0";

/// Options with lists or addresses: arguments, and the beginning of each refusal, which ends with the value.
const REFUSED_LISTS: &str = "\
--bind=127.0.0.1:65536 | --bind must be localhost or an IP address, a port, or both
--bind=::1:9095 | --bind must be localhost or an IP address, a port, or both
--bind=arm.example:9095 | --bind must be localhost or an IP address, a port, or both
--bind=localhost:x | --bind must be localhost or an IP address, a port, or both
--bind=http://127.0.0.1:9095 | --bind must be localhost or an IP address, a port, or both
--bind=0.0.0.0:9095 | --bind (ARM_SIM_BIND) must be a loopback address, such as 127.0.0.1:9095, unless --token is set
--bind=[::]:9095 | --bind (ARM_SIM_BIND) must be a loopback address
--bind=[::ffff:127.0.0.1]:9095 | --bind (ARM_SIM_BIND) must be a loopback address";

#[cfg(feature = "web")]
const REFUSED_WEB: &str = "\
--allow-host=a b | --allow-host must be host names, with or without a port, separated by commas
--allow-host=http://a | --allow-host must be host names, with or without a port, separated by commas
--allow-host=a:99999 | --allow-host must be host names, with or without a port, separated by commas
--allow-origin=example.org | --allow-origin must be origins, such as https://example.org, null or file://
--allow-origin=http://a/ | --allow-origin must be origins, such as https://example.org, null or file://
--allow-origin=://a | --allow-origin must be origins, such as https://example.org, null or file://
--allow-origin=* | --allow-origin must be origins, such as https://example.org, null or file://
--allow-frame=example.org | --allow-frame must be origins of web pages
--allow-frame=file:// | --allow-frame must be origins of web pages
--allow-frame=null | --allow-frame must be origins of web pages
--allow-frame=https://a/b | --allow-frame must be origins of web pages
--allow-frame=https://a; script-src * | --allow-frame must be origins of web pages
--allow-frame=* | --allow-frame must be origins of web pages
--strict-origin=maybe | --strict-origin must be true or false";

#[test]
fn other_values_are_refused_by_name_and_value() {
    for row in REFUSED.lines() {
        let (argument, expected) = row.split_once(" | ").unwrap();
        assert_eq!(refusal(&[argument]), expected);
    }
    let lists = REFUSED_LISTS.lines();
    #[cfg(feature = "web")]
    let lists = lists.chain(REFUSED_WEB.lines());
    for row in lists {
        let (argument, expected) = row.split_once(" | ").unwrap();
        let refused = refusal(&[argument]);
        assert!(refused.starts_with(expected), "{refused}");
        let value = argument.split_once('=').unwrap().1;
        assert!(refused.ends_with(&format!("got {value:?}")), "{refused}");
    }
    let long = refusal(&[&format!("--token={}", "s".repeat(257))]);
    assert_eq!(long, "--token must have 16 to 256 characters, got 257");
    #[cfg(feature = "web")]
    assert!(refusal(&["--token=0123456789abcdef", "--allow-frame=https://a"]).contains("--token"));
}

#[test]
fn with_a_token_any_address_is_accepted_and_the_token_is_never_shown() {
    for address in ["0.0.0.0:9095", "[::]:9095", "192.0.2.1:9095"] {
        let options = options(&["--bind", address, "--token", "a-Secret_that_is_long"]);
        assert_eq!(options.bind.to_string(), address);
        assert!(!format!("{options:?}").contains("Secret"));
        assert!(options.token.unwrap().matches("a-Secret_that_is_long"));
    }
}

#[cfg(feature = "web")]
#[test]
fn hosts_and_origins_are_lists_and_the_switch_needs_no_value() {
    let given = options(&[
        "--allow-host=Arm.Example, other:80",
        "--allow-origin",
        "https://Example.org,null,file://",
        "--strict-origin",
        "--report=somewhere",
    ]);
    let hosts: Vec<String> = given.access.hosts.iter().map(ToString::to_string).collect();
    assert_eq!(hosts, ["arm.example", "other:80"]);
    let origins: Vec<&str> = given.access.origins.iter().map(|one| &**one).collect();
    assert_eq!(origins, ["https://example.org", "null", "file://"]);
    assert!(given.access.strict_origin);
    assert_eq!(given.report.to_str(), Some("somewhere"));
    for (value, on) in [("true", true), ("false", false)] {
        let options = options(&[&format!("--strict-origin={value}")]);
        assert_eq!(options.access.strict_origin, on);
    }
}

#[test]
fn a_report_is_asked_for_with_its_directory_its_sections_and_its_haste() {
    let report = |arguments: &[&str]| match parse(&[&["report"], arguments].concat()) {
        Ok(Parsed::Report(report)) => report,
        other => panic!("no report: {other:?}"),
    };
    let plain = report(&[]);
    assert_eq!((plain.out.to_str(), plain.quick), (Some("report"), false));
    assert!(plain.only.is_empty());
    let all = report(&["--out", "here", "--only", "error,budget", "--quick"]);
    let own = report(&["--method", "heun.json"]).method;
    assert_eq!(own.as_deref().and_then(Path::to_str), Some("heun.json"));
    assert!(plain.method.is_none());
    assert_eq!((all.out.to_str(), all.quick), (Some("here"), true));
    assert_eq!(all.only, ["error", "budget"]);
}
