//! Records of the built program: complete files, incomplete files, and missing ones.

use std::fs::{self, File};
use std::path::Path;
use std::time::{Instant, SystemTime};

use pendularm::record::{
    CALLS, Content, INPUTS, McapWriter, RecordEnding, RecordEntry, RecordedMessage, Recording,
    RunSettings, STATES, replay,
};
use serde_json::{Value, json};

use crate::common::{self, PATIENCE, Runtime, signal};
use crate::folder::Folder;

pub(super) fn passages(file: &Path) -> (Vec<RecordedMessage>, RecordEnding) {
    let mut recording = Recording::new(File::open(file).unwrap());
    let mut passages = Vec::new();
    while let Some(passage) = recording.next_passage().unwrap() {
        passages.push(passage);
    }
    (passages, recording.ending().unwrap())
}

/// Whether the file holds a call with these arguments.
fn holds_call(file: &Path, args: &str) -> bool {
    let (passages, _) = passages(file);
    passages.iter().any(|one| {
        let content = one.msg.as_ref().map(|msg| &msg["content"]);
        one.topic == CALLS && content == Some(&Value::from(args))
    })
}

/// The program with a command: its exit status and its output.
fn run(arguments: &[&str]) -> (Option<i32>, String) {
    let output = common::run(arguments);
    let said = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8(said).unwrap())
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Each channel has the quality of service that rosbag2 plays it with, where policies are numbers.
fn assert_qos(file: &Path) {
    let summary = mcap::Summary::read(&fs::read(file).unwrap());
    let summary = summary.unwrap().unwrap();
    let mut records = summary.metadata_indexes.iter();
    assert!(records.any(|one| one.name == "rosbag2"));
    let infinite = "\n    sec: 9223372036\n    nsec: 854775807";
    for channel in summary.channels.values() {
        let topic = channel.topic.as_str();
        let is_latched = topic.starts_with("/robot_description") || topic == "/tf_static";
        let (depth, durability) = if is_latched { (1, 1) } else { (10, 2) };
        let expected = format!(
            "- history: 1\n  depth: {depth}\n  reliability: 1\n  durability: {durability}\n  deadline:{infinite}\n  \
             lifespan:{infinite}\n  liveliness: 1\n  liveliness_lease_duration:{infinite}\n  \
             avoid_ros_namespace_conventions: false"
        );
        assert_eq!(
            channel.metadata["offered_qos_profiles"], expected,
            "{topic}"
        );
    }
}

#[test]
fn a_run_is_recorded_whole_and_replayed() {
    let folder = Folder::new("record-whole");
    let file = folder.join("run.mcap");
    let time_of_day = || SystemTime::UNIX_EPOCH.elapsed().unwrap().as_nanos();
    let began = time_of_day();
    let runtime = Runtime::with(&["--links", "3", "--seed", "5", "--record", text(&file)]);
    let mut client = runtime.connect();
    client.ask("/pid_controller/enable", json!({"data": true}));
    client.ask("/ik_trial/start", json!({"duration": 60}));
    client.subscribe("/joint_states");
    for _ in 0..30 {
        client.message("/joint_states");
    }
    client.ask("/arm_sim/reset", json!({}));
    runtime.stop();

    let (passages, ending) = passages(&file);
    assert_eq!(ending, RecordEnding::Whole);
    for topic in [INPUTS, STATES, CALLS, "/joint_states", "/tf", "/clock"] {
        assert!(passages.iter().any(|one| one.topic == topic), "{topic}");
    }
    let times = passages.iter().map(|one| u128::from(one.log_time));
    assert!(times.clone().is_sorted() && times.clone().all(|time| time > began));
    assert!(times.max() < Some(time_of_day()));
    assert_qos(&file);
    let verdict = replay(File::open(&file).unwrap()).unwrap();
    assert_eq!((verdict.links, verdict.difference), (3, None));
    assert!(verdict.inputs >= 3 && verdict.states >= 20);

    let (status, said) = run(&["replay", text(&file)]);
    assert_eq!(status, Some(0), "{said}");
    assert!(said.ends_with("the same, bit for bit\n"), "{said}");
}

