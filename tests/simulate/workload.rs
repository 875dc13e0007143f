//! Requests of honest clients, and the answers that they then expect.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::protocol::outbox::MAX_TOPIC_BYTES;
use serde_json::Value;
use tokio::time::Instant;

use crate::client::Door;
use crate::court::Court;
use crate::honest::{Call, Computed, Expect, Honest, Phase, Subscription};
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
/// Together with those of hostile clients fewer than a topic may have.
const PIECE_SIZES: [usize; 7] = [64, 65, 80, 127, 128, 200, 263];
const FUNCTIONS: [&str; 4] = ["sin(t)", "-9.81", "t^2 / (1 + t)", "exp(-t) * cos(3 * t)"];
/// How long a forwarded call waits that does not say.
const DEFAULT_TIMEOUT: Duration = Duration::from_secs(10);
/// Turns after which what was sent has been handled, through the narrowest pipe.
const SETTLED: u64 = 1000;
/// Bytes of a message in a flood: as many as are read where they come.
const FLOODING: usize = 60_000;
const DAY: Duration = Duration::from_secs(24 * 3600);

/// Numbers that tell all calls and messages of a seed apart.
#[derive(Default)]
pub struct Numbers(u64);

impl Numbers {
    pub fn next(&mut self) -> u64 {
        self.0 += 1;
        self.0
    }
}

/// One client does one thing.
pub struct Desk<'a> {
    pub court: &'a Court,
    pub plan: &'a Plan,
    pub model: &'a mut Model,
    pub numbers: &'a mut Numbers,
    pub all: &'a mut [Honest],
    /// Whose turn it is.
    pub at: usize,
}

