//! The live arms that show the scenes: settings, a start, and how long to watch. The page has the same rows, in
//! `page/scenes.js`.
//!
//! A scene runs many arms and checks numbers. Its live arm is one of them, for a picture, and for a link that opens it
//! on the page.
//!
//! **Invariant:** every scene has a row; one that no live arm can show says why.

use serde::Deserialize;

use crate::math::arm::{Arm, State};
use crate::math::integrator::Method;
use crate::math::pid::{Gains, Setpoint};
use crate::math::simulation::{ControlPeriod, DEFAULT_TIMESTEP};
use crate::study::control_loop::ControlLoop;

/// The page's module, whose rows are JSON.
const MODULE: &str = include_str!("../../page/scenes.js");

/// A scene as settings of an arm of 2 or 3 links.
#[derive(Debug, Clone, Deserialize)]
pub struct LiveScene {
    /// `S01` to `S39`.
    pub id: String,
    /// Its name.
    pub name: String,
    links: usize,
    /// Joint angles at the start \[rad\], and rates \[rad/s\].
    start: Vec<f64>,
    #[serde(default)]
    velocity: Vec<f64>,
    settings: LiveSettings,
    watch: Option<PictureWindow>,
    hidden: Option<String>,
}

/// The settings as the page has them; the defaults are the runtime's.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(default)]
struct LiveSettings {
    integrator: Option<LiveIntegrator>,
    params: Option<LiveParams>,
    gains: Option<LiveGains>,
    period: Period,
    servo: bool,
    setpoint: Vec<f64>,
}

#[derive(Debug, Clone, Deserialize)]
struct LiveIntegrator {
    method: String,
    timestep: f64,
}

#[derive(Debug, Clone, Deserialize)]
struct LiveParams {
    gravity: f64,
    masses: Vec<f64>,
    lengths: Vec<f64>,
}

#[derive(Debug, Clone, Deserialize)]
struct LiveGains {
    kp: Vec<f64>,
    ki: Vec<f64>,
    kd: Vec<f64>,
}

#[derive(Debug, Clone, Default, Deserialize)]
#[serde(default)]
struct Period {
    period: f64,
    delay: bool,
}

/// The picture: its length, and where it differs from the page.
#[derive(Debug, Clone, Deserialize)]
struct PictureWindow {
    seconds: f64,
    timestep: Option<f64>,
    start: Option<Vec<f64>>,
}

/// Joint angles over time, from the live arm's own steps.
#[derive(Debug, Clone, PartialEq)]
pub struct LiveRun {
    /// Time \[s\], and the angle of each joint from its start \[rad\].
    pub samples: Vec<(f64, Vec<f64>)>,
    /// Whether the next step would have left the finite numbers.
    pub diverged: bool,
}

/// All scenes, in order.
#[must_use]
pub fn live_scenes() -> Vec<LiveScene> {
    let rows = MODULE.split_once("SCENES = [");
    let rows = rows.and_then(|(_, rest)| rest.split_once("\n];"));
    let rows = rows.map(|(rows, _)| format!("[{}]", rows.trim_end_matches(',')));
    let scenes = rows.and_then(|rows| serde_json::from_str(&rows).ok());
    scenes.unwrap_or_default()
}

