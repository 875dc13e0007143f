//! Arguments that do not exist, lack their value or come twice, those that are no text, and any at all.

use std::ffi::OsString;

use super::refusal;
use pendularm::options::Options;
#[cfg(unix)]
use pendularm::options::UsageError;
use proptest::prelude::*;

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
