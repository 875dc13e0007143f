//! Arguments that do not exist, lack their value or come twice, those that are no text, and any at all.

#[cfg(unix)]
use std::ffi::OsString;

use super::refusal;
use pendularm::options::Options;
use proptest::prelude::*;

#[test]
fn arguments_that_do_not_exist_are_refused_by_name() {
    for argument in ["--speed", "-x", "--link"] {
        let expected = format!(
            "unexpected argument '{argument}' found; --help lists all commands and options"
        );
        assert_eq!(refusal(&[argument]), expected);
    }
    assert!(refusal(&["fly"]).starts_with("unrecognized subcommand 'fly'"));
    assert!(refusal(&["plan", "help"]).starts_with("unexpected argument 'help' found"));
    assert!(refusal(&["--speed=3"]).starts_with("unexpected argument '--speed' found"));
    assert!(refusal(&["--links", "2", "3"]).contains("'3' cannot be used with '--links"));
}

#[test]
fn an_option_without_its_value_or_given_twice_is_refused_by_name() {
    for (arguments, expected) in [
        (
            &["--links"][..],
            "a value is required for '--links <N>' but none was supplied",
        ),
        (
            &["--bind", "--links", "2"],
            "a value is required for '--bind <ADDRESS>' but none was supplied",
        ),
        (&["--links="], "--links must be 2 or 3, got \"\""),
        (
            &["--links", "2", "--links", "2"],
            "the argument '--links <N>' cannot be used multiple times",
        ),
        (&["--help=3"], "unexpected value '3' for '--help' found"),
    ] {
        let refused = refusal(arguments);
        assert!(refused.starts_with(expected), "{refused}");
    }
}

#[cfg(unix)]
#[test]
fn bytes_that_are_no_text_are_refused_like_any_other_value() {
    use std::os::unix::ffi::OsStringExt;
    let bytes = || OsString::from_vec(vec![b'2', 0xff]);
    let option = Options::parse(["pendularm".into(), "--links".into(), bytes()]).unwrap_err();
    assert_eq!(
        option.to_string(),
        "--links must be 2 or 3, got \"2\u{fffd}\""
    );
    let argument = Options::parse(["pendularm".into(), bytes()]).unwrap_err();
    assert!(
        argument.to_string().starts_with("unrecognized subcommand"),
        "{argument}"
    );
}

proptest! {
    /// Any arguments give an answer, and a refusal is one line without control characters.
    #[test]
    fn no_arguments_break_the_reader(
        arguments in prop::collection::vec(
            prop_oneof![
                ".{0,12}",
                "--(links|bind|seed|log|token|allow-host|allow-origin|strict-origin|report|help|version|)(=.{0,6})?",
                Just("2".to_owned()),
                Just("--".to_owned()),
            ],
            0..5,
        ),
    ) {
        let arguments = std::iter::once("pendularm".to_owned()).chain(arguments);
        if let Err(error) = Options::parse(arguments) {
            let line = error.to_string();
            prop_assert!(!line.is_empty() && !line.contains(char::is_control), "{line:?}");
        }
    }
}
