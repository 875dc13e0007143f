//! Scripts: the actions of clients, drawn by the fuzzer.

use super::*;

/// One action.
#[derive(Debug, Arbitrary)]
pub enum Step<'a> {
    /// A client sends a frame.
    Do {
        client: u8,
        style: u8,
        deed: Deed<'a>,
    },
    /// A client sends a frame in pieces of this length.
    InPieces {
        client: u8,
        style: u8,
        size: u8,
        deed: Deed<'a>,
    },
    /// A client sends anything, up to the end of a line or message.
    Garbage { client: u8, bytes: &'a [u8] },
    /// A client sends any bytes.
    Noise { client: u8, bytes: &'a [u8] },
    /// This many milliseconds pass.
    Wait(u16),
    /// A client stops or continues reading.
    Pause { client: u8, paused: bool },
    /// A client ends sending, and continues to read.
    HalfClose { client: u8 },
    /// A client disconnects, and another one connects.
    Replace { client: u8, room: u8, piece: u8 },
    /// The runtime's node changes its treatment of calls.
    Behave(u8),
    /// It answers a held call.
    Release,
    /// It publishes.
    Publish { topic: u8 },
}

/// A frame, roughly.
#[derive(Debug, Arbitrary)]
pub enum Deed<'a> {
    Advertise {
        topic: u8,
    },
    Unadvertise {
        topic: u8,
    },
    Publish {
        topic: u8,
        payload: Payload<'a>,
    },
    Subscribe {
        topic: u8,
        id: Option<u8>,
        throttle_ms: Option<u16>,
        queue_length: u8,
        compression: u8,
        size: Option<u8>,
    },
    Unsubscribe {
        topic: u8,
        id: Option<u8>,
    },
    Provide {
        service: u8,
    },
    Withdraw {
        service: u8,
    },
    Call {
        service: u8,
        timeout: Option<u16>,
        args: Payload<'a>,
    },
    /// As a provider, of a call that came: the one of that number.
    Respond {
        which: u8,
        result: bool,
        values: Payload<'a>,
    },
    Level(u8),
    Goal {
        id: u8,
        args: Payload<'a>,
    },
    Cancel {
        id: u8,
    },
}

/// A JSON value, roughly.
#[derive(Debug, Arbitrary)]
pub enum Payload<'a> {
    Absent,
    Known(u8),
    Text(&'a str),
    Number(f64),
    Numbers(Vec<f64>),
    Long(u16),
    Deep(u8),
    /// To a call: every field with a value of its kind, but for those whose bit is set.
    Fitting([f64; 4], u8),
}
