//! Records of the built program: complete files, incomplete files, and missing ones.

use std::fs::{self, File};
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use pendularm::record::{CALLS, INPUTS, RecordEnding, RecordedMessage, Recording, STATES, replay};
use serde_json::{Value, json};

use crate::common::{PATIENCE, Runtime, signal};
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
pub(super) fn run(arguments: &[&str]) -> (Option<i32>, String) {
    let mut program = Command::new(env!("CARGO_BIN_EXE_pendularm"));
    let output = program.args(arguments).output().unwrap();
    let said = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8(said).unwrap())
}

pub(super) fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn a_run_is_recorded_whole_and_replayed() {
    let folder = Folder::new("record-whole");
    let file = folder.join("run.mcap");
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
    let verdict = replay(File::open(&file).unwrap()).unwrap();
    assert_eq!((verdict.links, verdict.difference), (3, None));
    assert!(verdict.inputs >= 3 && verdict.states >= 20);

    let (status, said) = run(&["replay", text(&file)]);
    assert_eq!(status, Some(0), "{said}");
    assert!(said.ends_with("the same, bit for bit\n"), "{said}");
}

#[cfg(feature = "cli")]
/// As rosbag2 reads it: with the metadata record of that name and no metadata in it, policies are numbers.
#[test]
fn each_channel_has_the_quality_of_service_that_rosbag2_plays_it_with() {
    let folder = Folder::new("record-qos");
    let file = folder.join("run.mcap");
    let runtime = Runtime::with(&["--record", text(&file)]);
    let mut client = runtime.connect();
    client.ask("/arm_sim/pause", json!({"data": true}));
    client.subscribe("/joint_states");
    client.message("/joint_states");
    runtime.stop();
    let summary = mcap::Summary::read(&fs::read(&file).unwrap())
        .unwrap()
        .unwrap();
    let latched = [
        "/robot_description",
        "/robot_description_semantic",
        "/tf_static",
    ];
    let mut seen = 0;
    for channel in summary.channels.values() {
        let profiles = &channel.metadata["offered_qos_profiles"];
        let documents = yaml_rust2::YamlLoader::load_from_str(profiles).unwrap();
        let [profile] = documents[0].as_vec().unwrap().as_slice() else {
            panic!("{profiles}");
        };
        let number = |name: &str| profile[name].as_i64().unwrap();
        let is_latched = latched.contains(&channel.topic.as_str());
        seen += usize::from(is_latched);
        let (transient_local, volatile) = (1, 2);
        let durability = if is_latched {
            transient_local
        } else {
            volatile
        };
        assert_eq!(number("durability"), durability, "{}", channel.topic);
        assert_eq!(
            (
                number("history"),
                number("reliability"),
                number("liveliness")
            ),
            (1, 1, 1)
        );
        assert!(number("depth") > 0);
        for time in ["deadline", "lifespan", "liveliness_lease_duration"] {
            assert_eq!(profile[time]["sec"].as_i64(), Some(9_223_372_036));
            assert_eq!(profile[time]["nsec"].as_i64(), Some(854_775_807));
        }
        assert_eq!(
            profile["avoid_ros_namespace_conventions"].as_bool(),
            Some(false)
        );
    }
    assert_eq!(seen, latched.len());
    assert!(
        summary
            .metadata_indexes
            .iter()
            .any(|one| one.name == "rosbag2")
    );
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
fn an_unusable_record_is_refused_with_the_files_name() {
    let folder = Folder::new("record-refused");
    let there = folder.join("there.mcap");
    fs::write(&there, "precious").unwrap();
    let (status, said) = run(&[
        "--bind",
        "127.0.0.1:0",
        "--log",
        "off",
        "--record",
        text(&there),
    ]);
    assert_eq!(status, Some(1));
    let named = format!("cannot record: {}: ", there.display());
    assert!(said.contains(&named), "{said}");
    assert_eq!(fs::read_to_string(&there).unwrap(), "precious");

    let (status, said) = run(&["replay", text(&there)]);
    assert_eq!(status, Some(1));
    assert!(said.contains("there.mcap: not a record: "), "{said}");
    let (status, said) = run(&["replay", text(&folder.join("nowhere.mcap"))]);
    assert_eq!(status, Some(1));
    assert!(said.contains("nowhere.mcap: "), "{said}");
    let (status, said) = run(&["replay", text(&folder)]);
    assert_eq!(status, Some(1));
    let cause = format!("{}: Is a directory", folder.display());
    assert!(said.contains(&cause), "{said}");
    let (status, _) = run(&["replay"]);
    assert_eq!(status, Some(2));
}

#[test]
fn a_folder_that_is_none_is_refused_at_the_start() {
    let folder = Folder::new("record-no-folder");
    let file = folder.join("file");
    fs::write(&file, "").unwrap();
    for none in [&folder.join("missing"), &file] {
        let bind = ["--bind", "127.0.0.1:0", "--log", "off"];
        let (status, said) = run(&[&bind[..], &["--record-dir", text(none)]].concat());
        assert_eq!(status, Some(1));
        let named = format!("cannot record: {}: ", none.display());
        assert!(said.contains(&named), "{said}");
    }
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
fn without_a_folder_clients_neither_begin_nor_end_a_record() {
    let folder = Folder::new("record-operators");
    let file = folder.join("run.mcap");
    let runtime = Runtime::with(&["--record", text(&file)]);
    let mut client = runtime.connect();
    for service in ["/recorder/start", "/recorder/stop"] {
        let refused = client.call(service, json!({}));
        let status = refused["status"].as_str().unwrap();
        assert!(status.contains("--record-dir"), "{status}");
    }
    runtime.stop();
    assert_eq!(passages(&file).1, RecordEnding::Whole);
}

#[test]
fn the_operators_record_is_not_ended_by_a_client() {
    let folder = Folder::new("record-operators-and-clients");
    let file = folder.join("operators.mcap");
    let runtime = Runtime::with(&["--record", text(&file), "--record-dir", text(&folder)]);
    let mut client = runtime.connect();
    let refused = client.call("/recorder/stop", json!({}));
    assert_eq!(
        refused["status"],
        "operators.mcap was started by the operator with --record, and ends with the program"
    );
    client.ask("/arm_sim/pause", json!({"data": true}));
    runtime.stop();
    assert_eq!(passages(&file).1, RecordEnding::Whole);
    assert!(holds_call(&file, "{\"data\":true}"));
}
