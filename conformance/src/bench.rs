//! Shared by the rules: a connection to an arm in a known state, and requests to it.
//!
//! An error is the sentence that a rule fails with. Causes: the server rejected a call, did not answer in time, sent no or a
//! malformed message, or closed the connection.
//!
//! The known state: running, PID off, `rk4` at 1 ms, gravity 9.81, links of 1 m and 1 kg, no goal, no trial, just reset.

use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::Got;
use crate::arm::{Arm, State};
use crate::method::step;
use crate::peer::{Answer, Peer, Trouble, is_message};
use crate::run::Run;
use crate::values::{boolean, largest, list, minus, must, near, number, numbers, numbers_of, set, text};

/// Standard gravity of the specification.
pub const GRAVITY: f64 = 9.81;

/// The server's answers before anything was changed.
#[derive(Debug, Clone)]
pub struct Found {
    /// How many links it has.
    pub links: usize,
    /// The answers of the services in [`SETTINGS`] to `{}`.
    settings: [Result<Value, String>; SETTINGS.len()],
    /// A message on `/joint_states`.
    pub state: Result<Joints, String>,
    /// Services of the preparation that give no answer at all; they are left out of it.
    silent: Vec<&'static str>,
}

/// Services that return settings, in the order in which these are restored.
const SETTINGS: [&str; 5] =
    ["/arm_sim/set_params", "/arm_sim/set_integrator", "/pid_controller/set_gains", "/pid_controller/enable", "/arm_sim/pause"];

/// Most messages that one look at a topic takes, so a server that floods it costs little memory.
const MOST_MESSAGES: usize = 5000;

/// Services that end a trial, a goal and a motion.
const ENDING: [&str; 3] = ["/ik_trial/stop", "/ik_action/cancel_goal", "/arm_sim/reset"];

impl Found {
    /// Asks the server at an address.
    pub fn at(address: &str, run: &Arc<Run>) -> Result<Self, String> {
        let mut bench = Bench { peer: Peer::connect(address, run)?, links: 0, found: None, is_aside: false };
        greet(&mut bench.peer, address)?;
        let params = bench.accepted("/arm_sim/set_params", &json!({}));
        let patience = run.patience;
        let state = bench.watch("/joint_states").and_then(|()| bench.message("/joint_states", patience)).and_then(|msg| Joints::read(&msg));
        let by_params = params.as_ref().ok().and_then(|values| numbers(values, "masses").ok()).map(|masses| masses.len());
        let links = by_params.or_else(|| state.as_ref().ok().map(|state| state.position.len()));
        let links = match links {
            Some(links) if links == 2 || links == 3 => links,
            Some(links) => return Err(format!("the server at {address} has {links} links; the specification has 2 or 3")),
            // A server of the checkpoint needs no arm.
            None if bench.peer.call("/arm_sim/integration_step", &json!({})).is_ok() => 2,
            None => {
                let why = params.err().unwrap_or_default();
                // It has answered the greeting.
                let closes = why.contains("closed the connection");
                let what = if closes { "closes the connection after an answer" } else { "tells no number of links" };
                return Err(format!("the server at {address} {what}: {why}"));
            }
        };
        let (mut silent, has_arm) = (Vec::new(), by_params.is_some() || state.is_ok());
        let mut ask = |service| {
            let answer = if has_arm { bench.peer.call(service, &json!({})) } else { Err("the server has no arm".to_owned()) };
            // A rejection is an answer.
            let Answer { values, result, status, .. } = answer.inspect_err(|_| silent.push(service))?;
            must(result, || format!("{service} is rejected: {status}")).map(|()| values)
        };
        let settings = SETTINGS.map(&mut ask);
        drop(ENDING.map(ask));
        Ok(Self { links, settings, state, silent })
    }

    /// The settings that a service returned.
    pub fn setting(&self, service: &str) -> Result<Value, String> {
        let found = SETTINGS.iter().zip(&self.settings).find(|(name, _)| **name == service);
        found.map_or_else(|| Err(format!("{service} has not been asked")), |(_, values)| values.clone())
    }

    /// Restores the server's settings. Returns what the server did not take back.
    pub fn restore(&self, address: &str) -> Vec<String> {
        // A run of its own, because the other one may have been interrupted.
        let mut bench = match Bench::prepared(address, self, &Arc::default()) {
            Ok(bench) => bench,
            Err(why) => return vec![format!("the settings are not restored: {why}")],
        };
        let mut missed = Vec::new();
        for (service, values) in SETTINGS.iter().zip(&self.settings) {
            let Ok(values) = values else { continue };
            let answer = bench.peer.call(service, values);
            if let Err(why) = answer.and_then(|answer| has(values, &answer.values)) {
                missed.push(format!("{service} is not restored: {why}"));
            }
        }
        missed
    }
}

