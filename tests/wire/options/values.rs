//! The options of serving: values that are taken, and those that are refused by name and value.

use super::{options, refusal};
use pendularm::logging::LogFormat;
use pendularm::options::{DEFAULT_BIND, Links};
use tracing::level_filters::LevelFilter;

#[test]
fn without_arguments_the_defaults_hold() {
    let given = options(&[]);
    assert_eq!((given.links, given.bind), (Links::Two, DEFAULT_BIND));
    assert_eq!(
        (given.seed, given.log, given.token),
        (None, LevelFilter::INFO, None)
    );
}

#[test]
fn two_and_three_links_are_taken() {
    for (value, links, count) in [("2", Links::Two, 2), ("3", Links::Three, 3)] {
        assert_eq!(options(&["--links", value]).links, links);
        assert_eq!(options(&[&format!("--links={value}")]).links, links);
        assert_eq!(links.count(), count);
    }
}

#[test]
fn any_other_number_of_links_is_refused_by_name_and_value() {
    for value in ["1", "4", "02", " 2", "2.0", "two", "-2"] {
        let expected = format!("must be 2 or 3, got {value:?}");
        let option = refusal(&[&format!("--links={value}")]);
        assert_eq!(option, format!("--links {expected}"));
    }
}

#[test]
fn loopback_addresses_are_taken() {
    for address in [
        "127.0.0.1:0",
        "127.0.0.2:9095",
        "[::1]:9095",
        "127.0.0.1:9096",
    ] {
        let options = options(&["--bind", address]);
        assert_eq!(options.bind.to_string(), address);
    }
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
            refusal(&["--bind", address]),
            format!("--bind (ARM_SIM_BIND) {expected}")
        );
        let arguments = ["--bind", address, "--token", "open-sesame-once-more"];
        let options = options(&arguments);
        assert_eq!(options.bind.to_string(), address);
        assert!(options.token.unwrap().matches("open-sesame-once-more"));
    }
}

#[test]
fn an_address_may_be_localhost_or_a_port_alone() {
    for (text, address) in [
        ("localhost:9096", "127.0.0.1:9096"),
        ("LOCALHOST", "127.0.0.1:9095"),
        ("9096", "127.0.0.1:9096"),
        (":0", "127.0.0.1:0"),
        ("127.0.0.2", "127.0.0.2:9095"),
        ("[::1]", "[::1]:9095"),
    ] {
        assert_eq!(options(&["--bind", text]).bind.to_string(), address);
    }
}

#[test]
fn what_is_no_address_with_a_port_is_refused() {
    for text in [
        "127.0.0.1:65536",
        "::1:9095",
        "127.0.0.1:",
        "arm.example:9095",
        "localhost:x",
        "256.0.0.1:80",
    ] {
        let refused = refusal(&[&format!("--bind={text}")]);
        assert!(
            refused.starts_with("--bind must be localhost or an IP address, a port, or both"),
            "{refused}"
        );
        assert!(refused.ends_with(&format!("got {text:?}")), "{refused}");
    }
}

#[test]
fn the_number_of_clients_has_bounds_and_is_refused_by_name_and_value() {
    assert_eq!(options(&[]).clients, 256);
    for clients in [1, 2, 256, 4096] {
        let text = clients.to_string();
        assert_eq!(options(&["--clients", &text]).clients, clients);
    }
    for value in ["0", "4097", "-1", "1.5", "many", "18446744073709551616"] {
        let expected = format!("--clients must be a whole number from 1 to 4096, got {value:?}");
        assert_eq!(refusal(&[&format!("--clients={value}")]), expected);
    }
}