impl LiveScene {
    /// How long to watch \[s\]; 0 for a scene without a picture.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.watch.as_ref().map_or(0.0, |watch| watch.seconds)
    }

    /// Runs the arm.
    ///
    /// # Errors
    /// Why the scene has no picture.
    pub fn watch(&self) -> Result<LiveRun, String> {
        if let Some(why) = &self.hidden {
            return Err(why.clone());
        }
        match self.links {
            2 => Ok(self.run(&self.control::<2>(Gains::<2>::default())?)),
            _ => Ok(self.run(&self.control::<3>(Gains::<3>::default())?)),
        }
    }

    fn control<const N: usize>(&self, gains: Gains<N>) -> Result<ControlLoop<N>, String> {
        let LiveSettings {
            params, setpoint, ..
        } = &self.settings;
        let arm = params.as_ref().map_or(Ok(Arm::default()), |params| {
            Arm::new(
                array(&params.lengths),
                array(&params.masses),
                params.gravity,
            )
        });
        let arm = arm.map_err(|error| error.to_string())?;
        let gains = self.settings.gains.as_ref().map_or(gains, |gains| Gains {
            kp: array(&gains.kp),
            ki: array(&gains.ki),
            kd: array(&gains.kd),
        });
        let control = if self.settings.servo {
            ControlLoop::new(arm, gains, Setpoint::at(array(setpoint)))
        } else {
            ControlLoop::free(arm)
        };
        let integrator = self.settings.integrator.as_ref();
        let method = integrator.and_then(|integrator| {
            let mut all = Method::ALL.into_iter();
            all.find(|method| method.name() == integrator.method)
        });
        let timestep = integrator.map_or(DEFAULT_TIMESTEP, |integrator| integrator.timestep);
        let own = self.watch.as_ref().and_then(|watch| watch.timestep);
        let Period { period, delay } = self.settings.period;
        Ok(control
            .with_method(method.unwrap_or(Method::Rk4))
            .with_timestep(own.unwrap_or(timestep))
            .with_period(ControlPeriod { period, delay }))
    }

    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a ratio of two positive times; a cast saturates"
    )]
    fn run<const N: usize>(&self, control: &ControlLoop<N>) -> LiveRun {
        /// Samples of a picture.
        const SAMPLES: u64 = 120;
        let position: [f64; N] = self.position();
        let velocity = array(&self.velocity);
        let mut simulation = control.simulation(State { position, velocity });
        let steps = (self.seconds() / control.timestep).round() as u64;
        let each = steps.div_ceil(SAMPLES).max(1);
        let mut watched = LiveRun {
            samples: vec![(0.0, vec![0.0; N])],
            diverged: false,
        };
        while simulation.time() < self.seconds() && !watched.diverged {
            watched.diverged = simulation.advance(each) < each;
            let angles = simulation.state().position.iter().zip(position);
            let angles = angles.map(|(now, start)| now - start).collect();
            watched.samples.push((simulation.time(), angles));
        }
        watched
    }

    /// Joint angles at the start \[rad\].
    fn position<const N: usize>(&self) -> [f64; N] {
        let own = self.watch.as_ref().and_then(|watch| watch.start.as_ref());
        array(own.unwrap_or(&self.start))
    }

    /// The settings as the page reads them behind the `#` of its address.
    #[must_use]
    pub fn fragment(&self) -> String {
        let spelled = match self.links {
            2 => self
                .control(Gains::<2>::default())
                .map(|it| self.spelled(&it)),
            _ => self
                .control(Gains::<3>::default())
                .map(|it| self.spelled(&it)),
        };
        spelled.unwrap_or_default()
    }

    fn spelled<const N: usize>(&self, control: &ControlLoop<N>) -> String {
        let list = |values: &[f64; N]| values.map(|value| format!("{value:?}")).join(",");
        let on_off = |on: bool| if on { "on" } else { "off" };
        let ControlLoop {
            arm, gains, period, ..
        } = control;
        let law = if control.is_free() {
            String::new()
        } else {
            let Gains { kp, ki, kd } = gains;
            let setpoint = list(&control.setpoint.position);
            let [kp, ki, kd] = [kp, ki, kd].map(list);
            format!("&kp={kp}&ki={ki}&kd={kd}&setpoint={setpoint}")
        };
        format!(
            "links={N}&method={}&timestep={:?}&gravity={:?}&masses={}&lengths={}{law}&period={:?}&delay={}&servo={}\
             &position={}&velocity={}",
            control.method,
            control.timestep,
            arm.gravity(),
            list(arm.masses()),
            list(arm.lengths()),
            period.period,
            on_off(period.delay),
            on_off(!control.is_free()),
            list(&self.position()),
            list(&array(&self.velocity)),
        )
    }
}

/// The first values; zeros where there are none.
fn array<const N: usize>(values: &[f64]) -> [f64; N] {
    std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0))
}
