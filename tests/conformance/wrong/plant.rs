//! The arm of a wrong server: equations, methods, control law and inverse kinematics, each with a possible mistake.

use std::f64::consts::{PI, TAU};
use std::time::{Duration, Instant};

use pendularm_conformance::arm::{Arm, State, absolute};
use pendularm_conformance::method::step;
use pendularm_conformance::mistakes::equations::{self, Equations};
use pendularm_conformance::mistakes::steps::{self, Force, Step, Variant};
use serde_json::{Value, json};

use super::expression::{Misread, evaluate};

/// How a wrong method steps.
#[derive(Clone, Copy)]
pub enum Stepping {
    Own(Step),
    Other(&'static str),
    Varied(Variant),
}

/// A mistake of a server.
#[derive(Clone, Copy)]
pub enum Mistake {
    /// The right server.
    Nothing,
    /// In a method, by its name.
    Method(&'static str, Stepping),
    /// In the equations of motion.
    Equations(Equations),
    /// In the parser.
    Expression(Misread),
    /// In inverse kinematics, by the place in [`super::KINEMATICS`].
    Kinematics(usize),
    /// In the control law, by the place in [`super::LAW`].
    Law(usize),
    /// In what is told: by the place in [`super::TOLD`].
    Told(usize),
}

/// The arm, its controller and its clock.
pub struct Plant {
    mistake: Mistake,
    pub arm: Arm,
    pub method: String,
    pub timestep: f64,
    pub paused: bool,
    pub enabled: bool,
    pub gains: [Vec<f64>; 3],
    pub setpoint: State,
    integral: Vec<f64>,
    state: State,
    effort: Vec<f64>,
    time: f64,
    /// The wall time up to which the arm has moved.
    since: Instant,
}

/// The pose after a reset.
const START: [f64; 3] = [0.4, 0.3, 0.2];
/// The longest time that is made up for at once. A busy machine slows the arm down.
const BEHIND: Duration = Duration::from_millis(200);

impl Plant {
    pub fn new(links: usize, mistake: Mistake) -> Self {
        let zeros = vec![0.0; links];
        let state = State { position: START[..links].to_vec(), velocity: zeros.clone() };
        Self {
            mistake,
            arm: Arm::of(links, 9.81),
            method: "rk4".to_owned(),
            timestep: 0.001,
            paused: false,
            enabled: false,
            gains: [zeros.clone(), zeros.clone(), zeros.clone()],
            setpoint: state.clone(),
            integral: zeros.clone(),
            effort: zeros,
            state,
            time: 0.0,
            since: Instant::now(),
        }
    }

    fn is_law(&self, at: usize) -> bool {
        matches!(self.mistake, Mistake::Law(law) if law == at)
    }

    fn is_told(&self, at: usize) -> bool {
        matches!(self.mistake, Mistake::Told(told) if told == at)
    }

    pub fn enable(&mut self, on: bool) {
        if on && !self.enabled && !self.is_law(11) && !self.is_law(13) {
            self.integral.fill(0.0);
        }
        self.enabled = on;
        if !on {
            self.effort.fill(0.0);
        }
    }

    pub fn reset(&mut self) -> Value {
        let kept = std::mem::take(&mut self.integral);
        let fresh = Self::new(kept.len(), self.mistake);
        (self.state, self.setpoint, self.effort, self.time) = (fresh.state, fresh.setpoint, fresh.effort, 0.0);
        self.integral = if self.is_law(12) || self.is_law(13) { kept } else { fresh.integral };
        json!({"position": self.state.position, "velocity": self.state.velocity})
    }

    /// Moves the arm up to the present.
    pub fn advance(&mut self) {
        let now = Instant::now();
        self.since = self.since.max(now.checked_sub(BEHIND).unwrap_or(now));
        let dt = if self.is_told(4) { 0.001 } else { self.timestep };
        while self.since + Duration::from_secs_f64(dt) <= now {
            self.since += Duration::from_secs_f64(dt);
            if !self.paused {
                self.tick(dt);
            }
        }
    }

