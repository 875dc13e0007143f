//! Parts of a stream that are not frames: lines that are not objects, objects with a fault, and an incomplete end. As
//! an iterator, a reader returns its decoded frames and these faults, in order.
//!
//! An object with a fault is skipped to its end, or to the newline if its brackets do not match. A line is skipped to
//! the newline.
//!
//! **Invariant:** each part is reported once: an object at its fault, a line after its first bytes. No byte after that
//! is kept.

use super::fault::{FrameError, MAX_PREFIX, Refused, not_an_object, start_of};
use super::frame::{FrameReader, ObjectEnd, ScanState};

impl FrameReader {
    /// Ends the stream, after the last frame was taken. An incomplete frame is one malformed frame.
    pub fn finish(&mut self) -> Option<FrameError> {
        let error = match self.state {
            ScanState::Object => Some(FrameError::StreamEnded),
            ScanState::Line => Some(not_an_object(self.scanned())),
            _ => None,
        };
        *self = Self::with_limit(self.limit);
        error
    }

    /// Reports an object that has a fault, or is too long.
    pub(super) fn refuse(&mut self, end: Option<ObjectEnd>, is_too_long: bool) -> Refused {
        let kept = start_of(self.scanned());
        self.state = state_after(end.as_ref());
        self.start = self.at;
        match end {
            Some(Err(error)) if !is_too_long => (error, kept),
            _ => (FrameError::TooLong(self.limit), kept),
        }
    }

    /// Continues a part that is not a frame, or that was reported. `None` if there is nothing to report yet.
    pub(super) fn scan_malformed(&mut self) -> Option<Refused> {
        if self.state == ScanState::SkippedObject {
            let end = self.scan();
            self.state = state_after(end.as_ref());
            self.start = self.at;
            return None;
        }
        let rest = self.rest();
        let newline = rest.iter().position(|&byte| byte == b'\n');
        let length = newline.unwrap_or(rest.len());
        if self.state == ScanState::SkippedLine {
            self.at += length;
            self.start = self.at;
            if newline.is_some() {
                self.state = ScanState::Between;
            }
            return None;
        }
        let wanted = MAX_PREFIX - (self.at - self.start);
        self.at += length.min(wanted);
        if newline.is_none() && length < wanted {
            return None;
        }
        let error = not_an_object(self.scanned());
        self.state = ScanState::SkippedLine;
        self.start = self.at;
        Some((error, Vec::new()))
    }
}

/// One JSON object, as text. Its syntax within the outer braces is still unchecked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// The text, as [decoded](super::frame::RawFrame::decode).
    pub text: String,
}

impl Iterator for FrameReader {
    type Item = Result<Frame, FrameError>;

    fn next(&mut self) -> Option<Result<Frame, FrameError>> {
        Some(match self.next_raw()? {
            Ok(frame) => {
                let frame = frame.decode()?.map(|text| Frame { text });
                frame.map_err(|(error, _)| error)
            }
            Err((error, _)) => Err(error),
        })
    }
}

/// The state after the scan of a reported object has stopped.
const fn state_after(end: Option<&ObjectEnd>) -> ScanState {
    match end {
        None | Some(Err(FrameError::TooDeep)) => ScanState::SkippedObject,
        Some(Err(FrameError::Mismatch { .. })) => ScanState::SkippedLine,
        Some(_) => ScanState::Between,
    }
}
