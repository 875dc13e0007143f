//! Requests of honest clients, and their expected answers.

mod computations;
mod providers;
mod questions;
mod topics;

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::protocol::outbox::MAX_TOPIC_BYTES;
use pendularm_client::codec::Framing;
use serde_json::Value;
use tokio::time::Instant;

use crate::court::Court;
use crate::honest::{Call, Expect, Honest, Phase, Subscription};
use crate::model::{Forward, Message, Model, absolute};
use crate::plan::{Feature, Plan};

const TOPICS: [&str; 4] = ["/t0", "/t1", "/deep/t2", "/t3"];
const SERVICES: [&str; 3] = ["/s0", "/s1", "/deep/s2"];
const WATCHED: [&str; 9] = [
    "/joint_states",
    "/clock",
    "/diagnostics",
    "/ik_action/feedback",
    "/ik_action/result",
    "/ik_trial/status",
    "/tf",
    "/robot_description",
    "/arm_sim/error_estimate",
];
/// If hostile clients have taken all places, the powers of two below count.
const PIECE_SIZES: [usize; 7] = [64, 65, 80, 127, 128, 200, 263];
const FUNCTIONS: [&str; 4] = ["sin(t)", "-9.81", "t^2 / (1 + t)", "exp(-t) * cos(3 * t)"];
/// Default timeout of a forwarded call.
const DEFAULT_TIMEOUT: Duration = Duration::from_secs(10);
/// Turns after which all sent frames have been handled, through the narrowest pipe.
const SETTLED: u64 = 1000;
/// Bytes of a message in a flood: few enough to be read on the gateway's thread.
const FLOODING: usize = 60_000;
const DAY: Duration = Duration::from_secs(24 * 3600);

/// Unique numbers for all calls and messages of a seed.
#[derive(Default)]
pub struct UniqueNumbers(u64);

impl UniqueNumbers {
    pub fn next(&mut self) -> u64 {
        self.0 += 1;
        self.0
    }
}

/// One action of one client.
pub struct Workload<'a> {
    pub court: &'a Court,
    pub plan: &'a Plan,
    pub model: &'a mut Model,
    pub numbers: &'a mut UniqueNumbers,
    pub all: &'a mut [Honest],
    /// The client whose turn it is.
    pub at: usize,
}

impl Workload<'_> {
    fn me(&mut self) -> &mut Honest {
        &mut self.all[self.at]
    }

    pub fn perform(&mut self, feature: Feature) {
        match feature {
            Feature::Ask => self.ask(),
            Feature::DriveArm => self.drive(),
            Feature::Setpoint => self.setpoint(),
            Feature::Publish => self.publish(),
            Feature::Subscribe | Feature::Throttle | Feature::Pieces | Feature::Cbor => {
                self.subscribe(feature);
            }
            Feature::Unsubscribe => self.unsubscribe(),
            Feature::Provide => self.provide(),
            Feature::Withdraw => self.withdraw(),
            Feature::CallOut => self.call_out(),
            Feature::Compute => self.compute(),
            Feature::Action => self.action(),
            Feature::Goal => self.goal(),
            Feature::Trial => self.trial(),
            Feature::Watch => self.watch(),
            Feature::Rosapi => self.rosapi(),
            Feature::Mistake => self.mistake(),
            Feature::FragmentIn => self.in_fragments(),
            Feature::Wait => {}
        }
    }

    /// A new id, of every JSON type.
    fn id(&mut self) -> String {
        let n = self.numbers.next();
        match self.court.below(10) {
            0 => n.to_string(),
            1 => format!("\"{n}\""),
            2 => format!("[{n},\"x\"]"),
            3 => format!("{{\"k\":{n},\"of\":{{}}}}"),
            4 => format!("-{n}"),
            5 => format!("{n}.50"),
            6 => format!("\"\\u00e9\\\"{n}\\\\\""),
            7 => format!("[null,true,{n}]"),
            8 => format!("\"é{n}\""),
            _ => format!("{n}e2"),
        }
    }

    fn style(&self) -> u8 {
        self.court.below(256) as u8
    }

    fn send(&mut self, frame: &str) {
        let style = self.style();
        self.court.note("sends", frame.as_bytes());
        self.me().send(frame, style);
    }

    fn call(&mut self, service: &str, args: &str, expect: Expect, is_light: bool) {
        let id = self.id();
        let spelling = self.spelled(service);
        let call = |more: String| frame("call_service", "service", &spelling, &more);
        let frame = match self.court.below(3) {
            0 => call(format!("\"args\":{args},\"id\":{id}")),
            1 => format!(
                "{{ \"args\": {args}, \"service\": \"{spelling}\", \"op\": \"call_service\", \"id\": {id} }}"
            ),
            _ => call(format!("\"id\":{id},\"args\":{args}")),
        };
        self.send(&frame);
        let court = self.court;
        self.court.count("calls");
        self.me()
            .note_call(&id, &format!("{spelling} {args}"), expect, is_light, court);
    }

    /// The name, sometimes without its slash.
    fn spelled(&self, name: &str) -> String {
        let plain = self.court.chance(0.8);
        if plain { name } else { &name[1..] }.to_owned()
    }

    fn number(&self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.court.fraction()
    }

    fn joints(&self, low: f64, high: f64) -> String {
        let joints = (0..self.plan.links).map(|_| self.number(low, high));
        Value::from(joints.collect::<Vec<f64>>()).to_string()
    }
}

/// An operation about a name, with further members or none.
pub fn frame(op: &str, member: &str, name: &str, more: &str) -> String {
    let more = if more.is_empty() {
        String::new()
    } else {
        format!(",{more}")
    };
    format!("{{\"op\":\"{op}\",\"{member}\":\"{name}\"{more}}}")
}

/// A text with all frames that a client still expects.
pub fn waits(honest: &Honest) -> String {
    let call = |(id, call): (&String, &Call)| {
        let since = call.since.elapsed();
        format!("{:.80} (id {id}, for {since:?})", call.what)
    };
    let mut all: Vec<String> = honest.calls.iter().map(call).collect();
    all.extend(honest.news.keys().map(|one| format!("news: {one}")));
    format!("client {}: {}", honest.who, all.join("; "))
}
