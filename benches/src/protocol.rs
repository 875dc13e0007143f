//! The three protocols, as little of each as a publisher and a subscriber need: rosbridge JSON by line, RESP, MQTT 3.1.1. Bare
//! actors exchange the lines of pendularm.
//!
//! The load hands over millions of messages of three servers on one thread, so it looks at bytes and parses no JSON; for all else
//! there is `pendularm-client`.
//!
//! **Invariant:** the payload goes through unlooked at, and is the same bytes in all three.

/// A program that hands messages from publishers to subscribers.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Protocol {
    Pendularm,
    Redis,
    Mosquitto,
    Bare,
}

/// Something that a server has sent.
pub enum Event<'a> {
    /// A message on a topic.
    Message(&'a [u8]),
    /// A subscription holds, or an MQTT session is open.
    Ready,
    /// The answer to a [`Protocol::ask`].
    Answer,
    /// An error, as the server says it.
    Complaint(&'a [u8]),
    /// Something else.
    Other,
}

impl Protocol {
    pub const ALL: [Self; 4] = [Self::Pendularm, Self::Redis, Self::Mosquitto, Self::Bare];

    pub fn name(self) -> &'static str {
        match self {
            Self::Pendularm => "pendularm",
            Self::Redis => "redis",
            Self::Mosquitto => "mosquitto",
            Self::Bare => "bare",
        }
    }

    /// Writes the first bytes of a new connection, which `number` identifies.
    pub fn greet(self, number: usize, out: &mut Vec<u8>) {
        if self == Self::Mosquitto {
            let id = format!("load-{number}");
            let mut body = b"\x00\x04MQTT\x04\x02\x00\x00".to_vec(); // 3.1.1, clean session, no keep-alive
            string(&id, &mut body);
            packet(0x10, &body, out);
        }
    }

    /// Whether a connection has to wait for [`Event::Ready`] after its greeting.
    pub fn greets_back(self) -> bool {
        self == Self::Mosquitto
    }

    pub fn subscribe(self, topic: &str, out: &mut Vec<u8>) {
        match self {
            Self::Pendularm | Self::Bare => line(
                &format!("{{\"op\":\"subscribe\",\"topic\":\"{topic}\"}}"),
                out,
            ),
            Self::Redis => command(&[b"SUBSCRIBE", topic.as_bytes()], out),
            Self::Mosquitto => {
                let mut body = b"\x00\x01".to_vec();
                string(topic, &mut body);
                body.push(0); // QoS 0
                packet(0x82, &body, out);
            }
        }
    }

    /// Writes the opening of a publisher. Redis gets the request to answer no `PUBLISH`, because the other servers do not.
    pub fn advertise(self, topic: &str, out: &mut Vec<u8>) {
        match self {
            Self::Pendularm | Self::Bare => line(
                &format!("{{\"op\":\"advertise\",\"topic\":\"{topic}\"}}"),
                out,
            ),
            Self::Redis => command(&[b"CLIENT", b"REPLY", b"OFF"], out),
            Self::Mosquitto => {}
        }
    }

    pub fn publish(self, topic: &str, payload: &[u8], out: &mut Vec<u8>) {
        match self {
            Self::Pendularm | Self::Bare => {
                out.extend_from_slice(b"{\"op\":\"publish\",\"topic\":\"");
                out.extend_from_slice(topic.as_bytes());
                out.extend_from_slice(b"\",\"msg\":");
                out.extend_from_slice(payload);
                out.extend_from_slice(b"}\n");
            }
            Self::Redis => command(&[b"PUBLISH", topic.as_bytes(), payload], out),
            Self::Mosquitto => {
                let mut length = 2 + topic.len() + payload.len();
                out.push(0x30);
                while length >= 128 {
                    out.push((length % 128) as u8 | 128);
                    length /= 128;
                }
                out.push(length as u8);
                string(topic, out);
                out.extend_from_slice(payload);
            }
        }
    }

    /// The lightest request there is that is answered: pendularm's is a call that goes through to the arm.
    pub fn ask(self, out: &mut Vec<u8>) {
        match self {
            Self::Pendularm | Self::Bare => line(
                "{\"op\":\"call_service\",\"service\":\"/arm_sim/pause\",\"args\":{}}",
                out,
            ),
            Self::Redis => command(&[b"PING"], out),
            Self::Mosquitto => packet(0xC0, &[], out),
        }
    }

    /// The first whole event in `bytes` and how many of them it takes; `None` where more are needed.
    pub fn next(self, bytes: &[u8]) -> Option<(Event<'_>, usize)> {
        match self {
            Self::Pendularm | Self::Bare => next_line(bytes),
            Self::Redis => next_reply(bytes),
            Self::Mosquitto => next_packet(bytes),
        }
    }
}

