//! The commands that ask a running one: what each prints, in YAML and in JSON, and what it says where the runtime refuses.

use std::io::{BufRead, BufReader};
use std::process::{Child, Output, Stdio};

use serde_json::{Value, json};

use crate::common::{self, Client, Runtime};

/// A command with the address of a runtime, ready to be started.
fn command(runtime: &Runtime, arguments: &[&str]) -> std::process::Command {
    let mut command = common::program();
    // Behind `--` there are no options any more.
    let (verb, rest) = arguments.split_at(arguments.len().min(2));
    command
        .args(verb)
        .args(["--connect", &runtime.address.to_string()])
        .args(["--timeout", &common::PATIENCE.as_secs().to_string()])
        .args(rest)
        .stdin(Stdio::null());
    command
}

fn ask(runtime: &Runtime, arguments: &[&str]) -> Output {
    command(runtime, arguments).output().unwrap()
}

/// Standard output of a command that has to succeed.
#[track_caller]
fn said(runtime: &Runtime, arguments: &[&str]) -> String {
    let output = ask(runtime, arguments);
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {complaint}");
    assert_eq!(complaint, "", "{arguments:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// The same, in JSON.
#[track_caller]
fn json_of(runtime: &Runtime, arguments: &[&str]) -> Value {
    let text = said(runtime, &[arguments, &["--json"]].concat());
    assert_eq!(text.lines().count(), 1, "{text}");
    serde_json::from_str(&text).unwrap()
}

/// The one line of a command that has to be refused with this exit status.
#[track_caller]
fn refusal(runtime: &Runtime, arguments: &[&str], status: i32) -> String {
    let output = ask(runtime, arguments);
    let complaint = String::from_utf8(output.stderr).unwrap();
    assert_eq!(
        output.status.code(),
        Some(status),
        "{arguments:?}: {complaint}"
    );
    assert_eq!(complaint.lines().count(), 1, "{complaint}");
    assert!(output.stdout.is_empty());
    complaint
        .trim_end()
        .strip_prefix("pendularm: ")
        .unwrap()
        .to_owned()
}

/// A command that goes on, and its output line by line.
struct Going(Child, BufReader<std::process::ChildStdout>);

impl Going {
    fn start(runtime: &Runtime, arguments: &[&str]) -> Self {
        let mut child = command(runtime, arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap());
        Self(child, lines)
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        self.1.read_line(&mut line).unwrap();
        line
    }

    fn interrupt(&self) {
        let pid = self.0.id().to_string();
        let sent = std::process::Command::new("kill")
            .args(["-INT", &pid])
            .status();
        assert!(sent.unwrap().success());
    }

    /// Exit status, the rest of standard output, and standard error.
    fn end(self) -> (Option<i32>, String, String) {
        let Self(child, mut lines) = self;
        let mut rest = String::new();
        std::io::Read::read_to_string(&mut lines, &mut rest).unwrap();
        let output = child.wait_with_output().unwrap();
        let complaint = String::from_utf8(output.stderr).unwrap();
        (output.status.code(), rest, complaint)
    }
}

#[test]
fn lists_show_names_and_types_and_a_line_each() {
    let runtime = Runtime::start();
    let names = said(&runtime, &["topic", "list"]);
    assert!(names.lines().any(|line| line == "/joint_states"), "{names}");
    let types = said(&runtime, &["topic", "list", "-t"]);
    assert!(
        types.contains("/clock [rosgraph_msgs/msg/Clock]\n"),
        "{types}"
    );
    let services = said(&runtime, &["service", "list", "--show-types", "--json"]);
    let first: Value = serde_json::from_str(services.lines().next().unwrap()).unwrap();
    assert!(first["name"].is_string() && first["type"].as_str().unwrap().contains("/srv/"));
    let actions = said(&runtime, &["action", "list", "-t"]);
    let ours = "/ik_action [pendularm_interfaces/action/MoveTo]\n";
    assert!(actions.contains(ours), "{actions}");
    let parameters = said(&runtime, &["param", "list"]);
    assert!(parameters.contains("/arm_sim gravity\n"), "{parameters}");
}

#[test]
fn a_message_is_echoed_in_yaml_as_ros2_does_or_on_a_line_of_json() {
    let runtime = Runtime::start();
    let yaml = said(&runtime, &["topic", "echo", "/joint_states", "--once"]);
    assert!(yaml.starts_with("header:\n  stamp:\n    sec: "), "{yaml}");
    assert!(
        yaml.contains("\nname:\n- joint1\n- joint2\nposition:\n- "),
        "{yaml}"
    );
    assert!(yaml.ends_with("---\n"), "{yaml}");
    let json = json_of(&runtime, &["topic", "echo", "joint_states", "--once"]);
    assert_eq!(json["name"], json!(["joint1", "joint2"]));
    let unknown = refusal(&runtime, &["topic", "echo", "/nothing"], 1);
    assert!(unknown.contains("/nothing is no topic yet"), "{unknown}");
    let typed = ["topic", "echo", "/clock", "std_msgs/msg/String"];
    assert_eq!(
        refusal(&runtime, &typed, 1),
        "/clock is of type rosgraph_msgs/msg/Clock, not std_msgs/msg/String"
    );
    json_of(
        &runtime,
        &["topic", "echo", "/clock", "rosgraph_msgs/Clock", "--once"],
    );
}

#[test]
fn a_part_of_a_message_is_echoed_so_many_times() {
    let runtime = Runtime::start();
    let echo = |field, more: &[&'static str]| {
        [&["topic", "echo", "/joint_states", "--field", field], more].concat()
    };
    let names = said(&runtime, &echo("name[1]", &["-n", "2"]));
    assert_eq!(names, "joint2\n---\njoint2\n---\n");
    let stamp = json_of(&runtime, &echo("header.stamp", &["--times", "1"]));
    assert!(
        stamp["sec"].is_u64() && stamp["nanosec"].is_u64(),
        "{stamp}"
    );
    let unknown = refusal(&runtime, &echo("name[2]", &["--once"]), 1);
    assert_eq!(unknown, "the message has no name[2]");
    for wrong in [echo("name[x]", &[]), echo("name", &["--once", "-n", "2"])] {
        assert_eq!(ask(&runtime, &wrong).status.code(), Some(2), "{wrong:?}");
    }
}

#[test]
fn what_another_client_says_acts_on_no_terminal_and_loses_nothing() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let msg = json!({"data": "\u{1b}[2J\u{202e}\u{9b}31m\r\n---\n", "ok": "\u{e9} yes: no", "\u{1b}": [[], {}, [1, [2]]]});
    client.send(&json!({"op": "advertise", "topic": "/hostile", "type": "std_msgs/msg/String"}));
    client.settle();
    for arguments in [
        vec!["topic", "echo", "/hostile", "--once"],
        vec!["topic", "echo", "/hostile", "--once", "--json"],
    ] {
        let child = Going::start(&runtime, &arguments);
        wait_for_subscriber(&mut client, "/hostile", 1);
        client.send(&json!({"op": "publish", "topic": "/hostile", "msg": msg}));
        let (status, text, complaint) = child.end();
        assert_eq!((status, complaint.as_str()), (Some(0), ""));
        let acts = |one: char| one != '\n' && (one.is_control() || one == '\u{202e}');
        assert!(!text.contains(acts), "{text:?}");
        if arguments.contains(&"--json") {
            assert_eq!(serde_json::from_str::<Value>(&text).unwrap(), msg);
        } else {
            assert!(text.contains("ok: \"\u{e9} yes: no\"\n"), "{text}");
            assert!(
                text.contains("\"\\u001b\":\n- []\n- {}\n- - 1\n  - - 2\n"),
                "{text}"
            );
        }
        wait_for_subscriber(&mut client, "/hostile", 0);
    }
}

/// Until so many nodes subscribe to the topic: clients are one node together.
fn wait_for_subscriber(client: &mut Client, topic: &str, count: usize) {
    let deadline = std::time::Instant::now() + common::PATIENCE;
    loop {
        let nodes = client.ask("/rosapi/subscribers", json!({"topic": topic}));
        if nodes["subscribers"].as_array().unwrap().len() == count {
            return;
        }
        assert!(std::time::Instant::now() < deadline, "{topic}: {nodes}");
    }
}

/// The rate is asked for by two independent numbers: it is the inverse of the mean, which lies between the extremes.
#[test]
fn a_rate_is_told_every_second_until_a_signal() {
    let runtime = Runtime::start();
    let mut child = Going::start(&runtime, &["topic", "hz", "/clock", "--json"]);
    let first: Value = serde_json::from_str(&child.line()).unwrap();
    let second: Value = serde_json::from_str(&child.line()).unwrap();
    let number = |name: &str| second[name].as_f64().unwrap();
    assert!(number("window") > first["window"].as_f64().unwrap());
    assert!(number("min") <= number("rate").recip() && number("rate").recip() <= number("max"));
    assert!(number("std_dev") >= 0.0 && number("std_dev") <= number("max") - number("min"));
    child.interrupt();
    let (status, _, complaint) = child.end();
    assert_eq!((status, complaint.as_str()), (Some(0), ""));
    let mut child = Going::start(&runtime, &["topic", "hz", "-w", "2", "/clock"]);
    assert!(child.line().starts_with("average rate: "));
    let details = child.line();
    assert!(
        details.starts_with("\tmin: ") && details.ends_with("window: 2\n"),
        "{details}"
    );
    child.interrupt();
    assert_eq!(child.end().0, Some(0));
}

#[test]
fn messages_are_published_once_so_many_times_or_until_a_signal() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_trajectory");
    let point = "points: [{positions: [0.3, -0.5]}]";
    let once = ["topic", "pub", "-1", "/joint_trajectory", point];
    let line = "publishing #1: {\"points\":[{\"positions\":[0.3,-0.5]}]}\n";
    assert_eq!(said(&runtime, &once), line);
    let heard = client.message("/joint_trajectory");
    assert_eq!(heard, json!({"points": [{"positions": [0.3, -0.5]}]}));
    let fast = [
        "topic",
        "pub",
        "/chatter",
        "std_msgs/msg/String",
        "{data: hi}",
        "-r",
        "200",
        "-t",
        "3",
    ];
    let lines = said(&runtime, &fast);
    assert_eq!(
        lines.lines().last(),
        Some("publishing #3: {\"data\":\"hi\"}")
    );
    let mut child = Going::start(
        &runtime,
        &["topic", "pub", "/chatter", "data: hi", "-r", "100"],
    );
    child.line();
    assert!(child.line().starts_with("publishing #2"));
    child.interrupt();
    assert_eq!(child.end().0, Some(0));
    for (topic, message, word) in [
        ("/joint_states", "{}", "belongs to the runtime"),
        (
            "/joint_trajectory",
            "points: [{positions: [1]}]",
            "positions",
        ),
        ("/joint_trajectory", "5", "msg must be"),
    ] {
        let output = ask(&runtime, &["topic", "pub", "--once", topic, message]);
        let complaint = String::from_utf8(output.stderr).unwrap();
        assert!(complaint.contains(word), "{complaint}");
        assert_eq!((output.status.code(), output.stdout), (Some(1), vec![]));
    }
}