/// Passes if something at the address answers a call as a rosbridge server does.
fn greet(peer: &mut Peer, address: &str) -> Result<(), String> {
    let not = |what: &str| Err(format!("{address} is no rosbridge server: {what}"));
    let is_answer = |frame: &Value| ["service_response", "status"].contains(&frame.get("op").and_then(Value::as_str).unwrap_or_default());
    // A server of the checkpoint may have the second service alone.
    for service in ["/arm_sim/set_params", "/arm_sim/integration_step"] {
        // Calls are counted from 1, so a later answer is none to another call.
        let greeting = json!({"op": "call_service", "service": service, "args": {}, "id": "call-0"});
        if let Err(why) = peer.send(&greeting) {
            return not(&why);
        }
        match peer.find(Instant::now() + GREETING.min(peer.run.patience), is_answer) {
            Ok(_) => return Ok(()),
            Err(Trouble::Silence) => {}
            Err(Trouble::Broken(why)) if why.contains("HTTP/") => return not("it speaks HTTP"),
            Err(Trouble::Broken(why)) if why.contains("TLS") => return not("it speaks TLS"),
            Err(Trouble::Broken(why)) => return not(&why),
        }
    }
    not(if speaks_http(address) { "it speaks HTTP" } else { "it gave no answer to a call" })
}

/// The longest wait for the first answer to each of two calls. A verdict on an address takes at most 5 s.
const GREETING: Duration = Duration::from_millis(1500);

/// Whether a server answers a request of HTTP.
fn speaks_http(address: &str) -> bool {
    let Ok(mut peer) = Peer::connect(address, &Arc::default()) else { return false };
    let is_sent = peer.send_line("GET / HTTP/1.0\r\n\r").is_ok();
    is_sent && matches!(peer.receive(Instant::now() + Duration::from_secs(1)), Err(Trouble::Broken(why)) if why.contains("HTTP/"))
}

/// A message on `/joint_states`.
#[derive(Debug, Clone, PartialEq)]
pub struct Joints {
    /// Time of the header [s].
    pub stamp: f64,
    /// One name for each joint.
    pub name: Vec<String>,
    /// Joint angles [rad].
    pub position: Vec<f64>,
    /// Their rates [rad/s].
    pub velocity: Vec<f64>,
    /// Joint efforts [N m].
    pub effort: Vec<f64>,
}

impl Joints {
    /// Reads a message.
    pub fn read(msg: &Value) -> Result<Self, String> {
        let names = msg.pointer("/name").and_then(Value::as_array).ok_or("no array name in /joint_states")?;
        let name: Option<Vec<String>> = names.iter().map(|name| name.as_str().map(str::to_owned)).collect();
        let nanosec = number(msg, "header/stamp/nanosec").or_else(|_| number(msg, "header/stamp/nsecs"))?;
        let sec = number(msg, "header/stamp/sec").or_else(|_| number(msg, "header/stamp/secs"))?;
        Ok(Self {
            stamp: sec + 1e-9 * nanosec,
            name: name.ok_or("an entry of name in /joint_states is no text")?,
            position: numbers(msg, "position")?,
            velocity: numbers(msg, "velocity")?,
            effort: numbers(msg, "effort")?,
        })
    }

    /// Angles and rates.
    #[must_use]
    pub fn state(&self) -> State {
        State { position: self.position.clone(), velocity: self.velocity.clone() }
    }
}

/// A connection to a prepared arm.
#[derive(Debug)]
pub struct Bench {
    /// The connection.
    pub peer: Peer,
    /// How many links the arm has.
    pub links: usize,
    found: Option<Found>,
    /// Whether the present rule cannot be judged at this server.
    pub is_aside: bool,
}

