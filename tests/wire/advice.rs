//! `pendularm plan`, from outside.

use std::process::Command;

#[test]
fn the_command_plans_and_refuses_like_the_service() {
    let run = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_pendularm"))
            .arg("plan")
            .args(arguments)
            .output()
            .unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        (
            output.status.code(),
            text(output.stdout),
            text(output.stderr),
        )
    };
    let (status, out, _) = run(&["--error", "1e-4", "--duration", "2"]);
    assert_eq!(status, Some(0));
    assert!(out.contains("Plan: rk4"), "{out}");
    let (status, out, _) = run(&[
        "--error",
        "0.01",
        "--duration",
        "servo",
        "--setpoint=-0.4,0.6",
    ]);
    assert_eq!(status, Some(0));
    assert!(out.contains("control period"), "{out}");
    let (status, out, _) = run(&["--error", "1e300", "--duration", "0.1"]);
    assert_eq!(status, Some(0));
    assert!(
        out.contains("for 0.1 s, end effector within 1e300 m:"),
        "{out}"
    );
    let (status, _, complaint) = run(&["--error", "0"]);
    assert_eq!(status, Some(2));
    assert!(
        complaint.contains("--error must be a number greater than 0"),
        "{complaint}"
    );
    let (status, _, complaint) = run(&["--error", "1e-3", "--duration", "200"]);
    assert_eq!(status, Some(1));
    assert!(
        complaint.contains("error must be larger or duration shorter"),
        "{complaint}"
    );
}