#[test]
fn a_service_is_called_with_yaml_or_json_and_its_refusal_is_the_runtimes() {
    let runtime = Runtime::start();
    let call = |args: &[&str]| said(&runtime, &[&["service", "call"], args].concat());
    assert_eq!(
        call(&["/pid_controller/enable", "{data: true}"]),
        "data: true\n"
    );
    let gravity = ["/arm_sim/set_params", "gravity: 1.62\nmasses: [1, 0.5]"];
    let params = call(&gravity);
    assert_eq!(
        params,
        "gravity: 1.62\nmasses:\n- 1.0\n- 0.5\nlengths:\n- 1.0\n- 1.0\n"
    );
    let type_name = "pendularm_interfaces/srv/SetIntegrator";
    let set = ["service", "call", "/arm_sim/set_integrator", type_name];
    assert_eq!(json_of(&runtime, &set)["method"], "rk4");
    let set = [&set[..], &["{\"method\": \"verlet\", \"timestep\": 2e-3}"]].concat();
    assert_eq!(
        json_of(&runtime, &set),
        json!({"method": "verlet", "timestep": 0.002})
    );
    let refused = |args: &[&str]| refusal(&runtime, &[&["service", "call"], args].concat(), 1);
    let negative = refused(&["/arm_sim/set_integrator", "{timestep: -1}"]);
    assert!(negative.starts_with("timestep must be"), "{negative}");
    assert_eq!(refused(&["/nothing"]), "no provider for service /nothing");
    let other = refused(&["/arm_sim/reset", "std_srvs/srv/SetBool", "{}"]);
    assert!(other.contains("not std_srvs/srv/SetBool"), "{other}");
}

