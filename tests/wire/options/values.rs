//! The options of serving and their variables: values that are taken, and those that are refused by name and value.

use super::{options, refusal};
use pendularm::logging::LogFormat;
use pendularm::options::{DEFAULT_BIND, Links, Options};
use tracing::level_filters::LevelFilter;

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