impl Bench {
    /// Connects and puts the arm into the known state.
    pub fn prepared(address: &str, found: &Found, run: &Arc<Run>) -> Result<Self, String> {
        let links = found.links;
        let mut bench = Self { peer: Peer::connect(address, run)?, links, found: Some(found.clone()), is_aside: false };
        let arm = Arm::of(links, GRAVITY);
        let calls = [
            (ENDING[0], json!({})),
            (ENDING[1], json!({})),
            ("/arm_sim/pause", json!({"data": false})),
            ("/pid_controller/enable", json!({"data": false})),
            ("/arm_sim/set_integrator", json!({"method": "rk4", "timestep": 0.001})),
            ("/arm_sim/set_params", json!({"gravity": arm.gravity, "masses": arm.masses, "lengths": arm.lengths})),
            ("/arm_sim/reset", json!({})),
        ];
        // The results have rules of their own.
        for (service, args) in calls.iter().filter(|(service, _)| !found.silent.contains(service)) {
            bench.peer.call(service, args)?;
        }
        Ok(bench)
    }

    /// A second connection, to the same server; it changes nothing.
    pub fn another(&self) -> Result<Self, String> {
        let address = self.peer.address()?;
        Ok(Self { peer: Peer::connect(&address, &self.peer.run)?, links: self.links, found: self.found.clone(), is_aside: false })
    }

    /// The server's answers before anything was changed.
    pub fn found(&self) -> Result<&Found, String> {
        self.found.as_ref().ok_or_else(|| "the server has not been asked".to_owned())
    }

    /// The values of an accepted call.
    pub fn accepted(&mut self, service: &str, args: &Value) -> Result<Value, String> {
        let answer = self.peer.call(service, args).inspect_err(|_| self.peer.run.refused(service))?;
        let Answer { values, result, status, .. } = answer;
        if result {
            self.peer.run.accepted(service)
        } else {
            self.peer.run.refused(service)
        }
        must(result, || format!("{service} {args} is rejected: {status}"))?;
        Ok(values)
    }

    /// Passes if the service has accepted a call in this run. A service that does not exist rejects every call.
    pub fn exists(&mut self, service: &str) -> Result<(), String> {
        if self.peer.run.accepts(service) {
            return Ok(());
        }
        let arm = self.arm().unwrap_or_else(|_| Arm::of(self.links, GRAVITY));
        let pose: Vec<f64> = [0.5, -0.8, 0.4].into_iter().take(self.links).collect();
        let (x, y, phi) = arm.end_effector(&pose);
        let goal = json!({"x": x, "y": y, "phi": phi});
        let step = json!({"function": "t", "x0": 0.0, "xdot0": 0.0, "dt": 0.1, "steps": 3, "integrator": "rk4"});
        let calls: &[(&str, Value)] = match service {
            "/arm_sim/integration_step" => &[(service, step)],
            "/ik/solve" => &[(service, goal)],
            "/ik_action/send_goal" => &[(service, goal), ("/ik_action/cancel_goal", json!({}))],
            "/ik_action/cancel_goal" => &[("/ik_action/send_goal", goal), (service, json!({}))],
            "/ik_trial/skip" => &[("/ik_trial/start", json!({})), (service, json!({})), ("/ik_trial/stop", json!({}))],
            "/ik_trial/stop" => &[("/ik_trial/start", json!({})), (service, json!({}))],
            _ => &[(service, json!({}))],
        };
        for (name, args) in calls {
            self.accepted(name, args).map_err(|why| format!("a rejection counts once a valid call is accepted: {why}"))?;
        }
        Ok(())
    }

    /// The rule cannot be judged at this server: it counts neither for nor against it.
    pub fn aside(&mut self, why: &str) -> Got {
        self.is_aside = true;
        Err(why.to_owned())
    }

    /// The answer to a call that must be rejected with a reason.
    pub fn rejected(&mut self, service: &str, args: &Value) -> Result<Answer, String> {
        self.exists(service)?;
        let answer = self.peer.call(service, args)?;
        must(!answer.result, || format!("{service} {args} is accepted"))?;
        must(!answer.status.is_empty(), || format!("{service} {args} is rejected with an empty status"))?;
        must(answer.frame.get("result") == Some(&Value::Bool(false)), || format!("{service} {args}: no result"))?;
        Ok(answer)
    }

    /// Passes if each of these requests is rejected; the last reason.
    pub fn rejects(&mut self, service: &str, requests: &[Value]) -> Got {
        let mut status = String::new();
        for request in requests {
            status = self.rejected(service, request)?.status;
        }
        Ok(format!("{} rejected, the last with: {status}", requests.len()))
    }

    /// Subscribes to a topic.
    pub fn watch(&mut self, topic: &str) -> Result<(), String> {
        self.peer.send(&json!({"op": "subscribe", "id": format!("watch {topic}"), "topic": topic}))
    }

    /// The next message on a topic.
    pub fn message(&mut self, topic: &str, within: Duration) -> Result<Value, String> {
        self.message_that(topic, within, "a message", |_| true)
    }