#[test]
fn a_goal_is_followed_to_its_end_and_a_signal_cancels_it() {
    let runtime = Runtime::start();
    said(
        &runtime,
        &["service", "call", "/pid_controller/enable", "[true]"],
    );
    let goal = ["action", "send_goal", "/ik_action", "{x: 0.5, y: 1.2}"];
    let result = json_of(&runtime, &goal);
    assert_eq!(result["status"], "SUCCEEDED");
    assert_eq!(result["result"]["outcome"], "reached");
    let typed = "pendularm_interfaces/action/MoveTo";
    let goal = [
        "action",
        "send",
        "-f",
        "/ik_action",
        typed,
        "{x: 1.2, y: 0.5}",
    ];
    let text = said(&runtime, &goal);
    assert!(text.starts_with("feedback:\n  goal_id: "), "{text}");
    assert!(text.ends_with("\nstatus: SUCCEEDED\n---\n"), "{text}");

    said(
        &runtime,
        &["service", "call", "/pid_controller/enable", "[false]"],
    );
    let mut child = Going::start(&runtime, &[&goal[..], &["--json"]].concat());
    assert!(child.line().starts_with("{\"feedback\":"));
    child.interrupt();
    let (status, rest, complaint) = child.end();
    let last: Value = serde_json::from_str(rest.lines().last().unwrap()).unwrap();
    assert_eq!((status, &last["status"]), (Some(1), &json!("CANCELED")));
    assert_eq!(complaint, "pendularm: the goal ended as CANCELED\n");

    let refused = |goal: &[&str]| refusal(&runtime, &[&["action", "send"], goal].concat(), 1);
    assert_eq!(
        refused(&["/nothing", "{}"]),
        "action: no action is called /nothing"
    );
    let far = refused(&["/ik_action", "{x: 9, y: 0}"]);
    assert!(far.contains("beyond the arm's reach"), "{far}");
    let other = refused(&["/ik_action", "std_msgs/msg/String", "{}"]);
    assert_eq!(other, format!("action_type must be {typed}"));
}

