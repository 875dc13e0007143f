//! The live arms that show the scenes: settings, a start, and how long to watch.
//!
//! A scene runs many arms and checks numbers. Its live arm is one of them, for a picture, and for a link that opens it
//! on the page.
//!
//! **Invariant:** every scene has a row; one that no live arm can show says why.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Write;

use crate::math::arm::{Arm, ArmError, State};
use crate::math::integrator::Method;
use crate::math::pid::{Gains, Setpoint};
use crate::math::simulation::ControlPeriod;
use crate::study::control_loop::ControlLoop;

/// Gains of the first joints: kp, ki, kd.
type LiveGains = [[f64; 2]; 3];

/// Settings of an arm of 2 or 3 links. Arrays have an entry for each link, and one more for 2 links.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LiveScene {
    /// 2 or 3.
    pub links: usize,
    /// The method.
    pub method: Method,
    /// Timestep \[s\].
    pub timestep: f64,
    /// Control period \[s\]; 0 for every step.
    pub period: f64,
    /// Whether each effort acts one period late.
    pub delay: bool,
    /// Gravity \[m/s²\].
    pub gravity: f64,
    /// Masses \[kg\].
    pub masses: [f64; 3],
    /// Lengths \[m\].
    pub lengths: [f64; 3],
    /// Gains of a 2-link arm; without them the controller is off.
    pub gains: Option<LiveGains>,
    /// Setpoint of a 2-link arm \[rad\].
    pub setpoint: [f64; 2],
    /// Joint angles at the start \[rad\].
    pub position: [f64; 3],
    /// Joint rates at the start \[rad/s\].
    pub velocity: [f64; 3],
    /// How long to watch \[s\].
    pub seconds: f64,
}

/// An arm of 2 links of 1 m and 1 kg, at rest along +x, with the controller off.
const PLAIN: LiveScene = LiveScene {
    links: 2,
    method: Method::Rk4,
    timestep: 1e-3,
    period: 0.0,
    delay: false,
    gravity: 9.81,
    masses: [1.0; 3],
    lengths: [1.0; 3],
    gains: None,
    setpoint: [0.0; 2],
    position: [0.0; 3],
    velocity: [0.0; 3],
    seconds: 5.0,
};
const PLAIN_3: LiveScene = LiveScene { links: 3, ..PLAIN };
/// The gains of several scenes.
const MILD: LiveGains = [[200.0, 100.0], [0.0; 2], [30.0, 12.0]];
const HELD: LiveScene = LiveScene {
    gains: Some(MILD),
    setpoint: [0.5, 0.8],
    seconds: 3.0,
    ..PLAIN
};

const fn light_link(mass: f64, timestep: f64, seconds: f64) -> LiveScene {
    LiveScene {
        masses: [1.0, mass, 1.0],
        timestep,
        seconds,
        ..HELD
    }
}

const fn heavy(mass: f64, timestep: f64) -> LiveScene {
    LiveScene {
        masses: [1.0, 1.0, mass],
        timestep,
        seconds: 2.0,
        ..PLAIN_3
    }
}