    /// The next expected message on a topic. Others are kept.
    pub fn message_that(&mut self, topic: &str, within: Duration, name: &str, is_it: impl Fn(&Value) -> bool) -> Result<Value, String> {
        let holds = |frame: &Value| is_message(frame, topic) && frame.get("msg").is_some_and(&is_it);
        // The one topic that is never silent.
        let is_states = topic == "/joint_states";
        let within = if is_states { within.min(self.peer.run.patience_for(topic)) } else { within };
        let found = self.peer.find(Instant::now() + within, holds);
        match (&found, is_states) {
            (Ok(_), true) => self.peer.run.spoke(topic),
            (Err(Trouble::Silence), true) => self.peer.run.was_silent(topic),
            _ => {}
        }
        match found {
            Ok(mut frame) => Ok(frame.get_mut("msg").map(Value::take).unwrap_or_default()),
            Err(Trouble::Silence) => Err(format!("{name} did not come on {topic} within {:.1} s", within.as_secs_f64())),
            Err(Trouble::Broken(why)) => Err(why),
        }
    }

    /// All messages on a topic within a time.
    pub fn messages_for(&mut self, topic: &str, time: Duration) -> Result<Vec<Value>, String> {
        let until = Instant::now() + time;
        let mut found = Vec::new();
        while found.len() < MOST_MESSAGES {
            match self.peer.find(until, |frame| is_message(frame, topic)) {
                Ok(mut frame) => found.push(frame.get_mut("msg").map(Value::take).unwrap_or_default()),
                Err(Trouble::Silence) => break,
                Err(Trouble::Broken(why)) => return Err(why),
            }
        }
        Ok(found)
    }

    /// Discards the received messages on a topic.
    pub fn forget(&mut self, topic: &str) {
        self.peer.forget(|frame| is_message(frame, topic));
    }

    /// The next joint states, in order.
    pub fn joints(&mut self) -> Result<Joints, String> {
        let msg = self.message("/joint_states", self.peer.run.patience)?;
        let joints = Joints::read(&msg)?;
        let lengths = [joints.position.len(), joints.velocity.len(), joints.effort.len()];
        must(lengths == [self.links; 3], || format!("position, velocity and effort have {lengths:?} entries for {} joints", self.links))?;
        Ok(joints)
    }

    /// Joint states from after all requests of this connection. Subscribes if necessary.
    pub fn fresh(&mut self) -> Result<Joints, String> {
        self.watch("/joint_states")?;
        // A call that changes nothing. Messages before its answer may be older than this connection's requests.
        self.peer.call("/arm_sim/set_integrator", &json!({}))?;
        self.forget("/joint_states");
        self.joints()?;
        self.joints()
    }

    /// All joint states of a time.
    pub fn joints_for(&mut self, seconds: f64) -> Result<Vec<Joints>, String> {
        self.fresh()?;
        let until = Instant::now() + Duration::from_secs_f64(seconds);
        let mut found = vec![self.joints()?];
        while Instant::now() < until && found.len() < MOST_MESSAGES {
            found.push(self.joints()?);
        }
        Ok(found)
    }

    /// Passes if the arm stays at a pose for a time, without effort.
    pub fn stays_at(&mut self, pose: &[f64], seconds: f64, tolerance: f64) -> Got {
        for joints in self.joints_for(seconds)? {
            near("effort", &joints.effort, &self.each(0.0), tolerance)?;
            near("position", &joints.position, pose, tolerance)?;
        }
        Ok("no effort and no motion".to_owned())
    }

    /// Joint states until the arm has been at rest for a while; the last ones.
    pub fn at_rest(&mut self) -> Result<Joints, String> {
        self.fresh()?;
        let end = Instant::now() + Duration::from_secs(8);
        let mut since = Instant::now();
        loop {
            let joints = self.joints()?;
            if largest(&joints.velocity) > 3e-3 {
                since = Instant::now();
            } else if since.elapsed() > Duration::from_millis(200) {
                return Ok(joints);
            }
            must(Instant::now() < end, || format!("the arm does not come to rest; velocity {}", list(&joints.velocity)))?;
        }
    }

    /// Sets masses, lengths and gravity.
    pub fn set_arm(&mut self, arm: &Arm) -> Result<(), String> {
        let args = json!({"gravity": arm.gravity, "masses": arm.masses, "lengths": arm.lengths});
        self.accepted("/arm_sim/set_params", &args).map(drop)
    }

