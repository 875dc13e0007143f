//! The kept report, and the documents that repeat its numbers.

use std::path::Path;
use std::process::Command;

#[test]
fn the_papers_agree_with_the_kept_report() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let check = Command::new("python3")
        .arg(root.join("scripts/keep-report.py"))
        .arg("--check")
        .output();
    let Ok(check) = check else {
        assert!(std::env::var_os("CI").is_none(), "python3 is missing");
        return;
    };
    let said = String::from_utf8_lossy(&check.stderr);
    assert!(check.status.success(), "{said}");
}