impl Desk<'_> {
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

    /// A fresh id, in every form that JSON has.
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
        let frame = match self.court.below(3) {
            0 => format!(
                "{{\"op\":\"call_service\",\"id\":{id},\"service\":\"{spelling}\",\"args\":{args}}}"
            ),
            1 => format!(
                "{{ \"args\": {args}, \"service\": \"{spelling}\", \"op\": \"call_service\", \"id\": {id} }}"
            ),
            _ => format!(
                "{{\"op\":\"call_service\",\"service\":\"{spelling}\",\"args\":{args},\"id\":{id}}}"
            ),
        };
        self.send(&frame);
        let court = self.court;
        self.court.count("calls");
        self.me()
            .note_call(&id, &format!("{spelling} {args}"), expect, is_light, court);
    }

    /// The name, now and then without its slash.
    fn spelled(&self, name: &str) -> String {
        let plain = self.court.chance(0.8);
        if plain { name } else { &name[1..] }.to_owned()
    }

    fn number(&self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.court.fraction()
    }

    fn joints(&self, low: f64, high: f64) -> String {
        let joints: Vec<f64> = (0..self.plan.links)
            .map(|_| self.number(low, high))
            .collect();
        Value::from(joints).to_string()
    }

    fn ask(&mut self) {
        let services = [
            "/arm_sim/set_params",
            "/arm_sim/set_integrator",
            "/pid_controller/enable",
            "/pid_controller/set_gains",
            "/arm_sim/pause",
        ];
        if self.court.chance(0.2) {
            let reach = 0.2 + 0.7 * self.court.fraction();
            let (y, x) = (reach * self.number(0.0, 6.0)).sin_cos();
            let reach = self.plan.links as f64 * reach;
            let (x, y) = (0.9 * reach * x, 0.9 * reach * y);
            let args = format!("{{\"x\":{x},\"y\":{y}}}");
            // Three links are asked for an orientation only where one is given.
            self.call("/ik/solve", &args, Expect::Solution { x, y }, true);
        } else {
            let args = self.court.among(&["{}", "[]", "{\"unknown\":[1,{}]}"]);
            let service = self.court.among(&services);
            self.call(service, args, Expect::Arm { is_good: true }, true);
        }
    }

    fn drive(&mut self) {
        let which = self.court.below(9);
        let (service, args) = match which {
            0 => {
                let method = self.court.among(&Method::ALL);
                (
                    "/arm_sim/set_integrator",
                    format!("{{\"method\":\"{}\"}}", method.name()),
                )
            }
            1 => {
                let step = self
                    .court
                    .among(&["0.001", "5e-4", "0.002", "0.004", "1.5e-3"]);
                (
                    "/arm_sim/set_integrator",
                    format!("{{\"timestep\":{step}}}"),
                )
            }
            2 => (
                "/arm_sim/set_params",
                format!("{{\"gravity\":{}}}", self.number(0.0, 12.0)),
            ),
            3 => (
                "/arm_sim/pause",
                format!("{{\"data\":{}}}", self.court.chance(0.4)),
            ),
            4 => (
                "/arm_sim/step",
                format!("{{\"steps\":{}}}", 1 + self.court.below(300)),
            ),
            5 => {
                let (effort, duration) = (self.joints(-20.0, 20.0), self.number(0.01, 0.5));
                (
                    "/arm_sim/disturb",
                    format!("{{\"effort\":{effort},\"duration\":{duration}}}"),
                )
            }
            6 => (
                "/pid_controller/enable",
                format!("[{}]", self.court.chance(0.7)),
            ),
            7 => {
                let (kp, kd) = (self.joints(50.0, 300.0), self.joints(5.0, 20.0));
                (
                    "/pid_controller/set_gains",
                    format!("{{\"kp\":{kp},\"kd\":{kd}}}"),
                )
            }
            _ => ("/arm_sim/reset", "{}".to_owned()),
        };
        // The goal's owner hears of a reset before its caller does.
        self.call(service, &args, Expect::Arm { is_good: true }, true);
    }

    fn setpoint(&mut self) {
        let positions = self.joints(-2.0, 2.0);
        let frame = format!(
            "{{\"op\":\"publish\",\"topic\":\"/joint_trajectory\",\"msg\":{{\"points\":[{{\"positions\":{positions}}}]}}}}"
        );
        self.send(&frame);
    }

    /// Some JSON that must arrive as it is.
    fn payload(&self, depth: usize) -> String {
        match self.court.below(if depth > 2 { 6 } else { 9 }) {
            0 => "null".to_owned(),
            1 => self
                .court
                .among(&["0", "-0.0", "1.50", "12345678901234567", "1e5", "-2.5E-3"])
                .to_owned(),
            2 => self
                .court
                .among(&[
                    "\"\"",
                    "\"a b\"",
                    "\"\\u00e9\\n\"",
                    "\"\u{e9}\u{1f600}\"",
                    "\"}{][,:\"",
                ])
                .to_owned(),
            3 => "true".to_owned(),
            4 => format!(
                "\"{}\"",
                "x".repeat(
                    self.court
                        .below(if self.plan.room < 1000 { 60 } else { 3000 })
                )
            ),
            5 => format!(
                "[{},{},{}]",
                self.number(-1.0, 1.0),
                self.number(-1e9, 1e9),
                self.court.below(9)
            ),
            6 => "{}".to_owned(),
            7 => format!("[{},{}]", self.payload(depth + 1), self.payload(depth + 1)),
            _ => format!(
                "{{\"a\":{},\"b c\":{}}}",
                self.payload(depth + 1),
                self.payload(depth + 1)
            ),
        }
    }

    fn publish(&mut self) {
        let topic = self.court.among(&TOPICS);
        self.advertise(topic);
        let count = self.court.among(&[1, 2, 6, 40]);
        self.publish_on(topic, count, |desk| desk.payload(0));
    }

    fn advertise(&mut self, topic: &str) {
        if self.me().advertised.insert(topic.to_owned()) {
            let spelling = self.spelled(topic);
            self.send(&format!(
                "{{\"op\":\"advertise\",\"topic\":\"{spelling}\"}}"
            ));
        }
    }

    /// So many messages on a topic that this client advertises.
    pub fn publish_on(&mut self, topic: &str, count: usize, payload: impl Fn(&Self) -> String) {
        let (who, link) = (self.me().who, self.me().is_active());
        for _ in 0..count {
            let (number, more) = (self.numbers.next(), payload(self));
            let body = format!("{{\"from\":{who},\"number\":{number},\"more\":{more}}}");
            let spelling = self.spelled(topic);
            let frame = match self.court.below(4) {
                0 => format!(
                    "{{\"op\":\"publish\",\"id\":\"m{number}\",\"topic\":\"{spelling}\",\"msg\":{body}}}"
                ),
                _ => format!("{{\"op\":\"publish\",\"topic\":\"{spelling}\",\"msg\":{body}}}"),
            };
            let size = if self.plan.room < 1000 {
                0
            } else {
                self.court.below(20)
            };
            if size == 1 && body.len() > 200 {
                let style = self.style();
                self.me().send_pieces(&frame, 150, style);
            } else {
                self.court.note("sends", frame.as_bytes());
                if self.plan.together {
                    // Line behind line they go through as one.
                    self.me().send_with_next(&frame);
                } else {
                    self.me().send(&frame, 0);
                }
            }
            let message = Message {
                topic: topic.to_owned(),
                publisher: who,
                body,
            };
            self.model.messages.insert(number, message);
            let order = self.me().frames;
            self.me().published.insert(number, order);
            self.court.count("messages published");
            for other in self.all.iter_mut() {
                for one in other
                    .subscriptions
                    .values_mut()
                    .filter(|one| one.topic == topic)
                {
                    let is_on = one.phase == Phase::On && link;
                    let must = is_on && one.throttle.is_none();
                    one.pending
                        .entry(who)
                        .or_default()
                        .push_back((number, must));
                    if is_on {
                        one.newest.insert(who, number);
                    }
                }
            }
        }
        self.me().flush();
    }

    /// One message, on a topic whose messages are throttled for somebody, if there is such; gives the least time between two.
    pub fn stream(&mut self) -> Duration {
        let subscriptions = self.all.iter().flat_map(|one| one.subscriptions.values());
        let throttled = subscriptions
            .filter_map(|one| one.throttle.map(|interval| (interval, one.topic.clone())))
            .max();
        let (interval, topic) =
            throttled.unwrap_or_else(|| (Duration::from_millis(20), TOPICS[0].to_owned()));
        self.advertise(&topic);
        self.publish_on(&topic, 1, |desk| desk.payload(0));
        interval
    }

    /// More than an outbox holds, for another client that subscribes to it; gives that one's place.
    pub fn flood(&mut self) -> Option<usize> {
        // A thousand pieces of each of its messages would take all the time there is, and hostile clients ask for pieces on one topic.
        let subscriptions = self.all.iter().flat_map(|one| one.subscriptions.values());
        let in_pieces: Vec<&str> = subscriptions
            .filter(|one| one.is_in_pieces)
            .map(|one| one.topic.as_str())
            .chain([TOPICS[1]])
            .collect();
        let listens = |(place, one): (usize, &Honest)| {
            let mut all = one.subscriptions.values();
            let plain = all.find(|one| {
                let is_on = one.phase == Phase::On && one.throttle.is_none();
                is_on && !in_pieces.contains(&one.topic.as_str())
            })?;
            (place != self.at && one.is_active()).then(|| (place, plain.topic.clone()))
        };
        let (deaf, topic) = self.all.iter().enumerate().find_map(listens)?;
        // Nobody takes so much at once: some of it may be dropped for those who read, too, and has to be counted.
        for one in self.all.iter_mut() {
            let mut all = one.subscriptions.values();
            one.is_hampered |= all.any(|one| one.topic == topic);
        }
        self.advertise(&topic);
        self.court.count("floods");
        let long = format!("\"{}\"", "x".repeat(FLOODING));
        self.publish_on(&topic, 3 * MAX_TOPIC_BYTES / 2 / FLOODING, |_| long.clone());
        Some(deaf)
    }

    fn subscribe(&mut self, feature: Feature) {
        let topic = self.court.among(&TOPICS);
        let spelling = self.spelled(topic);
        let door = self.me().door;
        let is_binary = feature == Feature::Cbor && door == Door::Socket;
        let throttle = (feature == Feature::Throttle)
            .then(|| Duration::from_millis(20 + self.court.below(300) as u64));
        let known = self.me().subscriptions.get(&spelling);
        let differs = known.is_some_and(|one| {
            one.is_binary != is_binary || one.throttle != throttle || one.phase != Phase::On
        });
        let is_new = known.is_none();
        if differs {
            return;
        }
        let mut frame = format!("{{\"op\":\"subscribe\",\"topic\":\"{spelling}\"");
        if let Some(interval) = throttle {
            let queue = self.court.below(4);
            frame += &format!(
                ",\"throttle_rate\":{},\"queue_length\":{queue}",
                interval.as_millis()
            );
        }
        if feature == Feature::Pieces {
            frame += &format!(",\"fragment_size\":{}", self.court.among(&PIECE_SIZES));
        }
        if is_binary {
            frame += ",\"compression\":\"cbor\"";
        }
        self.send(&(frame + "}"));
        self.me().await_news(format!("subscribed to {spelling}"));
        if !is_new {
            return;
        }
        let pending = self.under_way(topic);
        let subscription = Subscription {
            topic: topic.to_owned(),
            phase: Phase::Asked,
            throttle,
            is_binary,
            is_in_pieces: feature == Feature::Pieces,
            pending,
            last: None,
            last_from: None,
            newest: Default::default(),
        };
        self.me().subscriptions.insert(spelling, subscription);
    }

    /// Messages on a topic that were sent already, and may not have been handled yet.
    fn under_way(&self, topic: &str) -> BTreeMap<u64, VecDeque<(u64, bool)>> {
        let mut pending: BTreeMap<u64, VecDeque<(u64, bool)>> = BTreeMap::new();
        for (number, message) in &self.model.messages {
            let publisher = self.all.iter().find(|one| one.who == message.publisher);
            let order = publisher.and_then(|one| Some((one.published.get(number)?, one.handled)));
            if message.topic == topic && order.is_none_or(|(order, handled)| *order >= handled) {
                pending
                    .entry(message.publisher)
                    .or_default()
                    .push_back((*number, false));
            }
        }
        pending
    }

    fn unsubscribe(&mut self) {
        let spellings: Vec<String> = self.me().subscriptions.keys().cloned().collect();
        if spellings.is_empty() {
            return;
        }
        let spelling = self.court.among(&spellings);
        self.send(&format!(
            "{{\"op\":\"unsubscribe\",\"topic\":\"{spelling}\"}}"
        ));
        let order = self.me().frames;
        if let Some(one) = self.me().subscriptions.get_mut(&spelling)
            && !matches!(one.phase, Phase::Leaving(_))
        {
            one.phase = Phase::Leaving(order);
            one.pending
                .values_mut()
                .flatten()
                .for_each(|(_, must)| *must = false);
        }
    }

    fn provide(&mut self) {
        let service = self.court.among(&SERVICES);
        let spelling = self.spelled(service);
        self.send(&format!(
            "{{\"op\":\"advertise_service\",\"service\":\"{spelling}\",\"type\":\"x/Y\"}}"
        ));
        self.me()
            .await_news(format!("advertised service {spelling}"));
        let (provider, changed) = (Some(self.me().who), self.court.turns.get());
        let provided = self.model.services.entry(service.to_owned()).or_default();
        let is_other = provided.provider.is_some_and(|one| Some(one) != provider);
        let is_recent = provided.changed + SETTLED > changed;
        provided.is_contested = is_recent && (is_other || provided.is_contested);
        provided.provider = provider;
        provided.is_confirmed = false;
        provided.changed = changed;
    }

    fn withdraw(&mut self) {
        let who = self.me().who;
        let mine: Vec<String> = self
            .model
            .services
            .iter()
            .filter(|(_, one)| one.provider == Some(who))
            .map(|(name, _)| name.clone())
            .collect();
        if let Some(service) = mine.first() {
            // Another may have become the provider on the way.
            self.me().mistakes += 1;
            self.send(&format!(
                "{{\"op\":\"unadvertise_service\",\"service\":\"{service}\"}}"
            ));
            let changed = self.court.turns.get();
            self.model.services.insert(
                service.clone(),
                crate::model::Provided {
                    changed,
                    ..Default::default()
                },
            );
        }
    }

    fn call_out(&mut self) {
        let service = self.court.among(&SERVICES);
        let spelling = self.spelled(service);
        let (number, more) = (self.numbers.next(), self.payload(0));
        let args = format!("{{\"call\":{number},\"more\":{more}}}");
        let (text, timeout) = self.court.among(&[
            ("", DEFAULT_TIMEOUT),
            (",\"timeout\":0.05", Duration::from_millis(50)),
            (",\"timeout\":2", Duration::from_secs(2)),
            (",\"timeout\":86400", DAY),
        ]);
        let id = self.id();
        self.send(&format!(
            "{{\"op\":\"call_service\",\"id\":{id},\"service\":\"{spelling}\"{text},\"args\":{args}}}"
        ));
        let forward = Forward {
            service: absolute(service),
            args: args.clone(),
            since: Instant::now(),
            turns: self.court.turns.get(),
            timeout,
            answered: None,
            heard_by: None,
            orphaned: None,
        };
        self.model.forwards.insert(number, forward);
        self.court.count("calls to clients");
        let court = self.court;
        self.me().note_call(
            &id,
            &format!("{spelling} {args}"),
            Expect::Forwarded(number),
            false,
            court,
        );
    }

    fn compute(&mut self) {
        let method = self.court.below(Method::ALL.len());
        let name = Method::ALL[method].name();
        match self.court.below(40) {
            0 => self.compute_long(),
            1..16 => {
                let q0: Vec<f64> = (0..self.plan.links)
                    .map(|_| self.number(-1.0, 1.0))
                    .collect();
                let (duration, timestep) = (self.number(0.1, 1.0), 0.005);
                let samples = 2 + self.court.below(40) as u64;
                let arm = Arm::<3>::default();
                let (masses, lengths) = (
                    &arm.masses()[..self.plan.links],
                    &arm.lengths()[..self.plan.links],
                );
                let gravity = arm.gravity();
                let params =
                    serde_json::json!({"gravity": gravity, "masses": masses, "lengths": lengths});
                let q = Value::from(q0.clone());
                let args = format!(
                    "{{\"q0\":{q},\"duration\":{duration},\"timestep\":{timestep},\"integrator\":\"{name}\",\"params\":{params},\"samples\":{samples}}}"
                );
                let computed = Computed::Rollout {
                    q0,
                    duration,
                    timestep,
                    method,
                    samples,
                };
                self.call("/study/rollout", &args, Expect::Computed(computed), false);
            }
            _ => {
                let function = self.court.among(&FUNCTIONS);
                let (x0, dt) = (self.number(-1.0, 1.0), self.number(0.001, 0.1));
                let steps = 1 + self
                    .court
                    .below(if self.plan.room < 1000 { 20 } else { 1500 })
                    as u64;
                let args = format!(
                    "{{\"function\":\"{function}\",\"x0\":{x0},\"dt\":{dt},\"steps\":{steps},\"integrator\":\"{name}\"}}"
                );
                let computed = Computed::Particle {
                    function,
                    x0,
                    dt,
                    steps,
                    method,
                };
                self.call(
                    "/arm_sim/integration_step",
                    &args,
                    Expect::Computed(computed),
                    false,
                );
            }
        }
    }

    /// The longest of all that clients compute: others' computations have their turns beside it.
    pub fn compute_long(&mut self) {
        let args = "{\"params\":{\"gravity\":9.81}}";
        let expect = Expect::Member("advised_timestep");
        self.call("/study/stability", args, expect, false);
    }

    fn target(&self) -> String {
        let reach = self.plan.links as f64 * 0.7;
        let (y, x) = self.number(0.0, 6.0).sin_cos();
        let reach = reach * self.number(0.5, 1.0);
        format!("{{\"x\":{},\"y\":{}}}", reach * x, reach * y)
    }

    fn action(&mut self) {
        let goals = self.me().calls.iter();
        let goals: Vec<String> = goals
            .filter(|(_, call)| matches!(call.expect, Expect::Goal { .. }))
            .map(|(id, _)| id.clone())
            .collect();
        if !goals.is_empty() && self.court.chance(0.4) {
            let id = self.court.among(&goals);
            if let Some(goal) = self.me().calls.get_mut(&id) {
                goal.is_cancelled = true;
            }
            return self.cancel(&id);
        }
        let (id, args, has_feedback) = (self.id(), self.target(), self.court.chance(0.5));
        self.send(&format!(
            "{{\"op\":\"send_action_goal\",\"action\":\"/ik_action\",\"action_type\":\"pendularm_interfaces/action/MoveTo\",\
             \"args\":{args},\"feedback\":{has_feedback},\"id\":{id}}}"
        ));
        let court = self.court;
        let expect = Expect::Goal { has_feedback };
        self.me()
            .note_call(&id, &format!("/ik_action {args}"), expect, false, court);
    }

    fn cancel(&mut self, id: &str) {
        // It may have ended meanwhile.
        self.me().mistakes += 1;
        self.send(&format!(
            "{{\"op\":\"cancel_action_goal\",\"action\":\"/ik_action\",\"id\":{id}}}"
        ));
    }

    /// Asks for the end of a goal that another client has sent, which must not end it.
    pub fn cancel_anothers(&mut self) {
        let who = self.me().who;
        let others = self.all.iter().filter(|one| one.who != who);
        let goals: Vec<String> = others
            .flat_map(|one| &one.calls)
            .filter(|(_, call)| matches!(call.expect, Expect::Goal { .. }))
            .map(|(id, _)| id.clone())
            .collect();
        if !goals.is_empty() {
            let id = self.court.among(&goals);
            self.cancel(&id);
        }
    }

    fn goal(&mut self) {
        if self.court.chance(0.3) {
            // This ends the active goal, whosever it is.
            self.model.ends_any_goal = true;
            return self.call("/ik_action/cancel_goal", "{}", Expect::Anything, true);
        }
        let args = self.target();
        self.call("/ik_action/send_goal", &args, Expect::Anything, true);
    }

    fn trial(&mut self) {
        let (service, args) = self.court.among(&[
            ("/ik_trial/start", "{\"duration\":5}"),
            ("/ik_trial/skip", "{}"),
            ("/ik_trial/stop", "{}"),
        ]);
        self.call(service, args, Expect::Anything, true);
    }

    fn watch(&mut self) {
        let topic = self.court.among(&WATCHED);
        if self.me().watched.insert(topic.to_owned()) {
            self.me().await_news(format!("subscribed to {topic}"));
            return self.send(&format!("{{\"op\":\"subscribe\",\"topic\":\"{topic}\"}}"));
        }
        // Messages on their way may still come: they stay on the list of what may be heard.
        self.send(&format!("{{\"op\":\"unsubscribe\",\"topic\":\"{topic}\"}}"));
    }

    fn rosapi(&mut self) {
        let (service, args, member) = self.court.among(&[
            ("/rosapi/get_time", "{}", "time"),
            ("/rosapi/topics", "{}", "topics"),
            ("/rosapi/services", "{}", "services"),
            ("/rosapi/nodes", "{}", "nodes"),
            ("/rosapi/topic_type", "{\"topic\":\"/clock\"}", "type"),
            ("/rosapi/get_param", "{\"name\":\"gravity\"}", "value"),
            (
                "/rosapi/set_param",
                "{\"name\":\"gravity\",\"value\":\"9.5\"}",
                "successful",
            ),
            ("/rosapi/get_param_names", "{}", "names"),
            ("/rosapi/publishers", "{\"topic\":\"/t0\"}", "publishers"),
        ]);
        self.call(service, args, Expect::Member(member), true);
    }

    fn mistake(&mut self) {
        let call = match self.court.below(5) {
            0 => Some(("/nobody/serves", "{}", Expect::Refusal)),
            1 => Some((
                "/arm_sim/set_params",
                "{\"gravity\":-1}",
                Expect::Arm { is_good: false },
            )),
            2 => Some(("/ik/solve", "{\"x\":1e9,\"y\":0}", Expect::Refusal)),
            3 => Some((
                "/arm_sim/integration_step",
                "{\"function\":\"sin(\"}",
                Expect::Refusal,
            )),
            _ => None,
        };
        if let Some((service, args, expect)) = call {
            let is_light = service != "/arm_sim/integration_step";
            return self.call(service, args, expect, is_light);
        }
        let frame = self.court.among(&[
            "{\"op\":\"no_such_op\"}",
            "{\"op\":\"publish\",\"topic\":7,\"msg\":{}}",
            "{\"op\":\"publish\",\"topic\":\"/clock\",\"msg\":{}}",
            "{\"op\":\"subscribe\"}",
            "{\"op\":[1,2}",
        ]);
        self.me().mistakes += 1;
        self.court.note("sends", frame.as_bytes());
        self.me().send(frame, 0);
    }

    fn in_fragments(&mut self) {
        let id = self.id();
        let frame = format!(
            "{{\"op\":\"call_service\",\"id\":{id},\"service\":\"/pid_controller/enable\",\"args\":{{}}}}"
        );
        let (size, style) = (8 + self.court.below(60), self.style());
        self.court.note("sends in pieces", frame.as_bytes());
        self.me().send_pieces(&frame, size, style);
        let court = self.court;
        let expect = Expect::Arm { is_good: true };
        self.me()
            .note_call(&id, "/pid_controller/enable {}", expect, true, court);
    }

    /// Decides about the calls that this client has heard as a provider.
    pub fn answer_calls(&mut self) {
        let who = self.me().who;
        let asked: Vec<_> = self
            .model
            .asked
            .extract_if(.., |one| one.provider == who)
            .collect();
        for one in asked {
            let delay = match self.court.below(5) {
                0 => continue,
                1 => Duration::from_millis(self.court.below(3000) as u64),
                _ => Duration::ZERO,
            };
            let (result, values) = (self.court.chance(0.9), self.payload(0));
            let (id, service) = (one.id, one.service);
            let frame = format!(
                "{{\"op\":\"service_response\",\"id\":{id},\"service\":\"{service}\",\"values\":{values},\"result\":{result}}}"
            );
            let due = Instant::now() + delay;
            self.me().owed.push((due, one.number, frame));
            if let Some(forward) = self.model.forwards.get_mut(&one.number) {
                forward.answered = Some((due, result, values));
            }
        }
        let now = Instant::now();
        let due: Vec<_> = self
            .me()
            .owed
            .extract_if(.., |(due, ..)| *due <= now)
            .collect();
        for (_, number, frame) in due {
            // Its caller may have been told already that it took too long, or may be gone.
            let is_late = self
                .model
                .forwards
                .get(&number)
                .is_none_or(|one| one.since + one.timeout <= now);
            if is_late {
                self.me().mistakes += 1;
            }
            self.send(&frame);
        }
    }
}

/// All that a client still waits for, in words.
pub fn waits(honest: &Honest) -> String {
    let call = |(id, call): (&String, &Call)| {
        format!(
            "{:.80} (id {id}, for {:?})",
            call.what,
            call.since.elapsed()
        )
    };
    let mut all: Vec<String> = honest.calls.iter().map(call).collect();
    all.extend(honest.news.keys().map(|one| format!("news: {one}")));
    format!("client {}: {}", honest.who, all.join("; "))
}