    /// Sets gravity alone.
    pub fn set_gravity(&mut self, gravity: f64) -> Result<(), String> {
        self.accepted("/arm_sim/set_params", &json!({"gravity": gravity})).map(drop)
    }

    /// The arm that the server reports.
    pub fn arm(&mut self) -> Result<Arm, String> {
        let values = self.accepted("/arm_sim/set_params", &json!({}))?;
        Ok(Arm {
            masses: numbers_of(&values, "masses", self.links)?,
            lengths: numbers_of(&values, "lengths", self.links)?,
            gravity: number(&values, "gravity")?,
        })
    }

    /// Sets gains, the same for every joint.
    pub fn set_gains(&mut self, kp: f64, ki: f64, kd: f64) -> Result<(), String> {
        let args = json!({"kp": self.each(kp), "ki": self.each(ki), "kd": self.each(kd)});
        self.accepted("/pid_controller/set_gains", &args).map(drop)
    }

    /// Sets gains that hold the arm of 1 m and 1 kg links, with the integral term if `integral` is true.
    pub fn set_holding_gains(&mut self, integral: bool) -> Result<(), String> {
        let (kp, kd): (&[f64], &[f64]) =
            if self.links == 2 { (&[200.0, 60.0], &[50.0, 10.0]) } else { (&[400.0, 150.0, 40.0], &[90.0, 35.0, 7.0]) };
        let ki: Vec<f64> = kp.iter().map(|kp| if integral { 1.5 * kp } else { 0.0 }).collect();
        self.accepted("/pid_controller/set_gains", &json!({"kp": kp, "ki": ki, "kd": kd})).map(drop)
    }

    /// Switches the controller.
    pub fn enable(&mut self, on: bool) -> Result<(), String> {
        self.accepted("/pid_controller/enable", &json!({"data": on})).map(drop)
    }

    /// Stops or continues the simulation.
    pub fn pause(&mut self, on: bool) -> Result<(), String> {
        self.accepted("/arm_sim/pause", &json!({"data": on})).map(drop)
    }

    /// Resets and returns the starting pose.
    pub fn reset(&mut self) -> Result<Vec<f64>, String> {
        let values = self.accepted("/arm_sim/reset", &json!({}))?;
        numbers_of(&values, "position", self.links)
    }

    /// Sends points of a trajectory.
    pub fn command(&mut self, points: &Value) -> Result<(), String> {
        let names: Vec<String> = (1..=self.links).map(|joint| format!("joint{joint}")).collect();
        // The name tells this trajectory from those of other programs.
        let header = json!({"stamp": {"sec": 0, "nanosec": 0}, "frame_id": self.peer.run.name});
        self.peer.send(&json!({"op": "advertise", "topic": "/joint_trajectory", "type": "trajectory_msgs/msg/JointTrajectory"}))?;
        let msg = json!({"header": header, "joint_names": names, "points": points});
        self.peer.send(&json!({"op": "publish", "topic": "/joint_trajectory", "msg": msg}))
    }

    /// Commands one position, at rest there.
    pub fn hold(&mut self, position: &[f64]) -> Result<(), String> {
        self.command(&json!([point(position, &self.each(0.0))]))
    }

    /// The same value for every joint.
    #[must_use]
    pub fn each(&self, value: f64) -> Vec<f64> {
        vec![value; self.links]
    }

    /// Without gravity, at rest in the starting pose, with the controller on: the pose.
    pub fn float(&mut self, kp: f64, ki: f64, kd: f64) -> Result<Vec<f64>, String> {
        self.set_gravity(0.0)?;
        self.set_gains(kp, ki, kd)?;
        let pose = self.reset()?;
        self.enable(true)?;
        Ok(pose)
    }

    /// Pushes the arm by the controller for a moment, then switches it off, so the arm swings freely.
    pub fn swing(&mut self) -> Result<(), String> {
        self.set_gains(20.0, 0.0, 0.0)?;
        let pose = self.reset()?;
        self.hold(&shifted(&pose, 1.0))?;
        self.enable(true)?;
        std::thread::sleep(Duration::from_millis(250));
        self.enable(false)
    }

