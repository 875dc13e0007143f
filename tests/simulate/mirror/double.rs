//! The double: takes as many steps as the arm and has the same inputs, and is held against it to the bit.

use std::rc::Rc;

use pendularm::actors::arm::sim::{Obstacle, STEPS_IN_A_ROW, joint_names};
use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::math::pid::Setpoint;
use pendularm::math::simulation::Simulation;
use pendularm::protocol::catalog::Service;
use pendularm::protocol::messages::trajectory::NodeMessage;
use serde_json::{Value, json};
use tokio::time::Instant;

use super::named::Named;
use crate::court::Court;

/// Most steps of one `/arm_sim/step`.
const MOST_STEPS: f64 = 10_000.0;
/// Timesteps at which the arm keeps up with time whatever happens \[s\].
const KEEPS_UP: std::ops::RangeInclusive<f64> = 4e-4..=1.0;
/// How late a wake-up may be that makes up for what one before it left owed \[s\].
const LATE: f64 = 0.002;

/// The double.
pub(super) struct Mirror<const N: usize> {
    pub(super) simulation: Simulation<N>,
    pub(super) paused: bool,
    /// Steps that were asked for by hand and may still be taken: a resume and a pause at once do not end them.
    pub(super) asked_steps: u64,
    /// Whether there has been a goal: steps by hand end at its progress then, and go on between what others ask.
    pub(super) has_goals: bool,
    /// Whether the last input, if its fields were good, has been followed as a whole.
    pub(super) is_done: bool,
    /// A moment, and the simulation's time then.
    pub(super) anchor: Option<(Instant, f64)>,
    /// Jumps of the clock that the anchor knows of.
    pub(super) jumps: u64,
    pub(super) court: Rc<Court>,
}

impl<const N: usize> Mirror<N> {
    /// The arm is in this state now.
    pub(super) fn observe(&mut self, arm: Option<&Simulation<N>>) {
        let Some(arm) = arm else {
            return self.court.wrong("the arm does not answer".to_owned());
        };
        let Some(taken) = arm.steps().checked_sub(self.simulation.steps()) else {
            let words = "the arm has taken fewer steps than before without a reset";
            return self.court.wrong(words.to_owned());
        };
        if self.paused && taken > self.asked_steps {
            return self
                .court
                .wrong(format!("a paused arm has taken {taken} steps"));
        }
        self.asked_steps -= taken.min(self.asked_steps);
        self.simulation.advance(taken);
        if arm.divergence().is_some() && self.simulation.divergence().is_none() {
            self.simulation.advance(1);
        }
        let bits = |one: &Simulation<N>| {
            let state = one.state();
            [state.position, state.velocity, *one.effort()].map(|row| row.map(f64::to_bits))
        };
        if *arm != self.simulation || bits(arm) != bits(&self.simulation) {
            self.court.wrong(format!(
                "the arm is not the offline stepper after {taken} steps: {arm:?} instead of {:?}",
                self.simulation
            ));
        }
        self.note_obstacle();
        self.keep_time();
    }

    /// Whatever keeps the arm from its setpoint now, clients may be warned of from now on.
    pub(super) fn note_obstacle(&self) {
        let obstacle = if self.simulation.divergence().is_some() {
            Obstacle::Diverged
        } else if self.simulation.pid().is_enabled() {
            return;
        } else {
            Obstacle::ControllerOff
        };
        let mut obstacles = self.court.obstacles.borrow_mut();
        obstacles.insert(obstacle.to_string());
    }

    /// Running, the arm has taken as many steps as fit into the time since the anchor.
    fn keep_time(&mut self) {
        let (now, time, step) = (
            Instant::now(),
            self.simulation.time(),
            self.simulation.timestep(),
        );
        let keeps_up =
            KEEPS_UP.contains(&step) && !self.paused && self.simulation.divergence().is_none();
        let has_jumped = self.court.jumps.get() != self.jumps;
        self.jumps = self.court.jumps.get();
        match self.anchor.filter(|_| keeps_up && !has_jumped) {
            None => self.anchor = keeps_up.then_some((now, time)),
            Some((since, start)) => {
                let late = (now - since).as_secs_f64() - (time - start);
                if late > step + LATE || late < -step - 1e-9 {
                    self.court.wrong(format!(
                        "the arm is {late} s behind time, its timestep {step} s"
                    ));
                }
            }
        }
    }

    /// A trajectory: its last point is the setpoint.
    pub(super) fn point(&mut self, heard: &NodeMessage) {
        if let Ok(request) = heard.setpoint(&joint_names::<N>())
            && let (Ok(position), Ok(velocity)) =
                (request.position.try_into(), request.velocity.try_into())
        {
            self.simulation
                .set_setpoint(Setpoint { position, velocity });
        }
    }

