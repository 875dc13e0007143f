//! Hostile clients: the known attacks on servers like this one, in sizes that suit virtual time.
//!
//! They need no answers. Honest clients must not be affected.

use std::cell::Cell;
use std::rc::Rc;

use crate::client::Client;
use crate::court::Court;
use crate::honest::Honest;
use crate::pipe::Fate;
use crate::plan::Hostility;
use crate::workload::frame;
use pendularm_client::codec::Framing;
use pendularm_client::websocket::{append, opcode};

/// A decimal that is slow to read exactly: 20 digits near the middle between two doubles.
const SLOW: &str = "10000000000000001268e281";
/// Bytes of long frames that are sent at a time. Some exceed the part that needs no permit.
const LONG: [usize; 5] = [100, 1000, 1000, 8000, 70_000];

pub struct Hostile {
    pub client: Client,
    pub fate: Rc<Cell<Fate>>,
    /// The rest of a frame that it sends byte by byte.
    dribble: Vec<u8>,
    number: u64,
}

impl Hostile {
    pub fn new(client: Client, fate: Rc<Cell<Fate>>) -> Self {
        Self {
            client,
            fate,
            dribble: Vec::new(),
            number: 0,
        }
    }

    fn say(&self, frame: &str) {
        self.client.send(frame, 0);
    }

    /// Calls a service, with further members or none.
    fn call(&self, service: &str, more: &str) {
        self.say(&frame("call_service", "service", service, more));
    }

    /// Sends an operation about a topic, with further members or none.
    fn about(&self, op: &str, topic: &str, more: &str) {
        self.say(&frame(op, "topic", topic, more));
    }

    fn raw(&self, bytes: impl Into<Vec<u8>>) {
        self.client.send_bytes(bytes.into());
    }

    fn next(&mut self) -> u64 {
        self.number += 1;
        self.number
    }

    pub fn perform(&mut self, deed: Hostility, court: &Court, honest: &[Honest]) {
        match deed {
            Hostility::SlowNumbers => {
                let numbers = slow_numbers(court.below(court.among(&LONG)));
                let points = format!("\"msg\":{{\"points\":[{{\"positions\":{numbers}}}]}}");
                let msg = format!("\"msg\":{{\"a\":{numbers}}}");
                let gains = format!("\"args\":{{\"kp\":{numbers}}}");
                self.about("advertise", "/t0", "");
                match court.below(3) {
                    0 => self.about("publish", "/t0", &msg),
                    1 => self.call("/arm_sim/set_gains", &gains),
                    _ => self.about("publish", "/joint_trajectory", &points),
                }
            }
            Hostility::LongIds => {
                let id = slow_numbers(court.below(court.among(&LONG)));
                let service =
                    court.among(&["/pid_controller/enable", "/nobody", "/rosapi/topics", "/s0"]);
                self.call(service, &format!("\"id\":{id}"));
            }
            Hostility::GoalWithLongId => {
                let id = slow_numbers(court.below(court.among(&LONG)));
                let more = format!("\"args\":{{\"x\":1,\"y\":0.5}},\"feedback\":true,\"id\":{id}");
                self.say(&frame("send_action_goal", "action", "/ik_action", &more));
            }
            Hostility::PingFlood => self.flood_pings(court),
            Hostility::Deaf => {
                for topic in ["/t0", "/t1", "/joint_states", "/tf", "/deep/t2"] {
                    self.about("subscribe", topic, "");
                }
                self.client.pause(true);
            }
            Hostility::FragmentBomb => self.bomb(court),
            Hostility::Encodings => {
                for _ in 0..1 + court.below(60) {
                    let (n, topic) = (self.next(), court.among(&["/t1", "/many_sizes"]));
                    let size = 64 + 5 * court.below(300);
                    let compression = court.among(&["none", "cbor", "cbor-raw", "png"]);
                    let more = format!(
                        "\"id\":\"{n}\",\"fragment_size\":{size},\"compression\":\"{compression}\""
                    );
                    self.about("subscribe", topic, &more);
                }
            }
            Hostility::StepByHand => {
                self.call("/arm_sim/pause", "\"args\":[true]");
                for _ in 0..court.below(4) {
                    let steps = court.among(&["1", "2000", "10000"]);
                    self.call("/arm_sim/step", &format!("\"args\":[{steps}]"));
                }
            }
            Hostility::Registrations => {
                for _ in 0..court.below(200) {
                    let name = format!("/hoard/{}", self.next());
                    let op = court.among(&["advertise", "subscribe"]);
                    self.about(op, &name, "");
                    self.say(&frame("advertise_service", "service", &name, ""));
                }
            }
            Hostility::DayLongCalls => {
                self.say(&frame("advertise_service", "service", "/never", ""));
                for _ in 0..court.below(100) {
                    self.call("/never", "\"timeout\":86400");
                }
            }
            Hostility::Unfinished => {
                let text = "x".repeat(court.below(court.among(&LONG)));
                self.raw(format!(
                    "{{\"op\":\"publish\",\"topic\":\"/t0\",\"msg\":{{\"a\":\"{text}"
                ));
            }
            Hostility::Dribble => {
                if self.dribble.is_empty() {
                    let call = frame("call_service", "service", "/arm_sim/pause", "\"args\":{}");
                    self.dribble = (call + "\n").into_bytes();
                }
                let byte = self.dribble.remove(0);
                self.raw([byte]);
            }
            Hostility::Garbage => self.garbage(court),
            Hostility::TinyTimestep => {
                let step = court.among(&["1e-9", "1e-6", "1e-300", "1e300", "0.5", "1e-3"]);
                self.call(
                    "/arm_sim/set_integrator",
                    &format!("\"args\":[\"euler\",{step}]"),
                );
                let params = court.among(&[
                    "[0,[1e-9,1e9]]",
                    "[1e300]",
                    "[9.81,[1,1],[1,1]]",
                    "{\"masses\":[1e-300,1e-300]}",
                ]);
                self.call("/arm_sim/set_params", &format!("\"args\":{params}"));
            }
            Hostility::Computations => {
                for _ in 0..court.below(20) {
                    let (rollout, step) = ("/study/rollout", "/arm_sim/integration_step");
                    let (service, args) = court.among(&[
                        (rollout, "{\"duration\":0.2}"),
                        (step, "[\"t\",0,0,1,3000,\"euler\"]"),
                        (step, "[\"sin(t)\",0,0,0.01,20000,\"rk4\"]"),
                        (
                            rollout,
                            "{\"duration\":0.3,\"reference\":true,\"samples\":50}",
                        ),
                        ("/study/stability", "[7]"),
                    ]);
                    self.call(service, &format!("\"args\":{args}"));
                }
            }
            Hostility::Impersonate => self.impersonate(court, honest),
            Hostility::Vanish => self.fate.set(court.among(&[Fate::Breaks, Fate::Panics])),
            Hostility::Silent => {}
            Hostility::Foreign => {
                let opening = court.among(&[
                    "GET / HTTP/1.1\r\nHost: 127.0.0.1:9095\r\n\r\n",
                    "GET /report/ HTTP/1.1\r\nHost: evil.example\r\n\r\n",
                    "POST / HTTP/1.1\r\n\r\n{\"op\":\"call_service\",\"service\":\"/arm_sim/reset\"}\n",
                    "\u{16}\u{3}\u{1}\u{2}\u{0}\u{1}",
                    "\r\n\r\n\r\n",
                ]);
                self.raw(opening);
            }
            Hostility::ManyCalls => {
                for _ in 0..court.below(150) {
                    let n = self.next();
                    let service = court.among(&[
                        "/rosapi/topics_and_raw_types",
                        "/rosapi/services",
                        "/pid_controller/enable",
                        "/s0",
                    ]);
                    self.call(service, &format!("\"id\":\"h{n}\""));
                }
            }
            Hostility::Throttles => {
                for _ in 0..court.below(30) {
                    let rate = court.among(&["1", "1000", "1e15", "31536000000"]);
                    let more = format!(
                        "\"id\":{},\"throttle_rate\":{rate},\"queue_length\":100000",
                        self.next()
                    );
                    self.about("subscribe", "/t0", &more);
                }
            }
        }
    }