    /// Passes if the published states of the uncontrolled arm are those that this crate's own arm has after whole
    /// steps from the first one. Returns the number of steps followed.
    pub fn follows(&mut self, arm: &Arm, method: &str, dt: f64) -> Result<usize, String> {
        let states = self.joints_for(0.3)?;
        let mut own = states.first().map(Joints::state).ok_or("no joint states")?;
        let mut steps = 0;
        for joints in states.iter().skip(1) {
            let limit = steps + 200;
            loop {
                let error = largest(&minus(&joints.position, &own.position)).max(largest(&minus(&joints.velocity, &own.velocity)));
                if error <= 1e-6 {
                    break;
                }
                must(steps < limit, || format!("{} is none of the next {steps} states of {method} at {dt} s", list(&joints.position)))?;
                own = step(method, &own, 0.0, dt, |_, q, v| arm.free_acceleration(q, v));
                steps += 1;
            }
        }
        must(steps > 0, || "the arm does not move".to_owned())?;
        Ok(steps)
    }

    /// Calls `/arm_sim/integration_step`: times, positions and velocities.
    pub fn integrate(&mut self, function: &str, [x0, xdot0, dt]: [f64; 3], steps: u32, method: &str) -> Result<[Vec<f64>; 3], String> {
        let args = json!({"function": function, "x0": x0, "xdot0": xdot0, "dt": dt, "steps": steps, "integrator": method});
        let values = self.accepted("/arm_sim/integration_step", &args)?;
        let count = usize::try_from(steps).unwrap_or(usize::MAX).saturating_add(1);
        let read = |name| numbers_of(&values, name, count);
        Ok([read("times")?, read("positions")?, read("velocities")?])
    }

    /// Sends a goal; its id.
    pub fn send_goal(&mut self, goal: &Value) -> Result<String, String> {
        let values = self.accepted("/ik_action/send_goal", goal)?;
        let id = text(&values, "goal_id")?;
        must(!id.is_empty(), || "goal_id is empty".to_owned())?;
        Ok(id.to_owned())
    }
}

/// A point of a trajectory.
#[must_use]
pub fn point(positions: &[f64], velocities: &[f64]) -> Value {
    json!({"positions": positions, "velocities": velocities, "accelerations": [], "time_from_start": {"sec": 0, "nanosec": 0}})
}

/// A pose with the same angle added to every joint.
#[must_use]
pub fn shifted(pose: &[f64], by: f64) -> Vec<f64> {
    pose.iter().map(|angle| angle + by).collect()
}

/// Passes if two sets of values are the same numbers, texts and booleans.
pub fn same(before: &Value, after: &Value, members: &[&str]) -> Result<(), String> {
    for name in members {
        let (one, other) = (before.get(name), after.get(name));
        let is_same = match (numbers(before, name), numbers(after, name)) {
            (Ok(one), Ok(other)) => near(name, &other, &one, 1e-12).is_ok(),
            _ => match (number(before, name), number(after, name)) {
                (Ok(one), Ok(other)) => near(name, &[other], &[one], 1e-12).is_ok(),
                _ => one.is_some() && one == other,
            },
        };
        let show = |value: Option<&Value>| value.map_or_else(|| "missing".to_owned(), ToString::to_string);
        must(is_same, || format!("{name} was {} and is {}", show(one), show(other)))?;
    }
    Ok(())
}

/// Passes if an answer has the members of `expected` with their values; it may have more.
pub fn has(expected: &Value, got: &Value) -> Result<(), String> {
    let members: Vec<&str> = expected.as_object().into_iter().flatten().map(|(name, _)| name.as_str()).collect();
    same(expected, got, &members)
}

/// Passes if `{}` is accepted twice and returns the same values.
pub(crate) fn is_query(bench: &mut Bench, service: &str, members: &[&str]) -> Got {
    let before = bench.accepted(service, &json!({}))?;
    let after = bench.accepted(service, &json!({}))?;
    same(&before, &after, members)?;
    Ok(after.to_string())
}

/// Passes if a service of one switch returns it as it was set, also twice.
pub(crate) fn is_switched(bench: &mut Bench, service: &str) -> Got {
    for on in [true, false] {
        bench.accepted(service, &json!({"data": on}))?;
        for _ in 0..2 {
            let data = boolean(&bench.accepted(service, &json!({}))?, "data")?;
            must(data == on, || format!("data {data} after data {on}"))?;
        }
    }
    Ok("data as it was set".to_owned())
}

/// Passes if a service applies each change alone: its other members stay as in `before`.
pub fn apply_alone(bench: &mut Bench, service: &str, before: Value, changes: &[(&str, Value)]) -> Got {
    let mut expected = before;
    for (name, value) in changes {
        set(&mut expected, name, value.clone());
        has(&expected, &bench.accepted(service, &json!({ (*name): value }))?)?;
    }
    Ok("each field alone".to_owned())
}
