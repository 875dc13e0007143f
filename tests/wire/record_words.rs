//! Records that are too short for a replay, and records with hostile texts.

use std::fs::{self, File};

use pendularm::record::{Content, INPUTS, McapWriter, RecordEntry, RunSettings};
use serde_json::{Value, json};

use crate::common::Runtime;
use crate::folder::Folder;
use crate::record::{end, passages, run, text};

#[test]
fn an_empty_record_and_one_that_was_cut_early_are_named_as_such() {
    let folder = Folder::new("record-short");
    let file = folder.join("run.mcap");
    let runtime = Runtime::with(&["--record", text(&file)]);
    runtime
        .connect()
        .ask("/arm_sim/pause", json!({"data": true}));
    end(runtime);
    let whole = fs::read(&file).unwrap();
    for (length, why) in [
        (0, "the record was cut before its first state"),
        (1, "the record was cut before its first state"),
        (8, "the record was cut before its first state"),
        (200, "the record was cut before its first state"),
    ] {
        fs::write(&file, &whole[..length]).unwrap();
        let (status, said) = run(&["replay", text(&file)]);
        let expected = format!("pendularm: {}: {why}\n", file.display());
        assert_eq!((status, said), (Some(1), expected), "{length}");
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
    let runtime = Runtime::with(&["--record", text(&file)]);
    runtime
        .connect()
        .ask("/arm_sim/pause", json!({"data": true}));
    end(runtime);
    let first = passages(&file)
        .0
        .into_iter()
        .find(|one| one.topic == INPUTS);
    let begin = first.unwrap().msg.unwrap()["input"]
        .as_str()
        .unwrap()
        .to_owned();
    let hostile = "\u{1b}[2J\u{202e}\r\n\u{9b}31m".repeat(100_000);
    let words = Value::from(&*hostile).to_string();
    let note = |note: String| {
        let file = File::create(&file).unwrap();
        let mut writer = McapWriter::new(file, &RunSettings { links: 2, seed: 0 }).unwrap();
        for note in [begin.clone(), note] {
            let content = Content::Input { step: 0, note };
            writer
                .write(&RecordEntry {
                    log_time: 0,
                    content,
                })
                .unwrap();
        }
        writer.finish().unwrap();
    };
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
