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
use serde_json::value::to_raw_value;
use serde_json::{Value, json};

use crate::math::arm::{Arm, State};
use crate::protocol::catalog::Service;
use crate::protocol::op::Arguments;
use crate::services::Ask as _;
use crate::services::study::{Present, RunOffline};
use crate::study::control_loop::ControlLoop;
use crate::study::paused::at_once;
use crate::study::rollout::rollout;

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
        self.watch["seconds"].as_f64().unwrap_or_default()
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

    /// Asks `/study/rollout`.
    fn run<const N: usize>(&self) -> Result<LiveRun, String> {
        let (settings, watch) = (&self.settings, &self.watch);
        let given = |choices: [&Value; 2]| choices.into_iter().find(|it| !it.is_null()).cloned();
        let is_held = settings["controller"] == true;
        let gains = is_held.then(|| given([&settings["gains"], &json!({})]));
        let mut question = json!({
            "params": settings["params"],
            "viscous": settings["friction"]["viscous"],
            "gains": gains,
            "setpoint": settings["setpoint"],
            "limits": settings["motors"],
            "sensors": settings["sensors"],
            "control_period": settings["period"]["period"],
            "delay": settings["period"]["delay"],
            "integrator": settings["integrator"]["method"],
            "timestep": given([&watch["timestep"], &settings["integrator"]["timestep"]]),
            "q": given([&watch["start"], &self.start]),
            "qd": self.velocity,
            "duration": self.seconds(),
            "samples": 121,
        });
        // A missing member has its default.
        if let Some(members) = question.as_object_mut() {
            members.retain(|_, value| !value.is_null());
        }
        let question = to_raw_value(&question).map_err(|error| error.to_string())?;
        let question = RunOffline::<N>::read(Service::Rollout, &Arguments::from(question));
        let question = question.map_err(|why| why.to_string())?;
        let request = question.request(&Present {
            control: ControlLoop::free(Arm::default()),
            state: State::rest(),
        });
        let request = request.map_err(|error| error.to_string())?;
        let made = at_once(rollout(request)).map_err(|error| error.to_string())?;
        let moved = |position: [f64; N]| {
            let pairs = position.iter().zip(request.start.position);
            pairs.map(|(now, start)| now - start).collect()
        };
        let samples = made.times.into_iter().zip(made.positions);
        Ok(LiveRun {
            samples: samples.map(|(time, it)| (time, moved(it))).collect(),
            lost_at: made.divergence.map(|it| it.time),
        })
    }
}