#[test]
fn a_killed_program_leaves_a_record_that_is_read_and_replayed() {
    let folder = Folder::new("record-killed");
    let file = folder.join("run.mcap");
    let mut runtime = Runtime::with(&["--record", text(&file)]);
    let mut client = runtime.connect();
    client.ask("/pid_controller/enable", json!({"data": true}));
    client.ask("/arm_sim/set_params", json!({"gravity": 4.25}));
    let deadline = Instant::now() + PATIENCE;
    while !holds_call(&file, "{\"gravity\":4.25}") {
        assert!(Instant::now() < deadline, "it is not flushed");
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    signal(runtime.pid(), "KILL");
    runtime.end();

    assert!(holds_call(&file, "{\"gravity\":4.25}"));
    let (status, said) = run(&["replay", text(&file)]);
    assert_eq!(status, Some(0), "{said}");
    assert!(
        said.contains("the same, bit for bit; the file ends early"),
        "{said}"
    );
}

#[test]
fn an_unusable_file_or_folder_is_refused_by_its_name() {
    let folder = Folder::new("record-refused");
    let (there, nowhere) = (folder.join("there.mcap"), folder.join("nowhere.mcap"));
    fs::write(&there, "precious").unwrap();
    for (option, path, why) in [
        ("--record", &there, "cannot record: "),
        ("--record-dir", &there, "cannot record: "),
        ("--record-dir", &nowhere, "cannot record: "),
        ("replay", &there, ""),
        ("replay", &nowhere, ""),
        ("replay", &folder.to_path_buf(), ""),
    ] {
        let serve = ["--bind", "127.0.0.1:0", "--log", "off"];
        let serve = if option == "replay" { &[] } else { &serve[..] };
        let (status, said) = run(&[serve, &[option, text(path)]].concat());
        assert_eq!(status, Some(1), "{said}");
        let named = format!("pendularm: {why}{}: ", path.display());
        assert!(said.starts_with(&named), "{said}");
    }
    assert_eq!(fs::read_to_string(&there).unwrap(), "precious");
}

#[test]
fn clients_record_into_the_operators_folder_and_nowhere_else() {
    let folder = Folder::new("record-service");
    let runtime = Runtime::with(&["--record-dir", text(&folder)]);
    let mut client = runtime.connect();
    let nothing = client.call("/recorder/stop", json!({}));
    assert_eq!(nothing["status"], "nothing is being recorded");
    let refused = client.call("/recorder/start", json!({"name": "../x"}));
    let status = refused["status"].as_str().unwrap();
    assert!(status.starts_with("name must be 1 to 64 "), "{status}");
    assert_eq!(fs::read_dir(&*folder).unwrap().count(), 0);

    let begun = client.ask("/recorder/start", json!({"name": "lesson-1"}));
    assert_eq!(begun["file"], "lesson-1.mcap");
    let again = client.call("/recorder/start", json!({}));
    assert_eq!(again["status"], "already recording to lesson-1.mcap");
    client.ask(
        "/arm_sim/disturb",
        json!({"effort": [3.0, 0.0], "duration": 0.1}),
    );
    client.subscribe("/joint_states");
    for _ in 0..5 {
        client.message("/joint_states");
    }
    let ended = client.ask("/recorder/stop", json!({}));
    assert_eq!(ended["file"], "lesson-1.mcap");
    assert_eq!(ended["dropped"], 0);
    let file = folder.join("lesson-1.mcap");
    let (passages, ending) = passages(&file);
    assert_eq!(ending, RecordEnding::Whole);
    assert_eq!(ended["messages"], passages.len());
    assert_eq!(replay(File::open(&file).unwrap()).unwrap().difference, None);

    let taken = client.call("/recorder/start", json!({"name": "lesson-1.mcap"}));
    assert_eq!(taken["result"], false, "no record is overwritten: {taken}");
    let made_up = client.ask("/recorder/start", json!({}));
    assert!(folder.join(made_up["file"].as_str().unwrap()).exists());
    client.ask("/recorder/stop", json!({}));
}

#[test]
fn the_operators_record_is_not_ended_by_a_client() {
    let folder = Folder::new("record-operators");
    let file = folder.join("operators.mcap");
    let record = ["--record", text(&file)];
    for (option, why) in [
        (&[][..], "--record-dir"),
        (
            &["--record-dir", text(&folder)],
            "operators.mcap was started by the operator with --record",
        ),
    ] {
        let runtime = Runtime::with(&[&record, option].concat());
        let mut client = runtime.connect();
        let refused = client.call("/recorder/stop", json!({}));
        let status = refused["status"].as_str().unwrap();
        assert!(status.contains(why), "{status}");
        client.ask("/arm_sim/pause", json!({"data": true}));
        runtime.stop();
        assert_eq!(passages(&file).1, RecordEnding::Whole);
        assert!(holds_call(&file, "{\"data\":true}"));
        fs::remove_file(&file).unwrap();
    }
}

/// The first input of a new record of a run with one call: the whole simulation at its start.
fn beginning(file: &Path) -> String {
    let runtime = Runtime::with(&["--record", text(file)]);
    runtime
        .connect()
        .ask("/arm_sim/pause", json!({"data": true}));
    runtime.stop();
    let (passages, _) = passages(file);
    let begin = passages.iter().find(|one| one.topic == INPUTS).unwrap();
    let begin = begin.msg.as_ref().unwrap()["input"].as_str();
    begin.unwrap().to_owned()
}

const fn input(note: String) -> Content {
    Content::Input { step: 0, note }
}

/// Writes a record of its own over `file`.
fn write(file: &Path, contents: impl IntoIterator<Item = Content>) {
    let settings = RunSettings { links: 2, seed: 0 };
    let mut writer = McapWriter::new(File::create(file).unwrap(), &settings).unwrap();
    for content in contents {
        let log_time = 0;
        writer.write(&RecordEntry { log_time, content }).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn a_record_of_another_version_is_replayed_with_a_note() {
    let folder = Folder::new("record-version");
    let file = folder.join("run.mcap");
    let mut begin: Value = serde_json::from_str(&beginning(&file)).unwrap();
    assert!(!run(&["replay", text(&file)]).1.contains("note:"));
    let simulation = &begin["begin"]["simulation"];
    let numbers = |values: &Value| serde_json::from_value(values.clone()).unwrap();
    let state = Content::State {
        step: 0,
        position: numbers(&simulation["state"]["position"]),
        velocity: numbers(&simulation["state"]["velocity"]),
        effort: numbers(&simulation["effort"]),
    };
    let ours = env!("PENDULARM_VERSION");
    assert_eq!(begin["begin"]["version"], ours);
    for version in ["9", "\u{1b}"] {
        begin["begin"]["version"] = version.into();
        write(&file, [input(begin.to_string()), state.clone()]);
        let (status, said) = run(&["replay", text(&file)]);
        assert_eq!(status, Some(0), "{said}");
        let note = format!("; note: recorded by version {version:?}, and this is {ours:?}\n");
        assert!(said.ends_with(&note), "{said}");
    }
}

/// `tests/actors/recorder/replays.rs` has the steps and the values. Texts of a file, also its name, act on no terminal.
#[test]
fn a_difference_and_a_false_text_are_reported_in_one_line_and_by_the_exit_status() {
    let folder = Folder::new("record-\u{1b}[31m-\u{202e}crafted");
    let file = folder.join("run.mcap");
    let begin = beginning(&file);
    let rest = vec![0.0; 2];
    let state = |step| Content::State {
        step,
        position: rest.clone(),
        velocity: rest.clone(),
        effort: rest.clone(),
    };
    // Under gravity the arm does not stay at rest. It may move already when the record begins.
    let hostile = format!(
        "{{\"{}\": 1}}",
        "\u{1b}[2J\u{202e}\u{9b}31m".repeat(100_000)
    );
    for (second, third, why) in [
        (state(0), state(10), ": the same up to step 0, and at step "),
        (input(hostile), state(10), "\\u"),
    ] {
        write(&file, [input(begin.clone()), second, third]);
        let (status, said) = run(&["replay", text(&file)]);
        assert_eq!(status, Some(1), "{said:?}");
        let acts = |one: char| one != '\n' && (one.is_control() || one == '\u{202e}');
        assert!(said.contains(why) && !said.contains(acts), "{said:?}");
        assert!(said.lines().count() == 1 && said.len() < 2000, "{said:?}");
        assert!(
            said.contains("crafted-") && said.contains("/run.mcap: "),
            "{said}"
        );
    }
}
