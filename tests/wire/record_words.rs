//! Records that the tests write themselves: too short ones, ones that differ, and ones with hostile texts.

use std::fs::{self, File};
use std::path::Path;

use pendularm::record::{Content, INPUTS, McapWriter, RecordEntry, RunSettings};
use serde_json::{Value, json};

use crate::common::Runtime;
use crate::folder::Folder;
use crate::record::{passages, run, text};

/// Records a run with one call.
fn record(file: &Path) {
    let runtime = Runtime::with(&["--record", text(file)]);
    let mut client = runtime.connect();
    client.ask("/arm_sim/pause", json!({"data": true}));
    runtime.stop();
}

/// Writes a record that has the first input of the one in `file`, and then this.
fn write_instead(file: &Path, begin: &str, contents: impl IntoIterator<Item = Content>) {
    let settings = RunSettings { links: 2, seed: 0 };
    let mut writer = McapWriter::new(File::create(file).unwrap(), &settings).unwrap();
    let note = begin.to_owned();
    for content in [Content::Input { step: 0, note }]
        .into_iter()
        .chain(contents)
    {
        let log_time = 0;
        writer.write(&RecordEntry { log_time, content }).unwrap();
    }
    writer.finish().unwrap();
}

/// The first input of a record: the whole simulation at its start.
fn beginning(file: &Path) -> String {
    let (passages, _) = passages(file);
    let first = passages.into_iter().find(|one| one.topic == INPUTS);
    let msg = first.unwrap().msg.unwrap();
    msg["input"].as_str().unwrap().to_owned()
}

/// `tests/actors/recorder/replays.rs` has the steps and the values.
#[test]
fn a_difference_is_reported_with_its_step_and_by_the_exit_status() {
    let folder = Folder::new("record-differs");
    let file = folder.join("run.mcap");
    record(&file);
    let rest = vec![0.0; 2];
    let states = [0, 10].map(|step| Content::State {
        step,
        position: rest.clone(),
        velocity: rest.clone(),
        effort: rest.clone(),
    });
    // Under gravity the arm does not stay at rest. It may move already when the record begins.
    write_instead(&file, &beginning(&file), states);
    let (status, said) = run(&["replay", text(&file)]);
    assert_eq!(status, Some(1), "{said}");
    let is_at = |step| said.contains(&format!(": the same up to step 0, and at step {step} (t"));
    assert!(is_at(0) || is_at(10), "{said}");
}

#[test]
fn a_record_of_another_version_is_replayed_with_a_note() {
    let folder = Folder::new("record-version");
    let file = folder.join("run.mcap");
    record(&file);
    assert!(!run(&["replay", text(&file)]).1.contains("note:"));
    let mut begin: Value = serde_json::from_str(&beginning(&file)).unwrap();
    let simulation = begin["begin"]["simulation"].clone();
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
        write_instead(&file, &begin.to_string(), [state.clone()]);
        let (status, said) = run(&["replay", text(&file)]);
        assert_eq!(status, Some(0), "{said}");
        let note = format!("; note: recorded by version {version:?}, and this is {ours:?}\n");
        assert!(said.ends_with(&note), "{said}");
    }
}

#[test]
fn an_empty_record_and_one_that_was_cut_early_are_named_as_such() {
    let folder = Folder::new("record-short");
    let file = folder.join("run.mcap");
    record(&file);
    let whole = fs::read(&file).unwrap();
    let why = "the record was cut before its first state";
    let expected = format!("pendularm: {}: {why}\n", file.display());
    for length in [0, 1, 8, 200] {
        fs::write(&file, &whole[..length]).unwrap();
        let (status, said) = run(&["replay", text(&file)]);
        assert_eq!((status, &said), (Some(1), &expected), "{length}");
    }
    let settings = RunSettings { links: 2, seed: 0 };
    let writer = McapWriter::new(File::create(&file).unwrap(), &settings).unwrap();
    writer.finish().unwrap();
    let (_, said) = run(&["replay", text(&file)]);
    assert!(said.ends_with("it has no states of an arm\n"), "{said}");
}

/// Hostile texts in a file: within a note, as a method, as an input, as a topic, as a file's name.
#[test]
fn texts_of_a_record_are_escaped_and_cut() {
    let folder = Folder::new("record-\u{1b}[31m-\u{202e}crafted");
    let file = folder.join("run.mcap");
    record(&file);
    let begin = beginning(&file);
    let hostile = "\u{1b}[2J\u{202e}\r\n\u{9b}31m".repeat(100_000);
    let words = Value::from(&*hostile).to_string();
    let note = |note| write_instead(&file, &begin, [Content::Input { step: 0, note }]);
    let topic = || {
        let mut writer = mcap::Writer::new(File::create(&file).unwrap()).unwrap();
        let definition =
            pendularm::protocol::catalog::types::full_text("std_msgs/msg/Header").unwrap();
        let schema = writer
            .add_schema("std_msgs/msg/Header", "ros2msg", definition.as_bytes())
            .unwrap();
        let channel = writer
            .add_channel(schema, &hostile, "cdr", &Default::default())
            .unwrap();
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: 0,
            log_time: 0,
            publish_time: 0,
        };
        writer.write_to_known_channel(&header, b"?").unwrap();
        writer.finish().unwrap();
    };
    let crafted: [&dyn Fn(); 5] = [
        &|| note(format!("{{{words}: 1}}")),
        &|| note(format!("{{\"method\": {words}}}")),
        &|| note(words.clone()),
        &|| note(begin.replace("\"rk4\"", &words)),
        &topic,
    ];
    for (index, craft) in crafted.iter().enumerate() {
        craft();
        let (status, said) = run(&["replay", text(&file)]);
        assert_eq!(status, Some(1), "{index}: {said:?}");
        assert!(said.len() < 2000, "{index}: {} bytes", said.len());
        let acts = |one: char| one != '\n' && (one.is_control() || one == '\u{202e}');
        assert!(
            !said.contains(acts) && said.lines().count() == 1,
            "{index}: {said:?}"
        );
        let is_named = said.contains("crafted-") && said.contains("/run.mcap: ");
        assert!(is_named, "{index}: {said}");
    }
}
