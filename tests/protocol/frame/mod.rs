//! Bytes into frames.
//!
//! **Invariant:** every check of a stream is repeated for every way to cut it.

mod limits;
mod lines;
mod messages;
mod opening;
mod properties;

use pendularm::protocol::wire::frame::{FrameError, FrameReader};

type Outcome = Result<String, FrameError>;

/// All outcomes of a stream that arrives in these pieces.
fn read<'a>(pieces: impl IntoIterator<Item = &'a [u8]>) -> Vec<Outcome> {
    let mut reader = FrameReader::new();
    let mut outcomes = Vec::new();
    for piece in pieces {
        reader.push(piece);
        outcomes.extend(reader.by_ref().map(|found| found.map(|frame| frame.text)));
    }
    outcomes.extend(reader.finish().map(Err));
    outcomes
}

/// The outcomes of a stream that arrives at once. They must equal those of the same stream byte by byte.
fn outcomes(stream: &[u8]) -> Vec<Outcome> {
    let whole = read([stream]);
    assert_eq!(read(stream.chunks(1)), whole, "cut into single bytes");
    whole
}

fn frame(text: &str) -> Outcome {
    Ok(text.to_owned())
}

fn nested(levels: usize) -> String {
    let inner = levels - 1;
    format!("{{\"a\":{}{}}}", "[".repeat(inner), "]".repeat(inner))
}
