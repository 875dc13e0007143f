//! The message: a `JointState` as the arm itself publishes it, with a number and a time written into two of its values.
//!
//! **Invariant:** every message has the same length, and is read back as it was written.

use std::sync::OnceLock;
use std::time::Instant;

/// Digits of the number and of the time.
const DIGITS: usize = 16;
const NUMBER_MARK: &str = "\"position\":[1.";
const TIME_MARK: &str = "\"velocity\":[1.";

/// Writes messages, one after the other, into the same bytes.
pub struct Template {
    text: Vec<u8>,
    number: usize,
    time: usize,
}

/// Nanoseconds since this program's first look at its clock: monotonic, and the same for publishers and subscribers.
pub fn now() -> u64 {
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_nanos() as u64
}

impl Template {
    pub fn new() -> Self {
        let zeros = "0".repeat(DIGITS);
        let text = format!(
            "{{\"header\":{{\"stamp\":{{\"sec\":1234,\"nanosec\":516666666}},\"frame_id\":\"world\"}},\
             \"name\":[\"joint1\",\"joint2\"],{NUMBER_MARK}{zeros},-0.4123456789012345],\
             {TIME_MARK}{zeros},1.2345678901234567],\"effort\":[-3.1415926535897931,2.7182818284590452]}}"
        );
        let behind = |mark: &str| text.find(mark).expect("the mark") + mark.len();
        let (number, time) = (behind(NUMBER_MARK), behind(TIME_MARK));
        Self {
            text: text.into_bytes(),
            number,
            time,
        }
    }

    /// The message of that number, sent now.
    pub fn write(&mut self, number: u64) -> &[u8] {
        write(&mut self.text[self.number..][..DIGITS], number);
        write(&mut self.text[self.time..][..DIGITS], now());
        &self.text
    }

    /// The number in a message, and when it was sent; `None` if it is not a whole message of ours.
    pub fn read(&self, payload: &[u8]) -> Option<(u64, u64)> {
        let whole = payload.len() == self.text.len();
        whole.then(|| {
            (
                read(&payload[self.number..][..DIGITS]),
                read(&payload[self.time..][..DIGITS]),
            )
        })
    }

    pub fn length(&self) -> usize {
        self.text.len()
    }
}

fn write(digits: &mut [u8], mut value: u64) {
    for digit in digits.iter_mut().rev() {
        *digit = b'0' + (value % 10) as u8;
        value /= 10;
    }
}

fn read(digits: &[u8]) -> u64 {
    digits
        .iter()
        .fold(0, |value, digit| 10 * value + u64::from(digit - b'0'))
}

/// The stamp of a message that the arm has published \[ns\].
pub fn stamp(payload: &[u8]) -> u64 {
    let number = |key: &[u8]| {
        let at = memchr::memmem::find(payload, key).expect("a stamp");
        payload[at + key.len()..]
            .iter()
            .take_while(|byte| byte.is_ascii_digit())
            .fold(0, |value, digit| 10 * value + u64::from(digit - b'0'))
    };
    number(b"\"sec\":") * 1_000_000_000 + number(b"\"nanosec\":")
}