    fn tick(&mut self, dt: f64) {
        if self.enabled {
            self.control(dt);
        }
        let right = Mistake::Equations(equations::RIGHT);
        let Mistake::Equations(equations) = (if let Mistake::Equations(_) = self.mistake { self.mistake } else { right }) else { return };
        let (arm, effort) = (&self.arm, &self.effort);
        let force = |_: f64, q: &[f64], v: &[f64]| equations.acceleration(arm, q, v, effort);
        let next = self.stepped(&self.method, &self.state, self.time, dt, &force);
        if next.position.iter().chain(&next.velocity).all(|value| value.is_finite()) {
            self.state = next;
        }
        self.time += dt;
    }

    fn stepped(&self, method: &str, state: &State, t: f64, dt: f64, force: Force) -> State {
        match self.mistake {
            Mistake::Method(of, Stepping::Own(own)) if of == method => own(state, t, dt, force),
            Mistake::Method(of, Stepping::Other(other)) if of == method => step(other, state, t, dt, force),
            Mistake::Method(of, Stepping::Varied(varied)) if of == method => varied(method, state, t, dt, force),
            _ => step(method, state, t, dt, force),
        }
    }

    /// The control law. The numbers are places in [`super::LAW`].
    fn control(&mut self, dt: f64) {
        for joint in 0..self.effort.len() {
            let mut error = self.setpoint.position[joint] - self.state.position[joint];
            if self.is_law(0) {
                error = -error;
            }
            if self.is_law(4) {
                error = (error + PI).rem_euclid(TAU) - PI;
            }
            let wanted = if self.is_law(7) { 0.0 } else { self.setpoint.velocity[joint] };
            let rate = wanted - self.state.velocity[joint];
            let grown = self.integral[joint] + error * if self.is_law(10) { 1.0 } else { dt };
            self.integral[joint] = grown.clamp(-50.0, 50.0);
            let sign = |negative: usize, missing: usize| match () {
                () if self.is_law(negative) => -1.0,
                () if self.is_law(missing) => 0.0,
                () => 1.0,
            };
            let kp = self.gains[0][if self.is_law(3) { 0 } else { joint }];
            let terms = [sign(1, 2) * kp * error, sign(8, 9) * self.gains[1][joint] * self.integral[joint]];
            self.effort[joint] = terms[0] + terms[1] + sign(5, 6) * self.gains[2][joint] * rate;
        }
    }

    /// The message on `/joint_states`.
    pub fn message(&self) -> Value {
        let names: Vec<String> = (1..=self.effort.len()).map(|joint| format!("joint{joint}")).collect();
        let told = |values: &[f64]| if self.is_told(5) { absolute(values) } else { values.to_vec() };
        let whole = self.time.floor();
        let stamp = json!({"sec": whole, "nanosec": ((self.time - whole) * 1e9).floor().min(999_999_999.0)});
        json!({
            "header": {"stamp": stamp, "frame_id": "world"}, "name": names, "effort": self.effort,
            "position": told(&self.state.position), "velocity": told(&self.state.velocity),
        })
    }

