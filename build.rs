//! Sets the program's version: the package's version, and the commit of a release build.
//!
//! The commit comes from the file `COMMIT` of a packed archive, or else from git. If neither has it, it is omitted.
//! Development builds omit it too, because otherwise every commit would recompile everything.

use std::env;
use std::fs;
use std::path::Path;
use std::process::Command;

/// The file into which `scripts/package.sh` writes the commit.
const COMMIT: &str = "COMMIT";
/// The files on which the program depends.
const SOURCES: [&str; 5] = ["src", "page", "build.rs", "Cargo.toml", "Cargo.lock"];
/// Git's files that change with a commit or a checkout.
const HEADS: [&str; 3] = ["HEAD", "logs/HEAD", "packed-refs"];

fn main() {
    watch("build.rs");
    let version = env::var("CARGO_PKG_VERSION").unwrap_or_default();
    let is_release = env::var("PROFILE").is_ok_and(|profile| profile == "release");
    let commit = is_release.then(|| packed().or_else(of_git)).flatten();
    let commit = commit.map_or_else(String::new, |commit| format!("+{commit}"));
    println!("cargo:rustc-env=PENDULARM_VERSION={version}{commit}");
}

/// Runs this again when the file changes. A missing file would run it at every build, so it is not listed.
fn watch(path: &str) {
    if Path::new(path).exists() {
        println!("cargo:rerun-if-changed={path}");
    }
}

fn packed() -> Option<String> {
    watch(COMMIT);
    let commit = fs::read_to_string(COMMIT).ok()?;
    let commit = commit.trim();
    let is_plain = |one: char| one.is_ascii_alphanumeric() || one == '.';
    (!commit.is_empty() && commit.chars().all(is_plain)).then(|| commit.to_owned())
}

fn of_git() -> Option<String> {
    // An unpacked archive may be inside another repository.
    let top = fs::canonicalize(git(&["rev-parse", "--show-toplevel"])?).ok()?;
    if top != env::current_dir().ok()?.canonicalize().ok()? {
        return None;
    }
    let branch = git(&["rev-parse", "--symbolic-full-name", "HEAD"])?;
    for name in HEADS.into_iter().chain([branch.as_str()]) {
        watch(&git(&["rev-parse", "--git-path", name])?);
    }
    SOURCES.into_iter().for_each(watch);
    let commit = git(&["rev-parse", "--short=12", "HEAD"])?;
    let status = [
        &["status", "--porcelain", "--untracked-files=no", "--"],
        &SOURCES[..],
    ]
    .concat();
    let is_modified = git(&status).is_some_and(|changes| !changes.is_empty());
    Some(if is_modified {
        format!("{commit}.modified")
    } else {
        commit
    })
}

/// The output of a git command that succeeds.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}
