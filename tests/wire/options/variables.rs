//! The variables of the environment, tried with the program itself.

use std::process::Output;

use crate::common::{self, VARIABLES};

/// An address of documentation (RFC 5737) is no machine's: every option is taken, and then nothing is served.
const TAKEN: [&str; 4] = [
    "--bind",
    "192.0.2.1:0",
    "--token",
    "long-enough-for-a-token",
];

fn output(arguments: &[&str], variables: &[(&str, &str)]) -> Output {
    let mut program = common::program();
    program.args(arguments).envs(variables.iter().copied());
    program.output().unwrap()
}

#[track_caller]
fn assert_taken(arguments: &[&str], variables: &[(&str, &str)]) {
    let output = output(arguments, variables);
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{variables:?}: {said}");
    assert!(
        said.contains("cannot listen on 192.0.2.1:0"),
        "{variables:?}: {said}"
    );
}

#[track_caller]
fn refusal(arguments: &[&str], variables: &[(&str, &str)]) -> String {
    common::complaint(&output(arguments, variables), 2)
}

#[test]
fn an_empty_variable_counts_as_unset() {
    assert_taken(&TAKEN, &VARIABLES.map(|variable| (variable, "")));
    let later = [("ARM_SIM_BIND", ""), ("ARM_SIM_SEED", "x")];
    assert!(refusal(&[], &later).starts_with("ARM_SIM_SEED"));
}

#[test]
fn every_variable_is_taken_and_a_wrong_one_is_refused_by_name_and_value() {
    let token = ("ARM_SIM_TOKEN", "long-enough-for-a-token");
    assert_taken(&[], &[("ARM_SIM_BIND", "192.0.2.1:0"), token]);
    for (variable, value, wrong) in [
        ("ARM_SIM_LINKS", "3", "-2"),
        ("ARM_SIM_BIND", "localhost", "arm.example:9095"),
        ("ARM_SIM_CLIENTS", "4096", "4097"),
        ("ARM_SIM_SEED", "18446744073709551615", "1.5"),
        ("ARM_SIM_LOG", "trace", "loud"),
        ("ARM_SIM_LOG_FORMAT", "text", "xml"),
        #[cfg(feature = "web")]
        ("ARM_SIM_ALLOW_HOST", "Arm.Example, other:80", "a b"),
        #[cfg(feature = "web")]
        ("ARM_SIM_ALLOW_ORIGIN", "null,https://example.org", "*"),
        #[cfg(feature = "web")]
        ("ARM_SIM_STRICT_ORIGIN", "true", "1"),
    ] {
        assert_taken(&TAKEN, &[(variable, value)]);
        let refused = refusal(&[], &[(variable, wrong)]);
        assert!(
            refused.starts_with(&format!("{variable} must be")),
            "{refused}"
        );
        assert!(refused.ends_with(&format!("got {wrong:?}")), "{refused}");
    }
    let short = refusal(&[], &[("ARM_SIM_TOKEN", "a-Secret")]);
    assert_eq!(short, "ARM_SIM_TOKEN must have 16 to 256 characters, got 8");
    let reachable = refusal(&[], &[("ARM_SIM_BIND", "0.0.0.0:0")]);
    assert!(
        reachable.starts_with("--bind (ARM_SIM_BIND) must be a loopback address"),
        "{reachable}"
    );
}

#[test]
fn a_variable_without_effect_is_named_in_a_warning() {
    let said = output(&TAKEN, &[("ARM_SIM_LINK", "3"), ("ARM_SIM_LINKS", "3")]).stderr;
    assert!(String::from_utf8_lossy(&said).contains(r#"["ARM_SIM_LINK"]"#));
}

#[test]
fn an_option_overrides_its_variable_and_a_command_ignores_the_servers_variables() {
    let wrong = [("ARM_SIM_BIND", "nowhere"), ("ARM_SIM_TOKEN", "short")];
    assert_taken(&TAKEN, &wrong);
    let plan = output(&["plan", "--error", "0.1", "--duration", "0.1"], &wrong);
    assert_eq!(plan.status.code(), Some(0), "{plan:?}");
}
