//! The live arms that show the scenes: settings, initial state and duration. The rows are those of the page, in
//! `page/scenes.js`.
//!
//! A scene simulates many arms and checks numbers. Its live arm is one of them. The report shows it as a picture.
//!
//! **Invariant:** every scene has a row. A scene that no live arm can show has the reason.

#![allow(
    clippy::indexing_slicing,
    reason = "a member that a JSON value does not have is null"
)]

use serde::Deserialize;
use serde_json::Value;

use crate::math::arm::{Arm, State};
use crate::math::integrator::Method;
use crate::math::limits::Limits;
use crate::math::pid::{Gains, Setpoint};
use crate::math::sensors::Sensors;
use crate::math::simulation::{ControlPeriod, DEFAULT_TIMESTEP};
use crate::study::control_loop::ControlLoop;
use crate::study::paused::at_once;
use crate::study::rollout::{RolloutRequest, rollout};

/// The page's module, whose rows are JSON.
const MODULE: &str = include_str!("../../page/scenes.js");

/// A scene as settings of an arm of 2 or 3 links.
#[derive(Debug, Clone, Deserialize)]
pub struct LiveScene {
    /// `S01` to `S43`.
    pub id: String,
    /// Its name.
    pub name: String,
    links: usize,
    /// Joint angles at the start \[rad\], and rates \[rad/s\].
    start: Value,
    #[serde(default)]
    velocity: Value,
    /// The settings in the page's form; the defaults are the runtime's.
    settings: Value,
    /// The picture: its duration, and the settings that differ from the page.
    #[serde(default)]
    watch: Value,
    hidden: Option<String>,
}

/// Joint angles over time, from the live arm's own steps.
#[derive(Debug, Clone, PartialEq)]
pub struct LiveRun {
    /// Time \[s\], and the angle of each joint from its start \[rad\].
    pub samples: Vec<(f64, Vec<f64>)>,
    /// The time after which the run diverged \[s\].
    pub lost_at: Option<f64>,
}

/// All scenes, in order.
pub fn live_scenes() -> Vec<LiveScene> {
    let rows = MODULE.split_once("SCENES = [");
    let rows = rows.and_then(|(_, rest)| rest.split_once("\n];"));
    let rows = rows.map(|(rows, _)| format!("[{}]", rows.trim_end_matches(',')));
    let scenes = rows.and_then(|rows| serde_json::from_str(&rows).ok());
    scenes.unwrap_or_default()
}

impl LiveScene {
    /// Duration of the picture \[s\]; 0 for a scene without one.
    pub fn seconds(&self) -> f64 {
        number(&self.watch["seconds"], 0.0)
    }

    /// Runs the arm.
    ///
    /// # Errors
    /// The reason why the scene has no picture.
    pub fn watch(&self) -> Result<LiveRun, String> {
        match (&self.hidden, self.links) {
            (Some(why), _) => Err(why.clone()),
            (None, 2) => self.run::<2>(),
            (None, _) => self.run::<3>(),
        }
    }

    fn control<const N: usize>(&self) -> Result<ControlLoop<N>, String> {
        let settings = &self.settings;
        let (params, standard) = (&settings["params"], Arm::<N>::default());
        let arm = Arm::new(
            list(&params["lengths"], *standard.lengths()),
            list(&params["masses"], *standard.masses()),
            number(&params["gravity"], standard.gravity()),
        );
        let viscous = list(&settings["friction"]["viscous"], [0.0; N]);
        let arm = arm.and_then(|arm| arm.with_friction(viscous));
        let arm = arm.map_err(|error| error.to_string())?;
        let control = if settings["controller"] == true {
            let (gains, standard) = (&settings["gains"], Gains::default());
            let gains = Gains {
                kp: list(&gains["kp"], standard.kp),
                ki: list(&gains["ki"], standard.ki),
                kd: list(&gains["kd"], standard.kd),
            };
            let setpoint = list(&settings["setpoint"], [0.0; N]);
            ControlLoop::new(arm, gains, Setpoint::at(setpoint))
        } else {
            ControlLoop::free(arm)
        };
        let (integrator, period) = (&settings["integrator"], &settings["period"]);
        let (motors, sensors) = (&settings["motors"], &settings["sensors"]);
        let effort = motors["effort"].as_array();
        let control = ControlLoop {
            limits: Limits {
                effort: effort.map(|_| list(&motors["effort"], [0.0; N])),
                ..Limits::default()
            },
            sensors: Sensors {
                encoder_step: list(&sensors["encoder_step"], [0.0; N]),
                ..Sensors::default()
            },
            ..control
        };
        let method = integrator["method"].as_str();
        let method = method.and_then(|name| name.parse().ok());
        let timestep = number(&integrator["timestep"], DEFAULT_TIMESTEP);
        Ok(control
            .with_method(method.unwrap_or(Method::Rk4))
            .with_timestep(number(&self.watch["timestep"], timestep))
            .with_period(ControlPeriod {
                period: number(&period["period"], 0.0),
                delay: match sensors["delay"].as_u64() {
                    Some(delay) => u8::try_from(delay).unwrap_or(0),
                    None => u8::from(period["delay"] == true),
                },
            }))
    }

    fn run<const N: usize>(&self) -> Result<LiveRun, String> {
        let start = State {
            position: list(&self.watch["start"], list(&self.start, [0.0; N])),
            velocity: list(&self.velocity, [0.0; N]),
        };
        let made = at_once(rollout(RolloutRequest {
            control: self.control::<N>()?,
            start,
            duration: self.seconds(),
            samples: 121,
            reference: false,
        }));
        let made = made.map_err(|error| error.to_string())?;
        let moved = |position: [f64; N]| {
            let pairs = position.iter().zip(start.position);
            pairs.map(|(now, start)| now - start).collect()
        };
        let samples = made.times.into_iter().zip(made.positions);
        Ok(LiveRun {
            samples: samples.map(|(time, it)| (time, moved(it))).collect(),
            lost_at: made.divergence.map(|it| it.time),
        })
    }
}

fn number(value: &Value, standard: f64) -> f64 {
    value.as_f64().unwrap_or(standard)
}

/// The numbers of a list, padded with zeros.
fn list<const N: usize>(value: &Value, standard: [f64; N]) -> [f64; N] {
    value.as_array().map_or(standard, |values| {
        std::array::from_fn(|i| values.get(i).map_or(0.0, |value| number(value, 0.0)))
    })
}