    fn flood_pings(&self, court: &Court) {
        if self.client.framing() == Framing::WebSocket {
            self.client.pause(court.chance(0.7));
            let mut bytes = Vec::new();
            for _ in 0..court.below(2000) {
                append(&mut bytes, 0x80 | opcode::PING, [1, 2, 3, 4], &[7; 125]);
            }
            self.raw(bytes);
        }
    }

    fn bomb(&mut self, court: &Court) {
        let data = "x".repeat(court.below(2000));
        let total = court.among(&[2_u64, 4096, 5000, 1 << 40]);
        for num in 0..court.below(60) {
            let id = court.below(12);
            self.say(&format!("{{\"op\":\"fragment\",\"id\":{id},\"data\":\"{data}\",\"num\":{num},\"total\":{total}}}"));
        }
        let nested = "{\\\"op\\\":\\\"fragment\\\",\\\"id\\\":1,\\\"data\\\":\\\"\\\",\\\"num\\\":0,\\\"total\\\":1}";
        self.say(&format!(
            "{{\"op\":\"fragment\",\"id\":\"n\",\"data\":\"{nested}\",\"num\":0,\"total\":1}}"
        ));
    }

    fn garbage(&self, court: &Court) {
        let frame =
            "{\"op\":\"subscribe\",\"topic\":\"/t0\",\"id\":[1,{\"a\":null}],\"throttle_rate\":5}";
        let mut bytes = frame.as_bytes().to_vec();
        for _ in 0..1 + court.below(6) {
            let at = court.below(bytes.len());
            match court.below(3) {
                0 => bytes[at] = court.below(256) as u8,
                1 => bytes.insert(at, court.among(b"{}[]\",:\\\n\0\xff9-")),
                _ => bytes.truncate(at.max(1)),
            }
        }
        bytes.push(b'\n');
        self.raw(bytes);
    }

    fn impersonate(&self, court: &Court, honest: &[Honest]) {
        let ids = honest.iter().flat_map(|one| one.calls.keys().cloned());
        let ids: Vec<String> = ids.collect();
        let id = match ids.is_empty() {
            true => "1".to_owned(),
            false => court.among(&ids),
        };
        let guess = court.below(60);
        let answer = |id: &str, values: &str| {
            let more = format!("\"id\":{id},\"values\":{values},\"result\":true");
            self.say(&frame("service_response", "service", "/s0", &more));
        };
        answer(&format!("\"pendularm:{guess}\""), "{\"stolen\":1}");
        answer(&id, "{}");
        let goal = format!("\"id\":{id}");
        self.say(&frame("cancel_action_goal", "action", "/ik_action", &goal));
        self.say(&frame("unadvertise_service", "service", "/s0", ""));
        self.about("unadvertise", "/t0", "");
        self.about("publish", "/joint_states", "\"msg\":{\"position\":[9,9]}");
        self.about("publish", "/t0", "\"msg\":{\"from\":1,\"number\":1}");
        self.say(&frame("advertise_service", "service", "/arm_sim/reset", ""));
    }
}

/// An array of about this many bytes, of numbers that are slow to read.
fn slow_numbers(bytes: usize) -> String {
    let numbers = vec![SLOW; 1 + bytes / (SLOW.len() + 1)];
    format!("[{}]", numbers.join(","))
}