/// The live arm of a scene, or why there is none.
///
/// # Errors
/// The reason, as a phrase.
#[allow(clippy::too_many_lines, reason = "a table with a row for each scene")]
pub fn live(id: &str) -> Result<LiveScene, &'static str> {
    Ok(match id {
        "S01" => LiveScene {
            gravity: 0.0,
            ..PLAIN_3
        },
        "S02" => LiveScene {
            method: Method::Euler,
            position: [-FRAC_PI_2, 0.0, 0.0],
            ..PLAIN_3
        },
        "S03" => LiveScene {
            position: [FRAC_PI_2 + 1e-12, 0.0, 0.0],
            seconds: 12.0,
            ..PLAIN
        },
        "S04" => LiveScene {
            position: [-FRAC_PI_2 + 0.3, 0.0, 0.0],
            ..PLAIN
        },
        "S05" => LiveScene {
            seconds: 20.0,
            ..PLAIN
        },
        "S06" => LiveScene {
            seconds: 20.0,
            ..PLAIN_3
        },
        "S07" => LiveScene {
            gains: Some([[1e4, 1e4], [0.0; 2], [200.0, 60.0]]),
            timestep: 5e-4,
            seconds: 1.0,
            ..HELD
        },
        "S08" => LiveScene {
            gains: Some([[1e6, 1e6], [0.0; 2], [2000.0, 600.0]]),
            timestep: 5e-5,
            seconds: 0.2,
            ..HELD
        },
        "S09" => LiveScene {
            gains: Some([[200.0, 200.0], [0.0; 2], [500.0, 500.0]]),
            timestep: 1e-4,
            seconds: 10.0,
            ..HELD
        },
        "S10" => LiveScene {
            gains: Some([[1e4, 1e4], [0.0; 2], [0.0; 2]]),
            seconds: 1.0,
            ..HELD
        },
        "S11" => LiveScene {
            period: 0.01,
            ..HELD
        },
        "S12" => LiveScene {
            gravity: 0.0,
            gains: Some([[1000.0, 1000.0], [0.0; 2], [5.0, 2.0]]),
            timestep: 2e-4,
            period: 0.02,
            ..HELD
        },
        "S13" => LiveScene {
            period: 0.01,
            delay: true,
            ..HELD
        },
        "S15" => LiveScene {
            gains: Some([[100.0, 100.0], [2000.0, 2000.0], [20.0, 20.0]]),
            ..HELD
        },
        "S16" => light_link(1e-3, 2e-5, 3.0),
        "S17" => light_link(1e-6, 2e-8, 2e-3),
        "S18" => light_link(1e-9, 2e-11, 2e-6),
        "S19" => heavy(1e3, 1e-3),
        "S20" => heavy(1e6, 1e-4),
        "S21" => heavy(1e9, 2e-6),
        "S22" => LiveScene {
            position: [-FRAC_PI_2, 1e-6, 1e-6],
            seconds: 1.0,
            ..heavy(1e9, 1.6e-5)
        },
        "S23" => LiveScene {
            lengths: [1.0, 1.0, 1e3],
            ..PLAIN_3
        },
        "S24" => LiveScene {
            position: [0.7, 0.0, 0.0],
            velocity: [2.0, 0.0, 0.0],
            ..PLAIN_3
        },
        "S25" => LiveScene {
            position: [0.7, PI, PI],
            ..PLAIN_3
        },
        "S26" => LiveScene {
            gravity: 0.0,
            velocity: [1000.0, 0.0, 0.0],
            seconds: 0.1,
            ..PLAIN
        },
        "S27" => LiveScene {
            gravity: 981.0,
            seconds: 2.0,
            ..PLAIN
        },
        "S28" => LiveScene {
            position: [-FRAC_PI_2 + 0.3, 0.0, 0.0],
            timestep: 1e-6,
            seconds: 1.0,
            ..PLAIN
        },
        "S29" => LiveScene {
            position: [-FRAC_PI_2 + 0.01, 0.0, 0.0],
            timestep: 0.1,
            seconds: 20.0,
            ..PLAIN
        },
        "S30" => LiveScene {
            position: [1e8, 0.0, 0.0],
            ..PLAIN
        },
        "S31" => LiveScene {
            gains: Some([[1000.0, 250.0], [3000.0, 750.0], [110.0, 22.0]]),
            setpoint: [1e6, 1e6],
            ..HELD
        },
        "S32" => LiveScene {
            gravity: 0.0,
            gains: Some([[100.0, 100.0], [0.0; 2], [10.0, 10.0]]),
            setpoint: [1e-310, 1e-310],
            ..HELD
        },
        "S33" => LiveScene {
            lengths: [1e-160; 3],
            seconds: 1.0,
            ..PLAIN
        },
        "S37" | "S39" => PLAIN_3,
        "S38" => LiveScene {
            timestep: 8e-3,
            seconds: 2.0,
            ..PLAIN
        },
        "S14" => return Err("needs capped efforts"),
        "S34" | "S35" => return Err("refused by name"),
        "S36" => return Err("has one joint"),
        _ => return Err("not in the list"),
    })
}