#[test]
fn a_seed_is_any_number_of_64_bits() {
    assert_eq!(options(&["--seed", "0"]).seed, Some(0));
    let largest = u64::MAX.to_string();
    assert_eq!(
        options(&[&format!("--seed={largest}")]).seed,
        Some(u64::MAX)
    );
    for value in ["18446744073709551616", "1.5", "x"] {
        let expected =
            format!("--seed must be a whole number from 0 to 18446744073709551615, got {value:?}");
        assert_eq!(refusal(&[&format!("--seed={value}")]), expected);
    }
    for negative in [&["--seed=-1"][..], &["--seed", "-1"]] {
        let refused = refusal(negative);
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
        assert_eq!(options(&[&format!("--log={name}")]).log, level);
        assert_eq!(options(&["--log", name]).log, level);
    }
    assert_eq!(
        refusal(&["--log=loud"]),
        "--log must be off, error, warn, info, debug or trace, got \"loud\""
    );
}

#[test]
fn the_log_is_text_or_json() {
    assert_eq!(options(&[]).log_format, LogFormat::Text);
    assert_eq!(options(&["--log-format=json"]).log_format, LogFormat::Json);
    assert_eq!(
        refusal(&["--log-format", "xml"]),
        "--log-format must be text or json, got \"xml\""
    );
}

#[test]
fn a_token_is_printable_and_never_shown() {
    let options = options(&["--token=a-Secret_that_is_long"]);
    assert!(!format!("{options:?}").contains("Secret"));
    assert!(options.token.unwrap().matches("a-Secret_that_is_long"));
    let long = "s".repeat(257);
    for (value, why) in [
        ("my secret", "must be printable ASCII without spaces"),
        ("schlüssel", "must be printable ASCII without spaces"),
        ("15-bytes-are-it", "must be at least 16 bytes long, got 15"),
        (&long, "must be at most 256 bytes long, got 257"),
    ] {
        let refused = refusal(&[&format!("--token={value}")]);
        assert_eq!(refused, format!("--token {why}"));
    }
    assert_eq!(
        refusal(&["--token="]),
        "--token must be at least 16 bytes long, got 0"
    );
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
    let hosts: Vec<String> = given.web.hosts.iter().map(ToString::to_string).collect();
    assert_eq!(hosts, ["arm.example", "other:80"]);
    let origins: Vec<&str> = given.web.origins.iter().map(|one| &**one).collect();
    assert_eq!(origins, ["https://example.org", "null", "file://"]);
    assert!(given.web.strict_origin);
    assert_eq!(given.web.report.to_str(), Some("somewhere"));
    for (value, on) in [("true", true), ("1", true), ("false", false), ("0", false)] {
        let options = options(&[&format!("--strict-origin={value}")]);
        assert_eq!(options.web.strict_origin, on);
    }
    assert!(!options(&["--strict-origin=false"]).web.strict_origin);
}

#[cfg(feature = "web")]
#[test]
fn what_is_no_host_or_origin_or_switch_is_refused_by_name_and_value() {
    for (value, wrong) in [
        ("a b", "a b"),
        ("http://a", "http://a"),
        ("a,,b", ""),
        ("a:99999", "a:99999"),
    ] {
        let refused = refusal(&["--allow-host", value]);
        let expected = "--allow-host must be hosts, with or without a port, separated by commas";
        assert_eq!(refused, format!("{expected}, got {wrong:?}"));
    }
    for value in ["example.org", "http://a/", "://a", "a", "*"] {
        let refused = refusal(&[&format!("--allow-origin={value}")]);
        assert!(
            refused.starts_with("--allow-origin must be origins as browsers write them")
                && refused.ends_with(&format!("got {value:?}")),
            "{refused}"
        );
    }
    for value in [
        "example.org",
        "file://",
        "null",
        "https://a/b",
        "https://a; script-src *",
        "*",
    ] {
        let refused = refusal(&[&format!("--allow-frame={value}")]);
        assert!(
            refused.starts_with("--allow-frame must be origins of web pages")
                && refused.ends_with(&format!("got {value:?}")),
            "{refused}"
        );
    }
    assert_eq!(
        refusal(&["--strict-origin=maybe"]),
        "--strict-origin must be true or false, got \"maybe\""
    );
}
