//! Crates that only the web server needs.

use std::process::Command;

/// The program without the feature `web` must not contain them.
#[test]
fn without_the_feature_no_crate_of_the_web_door_is_built_in() {
    let tree = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO"))
            .args("tree --locked --offline --edges normal --prefix none".split(' '))
            .args(arguments)
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .output()
            .unwrap();
        assert!(output.status.success());
        String::from_utf8(output.stdout).unwrap()
    };
    let (with, without) = (
        tree(&[]),
        tree(&["--no-default-features", "--features", "runtime"]),
    );
    for name in ["hyper", "tungstenite", "httparse", "sha1", "rand"] {
        let named = |tree: &str| {
            tree.lines()
                .any(|line| line.starts_with(&format!("{name} v")))
        };
        assert!(named(&with) && !named(&without), "{name}");
    }
}
