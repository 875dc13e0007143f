//! Arguments that are not text, and random arguments. `tests/wire/command/rows.txt` has refusals that name the argument.

#[cfg(unix)]
use std::ffi::OsString;

use pendularm::options::Options;
use proptest::prelude::*;

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
    /// Random arguments give a result, and a refusal is one line without control characters.
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
            let line = pendularm::output::line(&error);
            prop_assert!(!line.is_empty() && !line.contains(char::is_control), "{line:?}");
        }
    }
}
