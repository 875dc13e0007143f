//! Records that were cut or damaged.

use super::*;
use pendularm::record::ReadError;

#[test]
fn a_record_that_was_cut_anywhere_is_read_up_to_there() {
    let entries = in_virtual_time(random_run::<2>(1));
    let file = file(&entries);
    let (all, ending) = passages(&file);
    assert_eq!((all.len(), ending), (entries.len(), RecordEnding::Whole));
    let mut longest = 0;
    for length in (0..file.len()).step_by(997) {
        let (part, ending) = passages(&file[..length]);
        assert_eq!(
            ending,
            RecordEnding::Truncated,
            "{length} of {}",
            file.len()
        );
        assert_eq!(part[..], all[..part.len()]);
        assert!(part.len() >= longest);
        longest = part.len();
        match replay(&file[..length]) {
            Ok(verdict) => {
                assert_eq!(verdict.difference, None);
                let says = verdict.to_string();
                assert!(says.ends_with("the file ends early, and was read up to there"));
            }
            Err(why) => assert_eq!(why.to_string(), "the record was cut before its first state"),
        }
    }
    assert!(longest > all.len() * 9 / 10, "{longest} of {}", all.len());
    let empty = replay(&*self::file(&[])).expect_err("nothing to replay");
    assert!(empty.to_string().ends_with("it has no states of an arm"));
}

#[test]
fn a_record_that_was_damaged_is_no_proof_of_a_difference() {
    let entries = in_virtual_time(random_run::<2>(2));
    let file = file(&entries);
    let mut rng = fastrand::Rng::with_seed(9);
    let mut refused = 0;
    for _ in 0..100 {
        let mut damaged = file.clone();
        let at = rng.usize(..file.len());
        damaged[at] ^= 1 << rng.u32(..8);
        match replay(&*damaged) {
            // A bit of the index at the end, which is not needed.
            Ok(verdict) => assert_eq!(verdict.difference, None, "byte {at}"),
            Err(_) => refused += 1,
        }
    }
    assert!(refused > 50, "{refused} of 100");
    assert!(matches!(
        Recording::new(&b"no record at all"[..]).next_passage(),
        Err(ReadError::Mcap(_))
    ));
}
