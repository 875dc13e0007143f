//! The end of the commands without a server, without a reader, or with wrong input; their manual pages, and the other
//! files of a package.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use super::Going;
use crate::common::{self, Runtime, complaint};
use crate::folder::Folder;

/// Every command that needs a server, with its arguments.
const COMMANDS: [&str; 15] = [
    "topic list",
    "topic echo /clock",
    "topic hz /clock",
    "topic pub /chatter {}",
    "topic info /clock",
    "service list",
    "service call /arm_sim/reset",
    "action list",
    "action send_goal /ik_action {}",
    "node list",
    "node info /arm_sim",
    "param list",
    "param get /arm_sim gravity",
    "param set /arm_sim gravity 1",
    "diagnostics",
];

/// A command without its arguments.
fn verb(command: &str) -> String {
    let words: Vec<&str> = command.split(' ').take(2).collect();
    words.join(" ")
}

fn output(line: &str) -> Output {
    common::run(&line.split(' ').collect::<Vec<_>>())
}

#[test]
fn without_a_runtime_the_status_is_3() {
    // No server listens there. A port that was free before may now belong to another test.
    let address = "127.0.0.1:1";
    for command in COMMANDS {
        let said = complaint(&output(&format!("{command} --connect {address}")), 3);
        assert!(
            said.contains(&format!("cannot connect to {address}: ")),
            "{said}"
        );
    }
}

#[test]
fn a_token_is_shown_from_the_option_or_the_variable() {
    let token = "open-sesame-once-more";
    let runtime = Runtime::with(&["--token", token]);
    let list = format!("topic list --connect {}", runtime.address);
    let said = complaint(&output(&list), 1);
    assert!(said.contains("token"), "{said}");
    complaint(&output(&format!("{list} --token open-sesame-once-less")), 1);
    let right = output(&format!("{list} --token {token}"));
    assert_eq!(right.status.code(), Some(0));
    let mut command = common::program();
    command.args(list.split(' '));
    command.env("ARM_SIM_TOKEN", token);
    assert_eq!(command.output().unwrap().status.code(), Some(0));
    command.env("ARM_SIM_TOKEN", "short");
    let said = complaint(&command.output().unwrap(), 2);
    assert!(said.starts_with("ARM_SIM_TOKEN must have 16"), "{said}");
}

/// As in `pendularm topic echo /clock | head -n 1`.
#[test]
fn a_closed_pipe_ends_a_command_without_an_error() {
    let runtime = Runtime::start();
    for command in [COMMANDS[1], COMMANDS[2], "topic pub /chatter {} -r 100"] {
        let mut child = Going::start(&runtime, command);
        assert!(!child.line().is_empty());
        let Going(child, pipe) = child;
        drop(pipe);
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{command:?}");
        assert!(
            output.stderr.is_empty(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
}

#[test]
fn the_pages_of_help_have_examples_and_the_exit_statuses() {
    for command in COMMANDS {
        let verb = verb(command);
        let output = output(&format!("{verb} --help"));
        let page = String::from_utf8(output.stdout).unwrap();
        assert_eq!(output.status.code(), Some(0));
        let name = format!("pendularm {verb}");
        assert!(page.contains(&format!("Usage: {name}")), "{page}");
        let is_plain = verb.ends_with("list") || verb.ends_with("info");
        assert!(
            is_plain || page.contains(&format!("\n  {name}")),
            "no example:\n{page}"
        );
        assert!(page.contains("--connect <ADDRESS>"));
        if let Some((subject, _)) = verb.split_once(' ') {
            let page = self::output(&format!("{subject} --help")).stdout;
            let page = String::from_utf8(page).unwrap();
            assert!(page.contains("Exit status: 0 for"), "{page}");
        }
        let widest = page.lines().map(|line| line.chars().count()).max();
        assert!(widest <= Some(125), "{page}");
    }
}

#[test]
fn completions_know_every_command_and_a_shell_can_read_them() {
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = output(&format!("completions {shell}"));
        assert_eq!(script.status.code(), Some(0));
        let script = String::from_utf8(script.stdout).unwrap();
        for word in ["send_goal", "diagnostics", "log-format", "connect"] {
            assert!(script.contains(word), "{shell}: no {word}");
        }
        if shell == "bash" {
            let mut bash = Command::new("bash")
                .args(["-n"])
                .stdin(Stdio::piped())
                .spawn()
                .unwrap();
            bash.stdin
                .take()
                .unwrap()
                .write_all(script.as_bytes())
                .unwrap();
            assert!(bash.wait().unwrap().success());
        }
    }
}

/// Like the package builds and the Python wheel.
#[test]
fn an_installation_has_program_and_completions() {
    let prefix = Folder::new("install");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/install.sh");
    let program = Path::new(env!("CARGO_BIN_EXE_pendularm"));
    let arguments = [script.as_path(), program, &*prefix];
    let install = || Command::new("bash").args(arguments).status();
    assert!(install().unwrap().success());
    // It replaces a program that runs.
    let installed = common::without_variables(Command::new(prefix.join("bin/pendularm")));
    let _running = Runtime::spawn(installed, "127.0.0.1:0", &[]);
    assert!(install().unwrap().success());
    for file in [
        "bin/pendularm",
        "share/bash-completion/completions/pendularm",
        "share/fish/vendor_completions.d/pendularm.fish",
        "share/zsh/site-functions/_pendularm",
    ] {
        let length = fs::metadata(prefix.join(file)).unwrap().len();
        assert!(length > 100, "{file}");
    }
}

/// The table of docs/command-line.md has all commands.
#[test]
fn the_paper_lists_every_command() {
    let paper = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/command-line.md");
    let paper = fs::read_to_string(paper).unwrap();
    for command in COMMANDS {
        let verb = verb(command);
        assert!(paper.contains(&format!("| `pendularm {verb}")), "{verb}");
    }
}