#[test]
fn parameters_are_told_as_they_can_be_set_again() {
    let runtime = Runtime::start();
    let get = |name: &str| said(&runtime, &["param", "get", "/arm_sim", name]);
    assert_eq!(get("gravity"), "9.81\n");
    for (name, value, printed) in [
        ("gravity", "3.7", "3.7\n"),
        ("masses", "[2, 0.5]", "- 2.0\n- 0.5\n"),
        ("integrator", "verlet", "verlet\n"),
        ("timestep", "1e-4", "0.0001\n"),
    ] {
        assert_eq!(
            said(&runtime, &["param", "set", "arm_sim", name, value]),
            ""
        );
        assert_eq!(get(name), printed);
        assert_eq!(
            said(
                &runtime,
                &["param", "set", "arm_sim", name, "--", get(name).trim_end()]
            ),
            ""
        );
        assert_eq!(get(name), printed);
    }
    assert!(get("robot_description").starts_with("<?xml"));
    assert_eq!(
        json_of(&runtime, &["param", "get", "/arm_sim", "integrator"]),
        "verlet"
    );
    for (node, name) in [("/arm_sim", "colour"), ("/nope", "gravity")] {
        let full = format!("{node}:{name}");
        let expected = format!("there is no parameter {full:?}; `pendularm param list` has all");
        let get = ["param", "get", node, name];
        assert_eq!(refusal(&runtime, &get, 1), expected);
        let set = ["param", "set", node, name, "1"];
        assert_eq!(refusal(&runtime, &set, 1), expected);
    }
    let wrong = refusal(
        &runtime,
        &["param", "set", "/arm_sim", "gravity", "heavy"],
        1,
    );
    assert!(wrong.contains("gravity must be"), "{wrong}");
    let negative = ["param", "set", "/arm_sim", "gravity", "-3.7"];
    let wrong = refusal(&runtime, &negative, 1);
    assert!(wrong.ends_with("got -3.7"), "{wrong}");
}

#[test]
fn diagnostics_are_a_page_and_their_status_tells_whether_all_is_well() {
    let runtime = Runtime::start();
    let page = said(&runtime, &["diagnostics"]);
    assert!(page.starts_with("OK arm_sim: running\n  state "), "{page}");
    assert_eq!(json_of(&runtime, &["diagnostics"])["status"][0]["level"], 0);
    let mut client = runtime.connect();
    client.ask(
        "/pid_controller/set_gains",
        json!({"kp": [1e6, 1e6], "kd": [1e5, 1e5]}),
    );
    client.ask("/arm_sim/set_integrator", json!({"timestep": 0.02}));
    client.ask("/pid_controller/enable", json!({"data": true}));
    client.subscribe("/diagnostics");
    client.send(&json!({"op": "publish", "topic": "/joint_trajectory", "msg": {"points": [{"positions": [1, 1]}]}}));
    client.receive_where("a divergence", |frame| {
        frame["topic"] == "/diagnostics" && frame["msg"]["status"][0]["level"] == 2
    });
    let output = ask(&runtime, &["diagnostics"]);
    assert_eq!(output.status.code(), Some(1));
    let page = String::from_utf8(output.stdout).unwrap();
    assert!(page.starts_with("ERROR arm_sim: diverged: "), "{page}");
    let complaint = String::from_utf8(output.stderr).unwrap();
    assert!(
        complaint.starts_with("pendularm: arm_sim: diverged"),
        "{complaint}"
    );
}
