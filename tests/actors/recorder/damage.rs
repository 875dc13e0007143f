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
            Ok(verdict) => {
                assert_eq!(verdict.difference, None, "byte {at}");
                refused += u32::from(verdict.fault.is_some());
            }
            Err(_) => refused += 1,
        }
    }
    assert!(refused > 50, "{refused} of 100");
    assert!(matches!(
        Recording::new(&b"no record at all"[..]).next_passage(),
        Err(ReadError::Mcap(_))
    ));
}

#[test]
fn a_record_whose_end_was_lost_has_its_verdict_up_to_there_and_the_fault() {
    let entries = in_virtual_time(random_run::<2>(3));
    let whole = file(&entries);
    let all = replay(&*whole).unwrap();
    for byte in [0, 0xff, b'x'] {
        for eighths in 4..8 {
            let mut damaged = whole.clone();
            damaged[whole.len() * eighths / 8..].fill(byte);
            let verdict = replay(&*damaged).unwrap();
            let says = verdict.to_string();
            assert!(verdict.states > 0 && verdict.states < all.states, "{says}");
            assert_eq!(verdict.difference, None);
            // Zeros are records of an unknown kind, and other bytes a length beyond the file: both have no proper end.
            assert!(says.contains("read up to"), "{says}");
        }
    }
}

#[test]
fn compressed_chunks_are_named() {
    let file = file(&in_virtual_time(random_run::<2>(4)));
    // A chunk has its two times, its length and its checksum, then the name of its compression, which is empty here.
    let name = file.windows(9).position(|bytes| bytes[0] == 6).unwrap() + 9 + 28;
    let mut compressed = file.clone();
    assert_eq!(compressed[name..name + 4], [0; 4]);
    compressed[name] = 4;
    compressed.splice(name + 4..name + 4, *b"zstd");
    let length: [u8; 8] = file[name - 36..name - 28].try_into().unwrap();
    let length = u64::from_le_bytes(length) + 4;
    compressed[name - 36..name - 28].copy_from_slice(&length.to_le_bytes());
    let why = replay(&*compressed).unwrap_err().to_string();
    assert!(
        why.starts_with("its messages are compressed (zstd)"),
        "{why}"
    );
}
