//! The search for the fewest steps finds them, and makes a bounded number of runs.

use pendularm::study::fewest::fewest;
use pendularm::study::paused::at_once;

fn found(first: u64, most: u64, part: u64, is_enough: impl Fn(u64) -> bool) -> (Option<u64>, u32) {
    let mut runs = 0;
    let search = fewest(first, most, part, |steps| {
        runs += 1;
        is_enough(steps)
    });
    (at_once(search), runs)
}

#[test]
fn the_fewest_are_found_wherever_they_are() {
    let most = 4_000_000;
    for fewest in [1, 2, 69, 255, 256, 257, 258, 1000, 4097, most - 1, most] {
        let (best, runs) = found(1, most, u64::MAX, |steps| steps >= fewest);
        assert_eq!(best, Some(fewest));
        assert!(runs < 320, "{runs}");
    }
    for fewest in [800, 900, 4000] {
        let (best, _) = found(700, 4000, u64::MAX, |steps| steps >= fewest);
        assert_eq!(best, Some(fewest));
    }
}

#[test]
fn a_lucky_stretch_below_is_found() {
    // 69 to 77 are enough, 78 to 110 are not.
    let (best, _) = found(1, 1 << 20, u64::MAX, |steps| {
        steps >= 111 || (69..78).contains(&steps)
    });
    assert_eq!(best, Some(69));
    let (best, _) = found(1, 1 << 20, u64::MAX, |steps| {
        steps >= 11_100 || (6900..7800).contains(&steps)
    });
    assert_eq!(best, Some(6900));
    // The last number that may be taken fails, but not one before it.
    let (best, _) = found(1, 9000, u64::MAX, |steps| (6900..7800).contains(&steps));
    assert_eq!(best, Some(6900));
}

#[test]
fn nothing_is_found_if_no_number_of_steps_is_enough() {
    assert!([1000, u64::MAX].map(|most| found(1, most, 9, |_| false).0) == [None; 2]);
    assert!(found(1, 1000, 0, |steps| steps > 600).0 > Some(600));
    assert_eq!(found(11, 10, u64::MAX, |_| true), (None, 0));
}

#[test]
fn a_coarse_search_takes_fewer_runs() {
    let (best, runs) = found(300, 1 << 20, 64, |steps| steps >= 300_000);
    let best = best.unwrap();
    assert!((300_000..305_000).contains(&best), "{best}");
    assert!(runs < 40, "{runs}");
}
