//! Any stream, split anywhere. The fuzz target `frame` compares the reader with a slow model of the rules.

use proptest::prelude::*;

use super::{nested, read};

/// Streams in which the characters that matter to the reader are frequent.
fn stream() -> impl Strategy<Value = Vec<u8>> {
    let bits = prop_oneof![
        8 => proptest::sample::select(vec![
            "{", "}", "[", "]", "\"", "\\", "\n", "\r\n", " ", ",", ":", "1", "a", "é", "{}", "{\"a\":1}", "\"x\"",
        ]).prop_map(|text| text.as_bytes().to_vec()),
        1 => Just(b"{\"op\":\"publish\",\"topic\":\"/x\",\"msg\":{\"data\":[1.5,-2,\"}\\\"\"]}}\n".to_vec()),
        1 => (100_usize..150).prop_map(|levels| nested(levels).into_bytes()),
        1 => (100_usize..150).prop_map(|levels| "[".repeat(levels).into_bytes()),
        1 => (100_usize..150).prop_map(|levels| "]".repeat(levels).into_bytes()),
        1 => any::<u8>().prop_map(|byte| vec![byte]),
    ];
    proptest::collection::vec(bits, 0..60).prop_map(|bits| bits.concat())
}

/// Splits a stream at the given places that are within it.
fn cut<'a>(stream: &'a [u8], cuts: &[prop::sample::Index]) -> Vec<&'a [u8]> {
    let mut ends: Vec<usize> = cuts.iter().map(|cut| cut.index(stream.len() + 1)).collect();
    ends.push(stream.len());
    ends.sort_unstable();
    let starts = std::iter::once(0).chain(ends.iter().copied());
    starts
        .zip(&ends)
        .map(|(start, &end)| &stream[start..end])
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn any_split_gives_the_same_frames(
        stream in stream(),
        cuts in proptest::collection::vec(any::<prop::sample::Index>(), 0..12),
    ) {
        prop_assert_eq!(read(cut(&stream, &cuts)), read([&stream[..]]));
    }
}
