//! A record: the options that name its file and its folder, and the command `replay`.

use super::{options, parse, refusal};
use pendularm::options::Parsed;
use tracing::level_filters::LevelFilter;

#[test]
fn a_run_is_recorded_into_a_file_and_replayed_from_one() {
    let given = options(
        &["--record", "a/run.mcap"],
        &[("ARM_SIM_RECORD_DIR", "runs")],
    );
    assert_eq!(given.record.file.unwrap().to_str(), Some("a/run.mcap"));
    assert_eq!(given.record.folder.unwrap().to_str(), Some("runs"));
    match parse(&["replay", "run.mcap"], &[("ARM_SIM_RECORD", "other")]) {
        Ok(Parsed::Replay(replay)) => assert_eq!(replay.file.to_str(), Some("run.mcap")),
        other => panic!("not to be replayed: {other:?}"),
    }
    assert!(refusal(&["replay"], &[]).contains("--help"));
    let stray = refusal(&["--links=2", "replay", "run.mcap"], &[]);
    assert!(stray.contains("--links"), "{stray}");
    assert_eq!(given.record.replay, None);
}

#[test]
fn a_record_is_served_with_the_options_of_serving_that_fit_it() {
    let given = options(
        &["replay", "run.mcap", "--serve", "--bind", "127.0.0.1:0"],
        &[
            ("ARM_SIM_LOG", "off"),
            ("ARM_SIM_LINKS", "many"),
            ("ARM_SIM_RECORD", "other"),
        ],
    );
    assert_eq!(given.record.replay.unwrap().to_str(), Some("run.mcap"));
    assert_eq!(given.record.file, None);
    assert_eq!((given.bind.port(), given.log), (0, LevelFilter::OFF));
    let other = refusal(&["replay", "run.mcap", "--serve", "--links=2"], &[]);
    assert!(other.contains("--links"), "{other}");
    let alone = refusal(&["replay", "run.mcap", "--bind", "127.0.0.1:0"], &[]);
    assert!(alone.contains("--bind without --serve"), "{alone}");
    let open = refusal(
        &["replay", "run.mcap", "--serve", "--bind", "0.0.0.0:1"],
        &[],
    );
    assert!(open.contains("loopback"), "{open}");
}