    /// A call takes effect; gives the `values` of its answer, where the model knows them.
    pub(super) fn apply(&mut self, named: &Named) -> Option<Value> {
        self.is_done = true;
        let simulation = &mut self.simulation;
        match named.service {
            Service::SetIntegrator => {
                if let Some(method) = named.text("method").and_then(|name| method(&name)) {
                    simulation.set_method(method);
                }
                if let Some(step) = named.number("timestep", |step| step > 0.0)
                    && step.to_bits() != simulation.timestep().to_bits()
                {
                    simulation.set_timestep(step);
                    self.anchor = None;
                }
                Some(
                    json!({"method": simulation.method().name(), "timestep": simulation.timestep()}),
                )
            }
            Service::SetParams => {
                let present = *simulation.arm();
                let gravity = named.number("gravity", |gravity| gravity >= 0.0);
                let lengths = named.joints("lengths", |length| length > 0.0);
                let masses = named.joints("masses", |mass| mass > 0.0);
                let changed = Arm::new(
                    lengths.unwrap_or(*present.lengths()),
                    masses.unwrap_or(*present.masses()),
                    gravity.unwrap_or(present.gravity()),
                );
                simulation.set_arm(changed.unwrap_or(present));
                let arm = simulation.arm();
                let (masses, lengths) = (arm.masses().to_vec(), arm.lengths().to_vec());
                Some(json!({"gravity": arm.gravity(), "masses": masses, "lengths": lengths}))
            }
            Service::Pause => {
                if let Some(paused) = named.boolean("data")
                    && paused != self.paused
                {
                    self.paused = paused;
                    self.anchor = None;
                }
                Some(json!({"data": self.paused}))
            }
            Service::Reset => {
                if !named.is_whole {
                    return None;
                }
                simulation.reset();
                self.anchor = None;
                let state = simulation.state();
                Some(
                    json!({"position": state.position.to_vec(), "velocity": state.velocity.to_vec()}),
                )
            }
            Service::Step => self.step(named),
            Service::Disturb => {
                let effort = named.joints("effort", |_| true);
                let duration = named.number("duration", |duration| duration > 0.0);
                let (Some(effort), Some(duration), None) =
                    (effort, duration, simulation.divergence())
                else {
                    self.is_done = false;
                    return Some(json!({}));
                };
                simulation.disturb(effort, duration);
                Some(json!({"effort": effort.to_vec(), "duration": duration}))
            }
            Service::Enable => {
                if let Some(on) = named.boolean("data")
                    && on != simulation.pid().is_enabled()
                {
                    simulation.enable(on);
                }
                Some(json!({"data": simulation.pid().is_enabled()}))
            }
            Service::SetGains => {
                let mut gains = *simulation.pid().gains();
                let good = |gain| gain >= 0.0;
                gains.kp = named.joints("kp", good).unwrap_or(gains.kp);
                gains.ki = named.joints("ki", good).unwrap_or(gains.ki);
                gains.kd = named.joints("kd", good).unwrap_or(gains.kd);
                simulation.set_gains(gains);
                Some(
                    json!({"kp": gains.kp.to_vec(), "ki": gains.ki.to_vec(), "kd": gains.kd.to_vec()}),
                )
            }
            _ => None,
        }
    }

    /// The end of steps that are not all taken at once is not foreseen where there are goals.
    pub(super) fn look_after_steps(&self, id: &str) {
        let mut expected = self.court.expected.borrow_mut();
        if let Some((values, _)) = expected.get_mut(id)
            && self.has_goals
            && let Some(time) = values["time"].as_f64()
            && time.to_bits() != self.simulation.time().to_bits()
        {
            *values = Value::Null;
        }
    }

    fn step(&mut self, named: &Named) -> Option<Value> {
        let steps = named.number("steps", |steps| {
            steps.fract() == 0.0 && (1.0..=MOST_STEPS).contains(&steps)
        });
        let Some(steps) = steps.filter(|_| self.paused && self.simulation.divergence().is_none())
        else {
            self.is_done = false;
            return Some(json!({}));
        };
        let mut alone = self.simulation.clone();
        // A run that is longer than a row goes on between what others ask: its end is not foreseen.
        let steps = steps as u64;
        let taken = alone.advance(steps.min(STEPS_IN_A_ROW));
        self.asked_steps += steps;
        self.is_done = taken == steps;
        (steps <= STEPS_IN_A_ROW).then(|| {
            let (state, effort) = (alone.state(), alone.effort().to_vec());
            let (position, velocity) = (state.position.to_vec(), state.velocity.to_vec());
            json!({"steps": taken, "time": alone.time(), "position": position,
                "velocity": velocity, "effort": effort})
        })
    }
}

fn method(name: &str) -> Option<Method> {
    Method::ALL.into_iter().find(|method| method.name() == name)
}
