//! Files that were cut or damaged, or that are no records.

use super::*;

#[test]
fn a_place_that_cannot_be_read_any_more_is_not_gone_to() {
    let entries = in_virtual_time(run());
    in_virtual_time(async {
        let show = Show::of("shrunk", &entries).await;
        let mut client = show.connect();
        let played = Path::new(env!("CARGO_TARGET_TMPDIR")).join("player-shrunk.mcap");
        let played = fs::File::options().write(true).open(played).unwrap();
        played.set_len(100).unwrap();
        let time = json!({"time": {"sec": 1, "nanosec": 0}});
        let refused = client.call("/rosbag2_player/seek", time).await;
        assert_eq!(refused["result"], false, "{refused}");
        let why = refused["status"].as_str().unwrap();
        assert!(
            why.starts_with("the record cannot be read there: "),
            "{why}"
        );
        let stands = drive(&mut client, "is_paused", json!({})).await;
        assert_eq!(stands, json!({"paused": true}));
        assert!(position(&mut client).await < 1.0);
    });
}

#[test]
fn a_record_that_was_cut_is_played_up_to_there_and_no_record_is_refused() {
    let entries = in_virtual_time(run());
    let whole = file(&entries);
    in_virtual_time(async {
        let gauges = Arc::new(Gauges::default());
        let registry = Registry::new(Arc::clone(&gauges)).start();
        let begin = |name: &str, bytes: &[u8]| {
            let path = on_disk(name, bytes);
            let thread = System::current().arbiter().clone();
            player::start(&path, &registry, &thread, &mut Nodes::default())
        };
        begin("cut", &whole[..whole.len() / 2]).unwrap();
        let refused = begin("none", b"no record at all").unwrap_err().to_string();
        assert!(
            refused.contains("player-none.mcap: not a record"),
            "{refused}"
        );
        let refused = begin("empty", &file(&[])).unwrap_err().to_string();
        assert!(refused.contains("no states of an arm"), "{refused}");
        // A bit of an index is not missed; any other is.
        let places = (100..whole.len()).step_by(whole.len() / 100);
        let refused = places.filter(|at| {
            let mut damaged = whole.clone();
            damaged[*at] ^= 1;
            begin("damaged", &damaged).is_err()
        });
        assert!(refused.count() > 50);
    });
}