/// Samples of a picture.
const SAMPLES: u64 = 120;

/// Joint angles over time, from the live arm's own steps.
#[derive(Debug, Clone, PartialEq)]
pub struct LiveRun {
    /// Time \[s\], and the angle of each joint from its start \[rad\].
    pub samples: Vec<(f64, Vec<f64>)>,
    /// Whether the next step would have left the finite numbers.
    pub diverged: bool,
}

impl LiveScene {
    /// Runs the arm.
    ///
    /// # Errors
    /// Masses, lengths or a gravity that no arm has.
    pub fn watch(&self) -> Result<LiveRun, ArmError> {
        if self.links == 2 {
            self.run::<2>()
        } else {
            self.run::<3>()
        }
    }

    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a ratio of two positive times; a cast saturates"
    )]
    fn run<const N: usize>(&self) -> Result<LiveRun, ArmError> {
        let first = |values: &[f64]| std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0));
        let arm = Arm::<N>::new(first(&self.lengths), first(&self.masses), self.gravity)?;
        let control = match self.gains {
            None => ControlLoop::free(arm),
            Some([kp, ki, kd]) => ControlLoop::new(
                arm,
                Gains {
                    kp: first(&kp),
                    ki: first(&ki),
                    kd: first(&kd),
                },
                Setpoint::at(first(&self.setpoint)),
            ),
        };
        let control = control
            .with_method(self.method)
            .with_timestep(self.timestep)
            .with_period(ControlPeriod {
                period: self.period,
                delay: self.delay,
            });
        let position: [f64; N] = first(&self.position);
        let mut simulation = control.simulation(State {
            position,
            velocity: first(&self.velocity),
        });
        let each = ((self.seconds / self.timestep).round() as u64)
            .div_ceil(SAMPLES)
            .max(1);
        let mut watched = LiveRun {
            samples: vec![(0.0, vec![0.0; N])],
            diverged: false,
        };
        while simulation.time() < self.seconds && !watched.diverged {
            watched.diverged = simulation.advance(each) < each;
            let angles = simulation.state().position.iter().zip(position);
            let angles = angles.map(|(now, start)| now - start).collect();
            watched.samples.push((simulation.time(), angles));
        }
        Ok(watched)
    }

    /// The settings as the page reads them behind the `#` of its address.
    #[must_use]
    pub fn fragment(&self) -> String {
        let list = |values: &[f64]| {
            let spelled: Vec<String> = values.iter().take(self.links).map(spelled).collect();
            spelled.join(",")
        };
        let on_off = |on: bool| if on { "on" } else { "off" };
        let mut out = format!(
            "links={}&method={}&timestep={}&gravity={}&masses={}&lengths={}",
            self.links,
            self.method.name(),
            spelled(&self.timestep),
            spelled(&self.gravity),
            list(&self.masses),
            list(&self.lengths),
        );
        // Writing to a string cannot fail.
        if let Some([kp, ki, kd]) = &self.gains {
            let _ = write!(out, "&kp={}&ki={}&kd={}", list(kp), list(ki), list(kd));
        }
        let _ = write!(
            out,
            "&period={}&delay={}&servo={}",
            spelled(&self.period),
            on_off(self.delay),
            on_off(self.gains.is_some()),
        );
        if self.gains.is_some() {
            let _ = write!(out, "&setpoint={}", list(&self.setpoint));
        }
        let _ = write!(
            out,
            "&position={}&velocity={}",
            list(&self.position),
            list(&self.velocity)
        );
        out
    }
}

/// A number as JavaScript reads it.
fn spelled(value: &f64) -> String {
    format!("{value:?}")
}
