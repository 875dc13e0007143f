//! `pendularm conformance`: its exit status and its files, and addresses without a proper server.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use pendularm_conformance::sabotage::faults;
use pendularm_conformance::sabotage::proxy::{Fault, Proxy, Side};
use serde_json::Value;

use crate::common::{self, Runtime, signal};

/// A run that may use 100 MB of memory.
fn conformance(arguments: &[&str]) -> Output {
    common::shell("ulimit -d 100000").arg("conformance").args(arguments).output().unwrap()
}

fn out(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// A file in the folder for tests' files.
fn file(name: &str) -> String {
    format!("{}/conformance-{name}-{}", env!("CARGO_TARGET_TMPDIR"), std::process::id())
}

/// A server that does this with each client.
fn serving(with: impl Fn(TcpStream) + Send + Sync + Clone + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    thread::spawn(move || {
        for client in listener.incoming().flatten() {
            let with = with.clone();
            thread::spawn(move || with(client));
        }
    });
    address
}

/// A server that sends this after the first bytes of a client, and closes.
fn saying(text: &'static [u8]) -> String {
    serving(move |mut client| {
        let _ = client.read(&mut [0; 4096]);
        let _ = client.write_all(text);
    })
}

#[test]
fn an_address_without_a_proper_server_gets_a_verdict_within_5_s() {
    let closed = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let endless = |mut client: TcpStream| {
        let chunk = [b'['; 64 * 1024];
        for _ in 0..1600 {
            if client.write_all(&chunk).is_err() {
                break;
            }
        }
    };
    let answers_once = |mut client: TcpStream| {
        let _ = client.read(&mut [0; 4096]);
        let _ = client.write_all(b"{\"op\": \"service_response\", \"id\": \"call-0\", \"result\": true, \"values\": {}}\n");
    };
    let cases = [
        (closed, "no connection"),
        ("no.such.host.invalid:9095".to_owned(), "no.such.host.invalid"),
        (saying(b"HTTP/1.1 400 Bad Request\r\n\r\n"), "it speaks HTTP"),
        (saying(b"\x15\x03\x01\x00\x02\x02\x46"), "it speaks TLS"),
        (saying(b"what?\r\n"), "no JSON object: what?"),
        (serving(|client| drop(client.take(1 << 30).read_to_end(&mut Vec::new()))), "it gave no answer to a call"),
        (serving(endless), "a line of more than 1048576 bytes"),
        (serving(answers_once), "closes the connection after an answer"),
    ];
    thread::scope(|scope| {
        for (address, expected) in cases {
            scope.spawn(move || {
                let began = Instant::now();
                let output = conformance(&[&address]);
                let said = common::complaint(&output, 2);
                assert!(said.contains(expected), "{expected}: {said}");
                assert!(began.elapsed() < Duration::from_secs(8), "{expected}: {:?}", began.elapsed());
            });
        }
    });
}

/// The output of a run with some rules against our server behind a fault.
fn against(fault: Fault, rules: &str) -> String {
    let program = Runtime::start();
    let proxy = Proxy::start(&program.address.to_string(), fault).unwrap();
    out(&conformance(&[&proxy.address, "--rule", rules]))
}

#[test]
fn a_server_that_answers_twice_fails_the_rule_on_one_answer_alone() {
    let twice = |side, frame: Value| vec![frame.clone(); if side == Side::Server && frame["op"] == "service_response" { 2 } else { 1 }];
    for (rules, holding, failing) in [("envelope", 6, 1), ("checkpoint", 12, 0)] {
        let said = against(Box::new(twice), rules);
        assert_eq!((said.matches("ok   ").count(), said.matches("FAIL envelope-1").count()), (holding, failing), "{said}");
    }
}

#[test]
fn a_server_that_sends_100_mb_amid_a_run_gets_a_verdict() {
    let endless: Fault = Box::new(|side, frame| {
        let is_it = side == Side::Server && frame["service"] == "/pid_controller/set_gains";
        vec![if is_it { Value::String("[".repeat(100_000_000)) } else { frame }]
    });
    let said = against(endless, "gains-1");
    assert!(said.contains("/pid_controller/set_gains, which the server lacks: gains-1"), "{said}");
    // 60,000 messages a second.
    let flood: Fault = Box::new(|_, frame| vec![frame.clone(); if frame["topic"] == "/joint_states" { 1000 } else { 1 }]);
    let said = against(flood, "states");
    assert!(said.contains("ok   states-1"), "{said}");
}

#[test]
fn the_files_have_the_results() {
    let program = Runtime::start();
    let [json, junit, html] = ["json", "junit", "html"].map(file);
    let fault: Fault = Box::new(|side, mut frame| {
        if side == Side::Server && frame["service"] == "/arm_sim/integration_step" && frame["result"] == true {
            frame["values"]["times"][0] = "<&>".into();
        }
        vec![frame]
    });
    let proxy = Proxy::start(&program.address.to_string(), fault).unwrap();
    let output = conformance(&[&proxy.address, "--rule", "checkpoint", "--json", &json, "--junit", &junit, "--html", &html]);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    assert!(out(&output).lines().all(|line| line.chars().count() <= 120), "{}", out(&output));
    let [json, junit, html] = [json, junit, html].map(|path| {
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::remove_file(path).unwrap();
        text
    });
    let json: Value = serde_json::from_str(&json).unwrap();
    let failed: Vec<&Value> = json["rules"].as_array().unwrap().iter().filter(|rule| rule["verdict"] == "fails").collect();
    assert!(!failed.is_empty() && failed.len() < 12);
    assert_eq!(json["all"]["all"], 12);
    assert_eq!(json["all"]["holding"], 12 - failed.len());
    let froms: Vec<&str> = failed[0]["frames"].as_array().unwrap().iter().map(|frame| frame["from"].as_str().unwrap()).collect();
    assert!(froms.contains(&"suite") && froms.contains(&"server"), "{froms:?}");
    assert_eq!(junit.matches("<testcase ").count(), 12);
    assert_eq!(junit.matches("<failure ").count(), failed.len());
    assert!(junit.contains(&format!("tests=\"12\" failures=\"{}\"", failed.len())), "{junit}");
    for text in [junit, html] {
        assert!(text.contains("&lt;&amp;&gt;") && !text.contains("<&>"));
        let opened = text.matches('<').count() - text.matches("<!").count() - text.matches("<?").count();
        let (closing, empty) =
            (text.matches("</").count(), text.matches("/>").count() + text.matches("<meta").count() + text.matches("<br>").count());
        assert_eq!(opened, 2 * closing + empty, "every element is closed: {text}");
    }
}

#[test]
fn rules_are_listed_and_a_wrong_number_of_links_is_refused() {
    let listed = out(&conformance(&["--list", "--category", "integrators"]));
    assert_eq!(listed.lines().count(), 34, "{listed}");
    let strict = out(&conformance(&["--list", "--category", "pid", "--strict-specification"]));
    assert!(strict.contains("enable-6") && !strict.contains("enable-7"), "{strict}");
    let program = Runtime::start();
    let output = conformance(&[&program.address.to_string(), "--links", "3", "--rule", "gains-1"]);
    assert!(common::complaint(&output, 2).contains("has 2 links instead of 3"));
    let output = conformance(&[&program.address.to_string(), "--rule", "no-such-rule"]);
    assert!(common::complaint(&output, 2).contains("no rule is left"));
}

#[cfg(unix)]
#[test]
fn a_started_server_is_tested_and_stopped() {
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let command = format!("{} --bind {address}", env!("CARGO_BIN_EXE_pendularm"));
    let output = conformance(&[&address, "--start", &command, "--links", "3", "--rule", "enable-1"]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let output = conformance(&[&address, "--start", &command, "--rule", "launch"]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    assert_eq!(out(&output).matches("ok   launch-").count(), 5, "{output:?}");
    assert!(TcpStream::connect(&address).is_err(), "it still runs");
    let output = conformance(&[&address, "--start", "exit 7"]);
    assert!(common::complaint(&output, 2).contains("exit status: 7"), "{output:?}");
}

/// The settings of a server, by the answers to empty requests.
fn settings(program: &Runtime) -> Vec<Value> {
    let mut client = common::Client::to(program.address);
    let services =
        ["/arm_sim/set_params", "/arm_sim/set_integrator", "/pid_controller/set_gains", "/pid_controller/enable", "/arm_sim/pause"];
    services.map(|service| client.call(service, serde_json::json!({}))["values"].clone()).to_vec()
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_restores_the_server_and_a_dead_server_leaves_results() {
    let program = Runtime::start();
    let mut client = common::Client::to(program.address);
    for (service, args) in [
        ("/arm_sim/set_integrator", serde_json::json!({"method": "verlet", "timestep": 0.002})),
        ("/pid_controller/set_gains", serde_json::json!({"kp": [7.0, 8.0]})),
        ("/arm_sim/pause", serde_json::json!({"data": true})),
    ] {
        client.call(service, args);
    }
    let before = settings(&program);
    let json = file("partial");
    let start = |address: String| {
        let mut command = common::program();
        command.args(["conformance", &address, "--json", &json]).stdout(Stdio::piped()).stderr(Stdio::piped());
        command.spawn().unwrap()
    };
    let running = start(program.address.to_string());
    thread::sleep(Duration::from_secs(3));
    signal(running.id(), "INT");
    let output = running.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(out(&output).contains("note: interrupted before"), "{}", out(&output));
    assert_eq!(settings(&program), before);
    let running = start(program.address.to_string());
    thread::sleep(Duration::from_secs(2));
    drop(program);
    let output = running.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(out(&output).contains("note: the server is gone since"), "{}", out(&output));
    assert!(out(&output).contains("\nok "), "{}", out(&output));
    let partial: Value = serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
    let tried = partial["rules"].as_array().unwrap();
    assert!((1..140).contains(&tried.len()) && tried.iter().any(|rule| rule["verdict"] == "holds"), "{partial}");
}

#[test]
fn two_runs_at_once_and_other_programs_are_noticed() {
    let program = Runtime::start();
    let address = program.address.to_string();
    let outputs: Vec<Output> = thread::scope(|scope| {
        let runs: Vec<_> = (0..2).map(|_| scope.spawn(|| conformance(&[&address, "--rule", "gains"]))).collect();
        runs.into_iter().map(|run| run.join().unwrap()).collect()
    });
    for output in outputs {
        assert_eq!(output.status.code(), Some(1));
        assert!(out(&output).contains("another conformance run"), "{}", out(&output));
    }
    let output = thread::scope(|scope| {
        let run = scope.spawn(|| conformance(&[&address, "--rule", "trajectory"]));
        let mut client = common::Client::to(program.address);
        while !run.is_finished() {
            let points = serde_json::json!([{"positions": [0.5, -0.5]}]);
            client.send(
                &serde_json::json!({"op": "publish", "topic": "/joint_trajectory", "msg": {"header": {"frame_id": ""}, "points": points}}),
            );
            thread::sleep(Duration::from_millis(100));
        }
        run.join().unwrap()
    });
    assert!(out(&output).contains("another program moved the arm"), "{}", out(&output));
}

#[test]
fn points_of_rules_sections_and_categories_are_added_up() {
    let path = file("points.toml");
    let (program, address) = (Runtime::start(), |program: &Runtime| program.address.to_string());
    let graded = |text: &str, arguments: &[&str]| {
        std::fs::write(&path, text).unwrap();
        conformance(&[&[&address(&program), "--points", &path], arguments].concat())
    };
    let text = "# worth\n[points]\nmethod-1 = 5  # this one\nmethod = 2\n\"PID control\" = 0.25\n";
    let json = file("points.json");
    let output = graded(text, &["--rule", "method", "--json", &json]);
    let rules = out(&output).matches("\nok   method-").count() + usize::from(out(&output).starts_with("ok   method-"));
    let all = 2 * rules + 3;
    assert!(rules > 3 && out(&output).contains(&format!("{rules}, {all} of {all} points")), "{output:?}");
    let results: Value = serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
    assert_eq!(results["all"]["points"], all as f64);
    let output = graded(text, &["--rule", "gains-1"]);
    assert!(out(&output).contains("0.25 of 0.25 points"), "{output:?}");
    for (text, wrong) in [
        ("method-1", "line 1: must be `name = points`"),
        ("\nmethods = 2", "line 2: must name a rule, a section or a category"),
        ("method = -1", "line 1: points must be a number, at least 0"),
        ("method = 1\nmethod = 2", "line 2: the name has points already"),
    ] {
        assert!(common::complaint(&graded(text, &[]), 2).contains(wrong), "{text}");
    }
}

/// The first lines of a saboteur with these arguments at a free port, and the exit status after a request to end.
#[cfg(unix)]
fn sabotaged(arguments: &[&str], lines: usize, during: impl FnOnce(&str)) -> (Vec<String>, Option<i32>) {
    let mut command = common::program();
    let mut child = command.arg("sabotage").args(arguments).arg("127.0.0.1:0").stdout(Stdio::piped()).spawn().unwrap();
    let mut said = BufReader::new(child.stdout.take().unwrap()).lines();
    let said: Vec<String> = said.by_ref().take(lines).map(Result::unwrap).collect();
    let address = said[0].strip_prefix("listening on ").unwrap().split(':').take(2).collect::<Vec<_>>().join(":");
    let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| during(&address)));
    signal(child.id(), "TERM");
    let status = child.wait().unwrap().code();
    outcome.unwrap();
    assert!(TcpStream::connect(&address).is_err(), "it still listens");
    (said, status)
}

#[cfg(unix)]
#[test]
fn a_saboteur_serves_an_arm_whose_fault_is_found_by_the_rules() {
    let listed = out(&common::program().args(["sabotage", "--list"]).output().unwrap());
    assert_eq!(listed.lines().count(), faults::all().len());
    let number = faults::all().iter().position(|planted| planted.rule == "checkpoint-5").unwrap() + 1;
    let (said, status) = sabotaged(&[&number.to_string(), "--reveal"], 2, |address| {
        let output = conformance(&[address, "--rule", "checkpoint-5"]);
        assert_eq!(output.status.code(), Some(1), "{output:?}");
        assert!(out(&output).contains("positions by midpoint"), "{output:?}");
        assert_eq!(conformance(&[address, "--rule", "checkpoint-4"]).status.code(), Some(0));
    });
    assert_eq!((said[1].as_str(), status), ("checkpoint-5: the server midpoint is euler", Some(0)));
    let revealed = |seed: &str| sabotaged(&["--seed", seed, "--reveal"], 2, |_| ()).0.remove(1);
    assert_eq!(revealed("7"), revealed("7"));
    assert!((8..12).any(|seed| revealed(&seed.to_string()) != revealed("7")));
    for (arguments, wrong) in [
        (vec!["0"], "N must be a whole number from 1 to"),
        (vec!["1", "2"], "one too many"),
        (vec!["1", "--seed", "2"], "a number or a seed"),
    ] {
        let output = common::program().arg("sabotage").args(arguments).output().unwrap();
        assert!(common::complaint(&output, 2).contains(wrong), "{output:?}");
    }
}
