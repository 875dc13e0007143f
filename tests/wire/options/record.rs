//! A record: the options that name its file and its folder, and the command `replay`.

use super::{options, parse, refusal};
use pendularm::options::Parsed;

#[test]
fn a_run_is_recorded_into_a_file_and_replayed_from_one() {
    let given = options(&["--record", "a/run.mcap", "--record-dir=runs"]);
    assert_eq!(given.record.unwrap().to_str(), Some("a/run.mcap"));
    assert_eq!(given.record_dir.unwrap().to_str(), Some("runs"));
    match parse(&["replay", "run.mcap"]) {
        Ok(Parsed::Replay { file }) => assert_eq!(file.to_str(), Some("run.mcap")),
        other => panic!("not to be replayed: {other:?}"),
    }
    assert!(refusal(&["replay"]).contains("<FILE>"));
    let stray = refusal(&["--links=2", "replay", "run.mcap"]);
    assert!(stray.contains("--links"), "{stray}");
}