fn line(text: &str, out: &mut Vec<u8>) {
    out.extend_from_slice(text.as_bytes());
    out.push(b'\n');
}

fn next_line(bytes: &[u8]) -> Option<(Event<'_>, usize)> {
    let end = memchr::memchr(b'\n', bytes)?;
    let line = &bytes[..end];
    let event = if line.starts_with(b"{\"op\":\"publish\"") {
        let msg = memchr::memmem::find(line, b",\"msg\":").expect("a msg");
        Event::Message(&line[msg + 7..end - 1])
    } else if line.starts_with(b"{\"op\":\"status\",\"level\":\"info\"") {
        Event::Ready
    } else if line.starts_with(b"{\"op\":\"service_response\"") {
        Event::Answer
    } else {
        Event::Complaint(line)
    };
    Some((event, end + 1))
}

/// RESP: an array of bulk strings.
fn command(words: &[&[u8]], out: &mut Vec<u8>) {
    let head = |mark: char, number: usize, out: &mut Vec<u8>| {
        out.push(mark as u8);
        out.extend_from_slice(number.to_string().as_bytes());
        out.extend_from_slice(b"\r\n");
    };
    head('*', words.len(), out);
    for word in words {
        head('$', word.len(), out);
        out.extend_from_slice(word);
        out.extend_from_slice(b"\r\n");
    }
}

fn next_reply(bytes: &[u8]) -> Option<(Event<'_>, usize)> {
    let (kind, count, mut at) = header(bytes, 0)?;
    match kind {
        b'*' => {
            let mut last: &[u8] = b"";
            let mut first: &[u8] = b"";
            for index in 0..count {
                let (kind, number, end) = header(bytes, at)?;
                at = end;
                if kind == b'$' {
                    last = bytes.get(at..at + number)?;
                    at += number + 2;
                }
                if index == 0 {
                    first = last;
                }
            }
            if at > bytes.len() {
                return None;
            }
            let event = match first {
                b"message" => Event::Message(last),
                b"subscribe" => Event::Ready,
                b"pong" => Event::Answer,
                _ => Event::Other,
            };
            Some((event, at))
        }
        b'+' => Some((Event::Answer, at)),
        b'-' => Some((Event::Complaint(&bytes[..at]), at)),
        _ => Some((Event::Other, at)),
    }
}

/// A line of RESP: its mark, its number (0 if it is a text) and where the next begins.
fn header(bytes: &[u8], at: usize) -> Option<(u8, usize, usize)> {
    let rest = bytes.get(at..)?;
    let end = rest.iter().position(|&byte| byte == b'\n')?;
    let digits = rest[1..end].iter().filter(|byte| byte.is_ascii_digit());
    let number = digits.fold(0, |number, digit| 10 * number + usize::from(digit - b'0'));
    Some((rest[0], number, at + end + 1))
}

/// MQTT: a type, a length, a body.
fn packet(kind: u8, body: &[u8], out: &mut Vec<u8>) {
    assert!(body.len() < 128, "a short packet");
    out.push(kind);
    out.push(body.len() as u8);
    out.extend_from_slice(body);
}

fn string(text: &str, out: &mut Vec<u8>) {
    out.extend_from_slice(&(text.len() as u16).to_be_bytes());
    out.extend_from_slice(text.as_bytes());
}

fn next_packet(bytes: &[u8]) -> Option<(Event<'_>, usize)> {
    let (mut length, mut at) = (0, 1);
    loop {
        let byte = *bytes.get(at)?;
        length |= usize::from(byte & 127) << (7 * (at - 1));
        at += 1;
        if byte < 128 {
            break;
        }
    }
    let body = bytes.get(at..at + length)?;
    let event = match bytes[0] >> 4 {
        2 => {
            assert_eq!(body.get(1), Some(&0), "mosquitto refuses a session");
            Event::Ready
        }
        3 => {
            let topic = usize::from(u16::from_be_bytes([body[0], body[1]]));
            Event::Message(&body[2 + topic..])
        }
        9 => {
            assert_eq!(body.get(2), Some(&0), "mosquitto refuses a subscription");
            Event::Ready
        }
        13 => Event::Answer,
        _ => Event::Other,
    };
    Some((event, at + length))
}
