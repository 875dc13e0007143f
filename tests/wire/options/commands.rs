//! The command `report`, with its own options. `tests/wire/command/rows.txt` has what it and `plan` refuse.

use pendularm::options::{Options, Parsed};

#[test]
fn a_report_is_asked_for_with_its_directory_its_sections_and_its_haste() {
    let report = |arguments: &[&str]| {
        let all = ["pendularm", "report"].iter().chain(arguments);
        match Options::parse(all) {
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
}
