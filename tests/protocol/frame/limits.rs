//! The limits of a frame's length and nesting, and of the reader's buffer.

use pendularm::protocol::limits::{MAX_FRAME, MAX_NESTING, MEDIUM};
use pendularm::protocol::wire::frame::{FrameError, FrameReader};

use super::{frame, nested, outcomes, read};

#[test]
fn a_frame_of_exactly_the_limit_is_taken() {
    let text = format!("{{\"a\":\"{}\"}}", "x".repeat(MAX_FRAME - 8));
    assert_eq!(text.len(), MAX_FRAME);
    let stream = format!("{text}\n{{}}\n");
    // No `assert_eq!`: it would print megabytes.
    assert!(read([stream.as_bytes()]) == [frame(&text), frame("{}")]);
    assert!(read(stream.as_bytes().chunks(4093)) == [frame(&text), frame("{}")]);
}

/// Frames that exceed the limit by one byte and by many, whole and in pieces. Brackets or a newline end them. One has
/// brackets and an escaped newline in the part that is skipped. Another has a second fault after the limit.
#[test]
fn a_longer_frame_gets_one_error_and_is_skipped_to_where_it_would_have_ended() {
    let filler = |length: usize| "x".repeat(length);
    let over = MAX_FRAME - 5;
    for text in [
        format!("{{\"a\":\"{}\"}}", filler(MAX_FRAME - 7)),
        format!("{{\"a\":\"{}\"}}", filler(2 * over)),
        format!("{{\"a\":\"{}\",\"b\":[\"]}}\\\"\\n\",{{}}]}}", filler(over)),
        format!("{{\"a\":\"{}\n", filler(over)),
        format!("{{\"a\":\"{}\"]}}}}{{}}\n", filler(over)),
        format!(
            "{{\"a\":\"{}\",\"b\":{}\n",
            filler(over),
            nested(MAX_NESTING + 9)
        ),
    ] {
        let stream = text + "{\"b\":2}";
        let expected = [Err(FrameError::TooLong(MAX_FRAME)), frame("{\"b\":2}")];
        assert_eq!(read([stream.as_bytes()]), expected);
        for size in [64 * 1024, 999_983] {
            assert_eq!(
                read(stream.as_bytes().chunks(size)),
                expected,
                "pieces of {size}"
            );
        }
    }
}

#[test]
fn a_frame_that_is_too_long_is_reported_before_it_ends_and_is_not_kept() {
    let mut reader = FrameReader::new();
    let chunk = [b' '; 64 * 1024];
    reader.push(b"{");
    let mut errors = 0;
    for _ in 0..200 {
        reader.push(&chunk);
        errors += reader
            .by_ref()
            .filter(|found| *found == Err(FrameError::TooLong(MAX_FRAME)))
            .count();
    }
    assert_eq!(errors, 1);
    assert!(
        reader.buffered() <= chunk.len(),
        "{} bytes kept",
        reader.buffered()
    );
    assert_eq!(reader.finish(), None);
}

#[test]
fn an_idle_reader_gives_back_the_memory_of_a_long_frame() {
    let mut reader = FrameReader::new();
    let [long, medium] = [1_000_000, 20_000].map(|size| format!("{{\"{}\"}}", "x".repeat(size)));
    let behind = medium + &"{}".repeat(30_000);
    reader.push((long + &behind).as_bytes());
    // The first frame keeps the buffer. The others are copied out of a new one. Of that, the buffer for usual frames
    // stays, so they are read without an allocation.
    for (frames, kept) in [
        (1, behind.len()),
        (20_000, behind.len()),
        (20_000, 16 * 1024),
    ] {
        reader.by_ref().take(frames).for_each(drop);
        assert_eq!(reader.buffered(), kept);
    }
}

/// In pieces that double it, and in one that does not.
#[test]
fn a_growing_buffer_stays_within_the_bytes_that_need_no_permit() {
    let mut reader = FrameReader::new();
    for length in (4096..=MEDIUM).step_by(4096) {
        reader.push(&[b'{'; 4096]);
        let expected = length.next_power_of_two().min(MEDIUM);
        assert_eq!(reader.buffered(), expected);
    }
    let mut reader = FrameReader::new();
    for length in [MEDIUM - 1, 1] {
        reader.push(&vec![b'{'; length]);
    }
    assert_eq!(reader.buffered(), MEDIUM);
}

/// The end of a frame is never the end of the pushed bytes.
#[test]
fn finished_frames_are_not_kept_although_one_is_always_unfinished() {
    let mut reader = FrameReader::new();
    let text = format!("{{\"a\":\"{}\"}}\n", "x".repeat(1000));
    let (front, back) = text.split_at(10);
    let chunk = format!("{back}{}{front}", text.repeat(9));
    reader.push(front.as_bytes());
    for _ in 0..100 {
        assert_eq!(reader.next(), None);
        reader.push(chunk.as_bytes());
        assert_eq!(reader.by_ref().filter(Result::is_ok).count(), 10);
        // The unfinished bytes and those pushed last, twice, and the reserve of a growing buffer.
        assert!(reader.buffered() < 5 * chunk.len());
    }
}

#[test]
fn nesting_up_to_the_limit_is_taken_and_one_deeper_is_malformed() {
    let (deepest, deeper) = (nested(MAX_NESTING), nested(MAX_NESTING + 1));
    assert_eq!(outcomes(deepest.as_bytes()), [frame(&deepest)]);
    assert_eq!(
        outcomes((deeper + "{}").as_bytes()),
        [Err(FrameError::TooDeep), frame("{}")]
    );
}
