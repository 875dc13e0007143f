//! The commands `report` and `plan`, with their own options.

use super::{parse, refusal};
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
    assert!(refusal(&["--links", "2", "report"]).contains("--links"));
    assert!(refusal(&["report", "--speed"]).starts_with("unexpected argument '--speed'"));
    for (names, wrong) in [("error,colour", "colour"), ("", "")] {
        let refused = refusal(&["report", "--only", names]);
        let known: Vec<_> = pendularm::report::sections().collect();
        let known = known.join(", ");
        assert!(
            refused.contains("--only <NAMES>") && refused.contains(wrong),
            "{refused}"
        );
        assert!(
            refused.contains(&format!("[possible values: {known}]")),
            "{refused}"
        );
    }
    for unknown in [
        &["report", "--token", "a-token-for-nothing"][..],
        &["report", "--json"],
    ] {
        let refused = refusal(unknown);
        let expected = format!("unexpected argument '{}' found", unknown[1]);
        assert!(refused.starts_with(&expected), "{refused}");
    }
}

#[test]
fn a_plan_is_asked_for_with_what_can_be_planned() {
    let plan = |more: &[&'static str]| [&["plan", "--error", "0.01"], more].concat();
    assert!(parse(&plan(&["--duration", "1000"])).is_ok());
    assert!(parse(&plan(&["--duration=servo", "--setpoint", "-1,2"])).is_ok());
    for free in [
        &["--setpoint", "1,2"][..],
        &["--setpoint=1,2", "--duration=2"],
    ] {
        let refused = refusal(&plan(free));
        let expected = "--setpoint needs --duration servo";
        assert!(refused.starts_with(expected), "{refused}");
    }
    assert!(refusal(&["plan"]).contains("--error <METRES>"));
    let short = refusal(&plan(&["--duration=servo", "--setpoint", "1"]));
    assert_eq!(short, "--setpoint must be a number for each joint, got 1");
    assert_eq!(
        refusal(&plan(&["--duration", "-1"])),
        "--duration must be a number greater than 0, got \"-1\""
    );
    assert_eq!(
        refusal(&plan(&["--duration", "5000"])),
        "--duration must be at most 1000 s, got \"5000\""
    );
}
