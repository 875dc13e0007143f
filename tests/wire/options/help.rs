//! `--help`. `tests/house/readme/mod.rs` has its options, their variables and defaults.

use super::parse;
use pendularm::options::Parsed;

#[test]
fn help_is_a_command_too() {
    let Ok(Parsed::Show(help)) = parse(&["--help"]) else {
        panic!("--help is to be shown");
    };
    let usage = "\nUsage: pendularm [OPTIONS]\n       pendularm <COMMAND>\n";
    assert!(help.contains(usage), "{help}");
    assert_eq!(parse(&["help"]), Ok(Parsed::Show(help)));
    assert_eq!(parse(&["help", "plan"]), parse(&["plan", "--help"]));
}
