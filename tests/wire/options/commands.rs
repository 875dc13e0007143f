//! `--help`, records, and the command `report`. `tests/wire/command/rows.txt` has what commands refuse, and
//! `tests/house/readme/mod.rs` the options of `--help`, their variables and defaults.

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

#[cfg(feature = "record")]
#[test]
fn a_run_is_recorded_into_a_file_and_replayed_from_one() {
    use super::{options, refusal};

    let given = options(&["--record", "a/run.mcap", "--record-dir=runs"]);
    assert_eq!(given.record.unwrap().to_str(), Some("a/run.mcap"));
    assert_eq!(given.record_dir.unwrap().to_str(), Some("runs"));
    match parse(&["replay", "run.mcap"]) {
        Ok(Parsed::Replay { file }) => assert_eq!(file.to_str(), Some("run.mcap")),
        other => panic!("not to be replayed: {other:?}"),
    }
    assert!(refusal(&["replay"]).contains("<FILE>"));
    let stray = refusal(&["--links=2", "replay", "run.mcap"]);
    assert!(stray.contains("--links"), "{stray}");
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
    assert_eq!((all.out.to_str(), all.quick), (Some("here"), true));
    assert_eq!(all.only, ["error", "budget"]);
}
