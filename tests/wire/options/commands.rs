//! The commands `report` and `plan`, with their own options.

use super::{parse, refusal};
use pendularm::options::{Options, Parsed};

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