    /// `/arm_sim/integration_step`.
    pub fn integrate(&self, args: &Value) -> Option<Value> {
        let (number, function) = (|name: &str| args[name].as_f64(), args["function"].as_str()?);
        let (x0, dt, steps, method) = (number("x0")?, number("dt")?, args["steps"].as_u64()?, args["integrator"].as_str()?);
        let as_read = if let Mistake::Expression(misread) = self.mistake { misread } else { Misread::Nothing };
        evaluate(function, 0.0, as_read)?;
        if dt <= 0.0 || steps == 0 || !pendularm_conformance::method::METHODS.contains(&method) {
            return None;
        }
        let start = [if self.is_told(0) { 0.0 } else { x0 }, if self.is_told(1) { 0.0 } else { number("xdot0").unwrap_or(0.0) }];
        let late = usize::from(self.is_told(2));
        let mut states = vec![State { position: vec![start[0]], velocity: vec![start[1]] }];
        for k in 0..usize::try_from(steps).ok()? + late {
            let force = |t: f64, _: &[f64], _: &[f64]| vec![evaluate(function, t, as_read).unwrap_or(f64::NAN)];
            states.push(self.stepped(method, &states[k], k as f64 * dt, dt, &force));
        }
        let told = |value: f64| if self.is_told(3) { f64::from(value as f32) } else { value };
        let of = |read: fn(&State) -> f64| states.iter().skip(late).map(|state| told(read(state))).collect::<Vec<_>>();
        let time = |k: u64| match self.mistake {
            Mistake::Told(6) => (k + 1) as f64 * dt,
            Mistake::Told(7) => (k as f64 - 1.0) * dt,
            Mistake::Told(8) => k as f64,
            Mistake::Told(9) => f64::from((k as f64 * dt) as f32),
            Mistake::Told(10) => f64::from((0..k).fold(0.0_f32, |sum, _| sum + dt as f32)),
            _ => k as f64 * dt,
        };
        let times: Vec<f64> = (0..=steps).map(time).collect();
        Some(json!({"times": times, "positions": of(|state| state.position[0]), "velocities": of(|state| state.velocity[0])}))
    }

    /// `/ik/solve`. The numbers are places in [`super::KINEMATICS`].
    pub fn solve(&self, args: &Value) -> Option<Vec<f64>> {
        let wrong = if let Mistake::Kinematics(at) = self.mistake { at } else { usize::MAX };
        let (mut x, mut y) = (args["x"].as_f64()?, args["y"].as_f64()?);
        let mut lengths = self.arm.lengths.clone();
        match wrong {
            3 => (x, y) = (y, x),
            4 => y = -y,
            6 => lengths.fill(1.0),
            7 => lengths.swap(0, 1),
            _ => {}
        }
        let phi = args["phi"].as_f64().unwrap_or_else(|| y.atan2(x));
        let (mut wrist_x, mut wrist_y) = (x, y);
        if let Some(last) = lengths.get(2) {
            let sign = if wrong == 9 { 1.0 } else { -1.0 };
            (wrist_x, wrist_y) = (x + sign * last * phi.cos(), y + sign * last * phi.sin());
        }
        let (a, b) = (lengths[0], lengths[1]);
        let cosine = (wrist_x * wrist_x + wrist_y * wrist_y - a * a - b * b) / (2.0 * a * b);
        let elbow = (cosine.abs() <= 1.0 + 1e-9).then(|| cosine.clamp(-1.0, 1.0).acos())?;
        let mut pose = vec![wrist_y.atan2(wrist_x) - (b * elbow.sin()).atan2(a + b * elbow.cos()), elbow];
        if lengths.len() == 3 {
            pose.push(if wrong == 8 { phi } else { phi - pose[0] - elbow });
        }
        match wrong {
            0 => pose = absolute(&pose),
            1 => pose.iter_mut().for_each(|angle| *angle = angle.to_degrees()),
            2 => pose[1] = -pose[1],
            5 => pose[1] = PI - pose[1],
            _ => {}
        }
        Some(pose)
    }
}

/// The ways in which a method steps wrongly, with the words of the cause.
pub fn steppings(method: &'static str) -> impl Iterator<Item = (String, Mistake)> {
    let own = steps::STEPPERS.iter().filter(move |(of, ..)| *of == method);
    let own = own.map(|(_, says, step)| ((*says).to_owned(), Stepping::Own(*step)));
    let others = pendularm_conformance::method::METHODS.into_iter().filter(move |other| *other != method);
    let others = others.map(move |other| (format!("{other} instead of {method}"), Stepping::Other(other)));
    let varied = steps::COMMON.into_iter().map(|(says, variant)| (says.to_owned(), Stepping::Varied(variant)));
    own.chain(others).chain(varied).map(move |(says, stepping)| (says, Mistake::Method(method, stepping)))
}
