//! pendularm: a real-time planar robot arm that any rosbridge client can drive.
//!
//! The layers import in one direction. [`math`] is pure: the arm, the integrators, the control law. `protocol` is pure:
//! bytes and JSON. `services` and `live` use both, and are pure too. `actors` has one actor per node. `math` and
//! `protocol` do not import each other.
//!
//! In addition there are [`study`] (pure: `math` compared with theory), `report` (clock, files and drawings of the
//! study) and `web` (HTTP and WebSocket for browsers).
//!
//! | feature | default | adds |
//! | --- | --- | --- |
//! | `services` | yes | `protocol`, `services`, `live`: the live arm and its services as plain values; `score` |
//! | `runtime` | yes | `actors`, `address`, `options`, `logging`, `output`, `plan`, `signals`, and the program |
//! | `web` | yes | `web`: HTTP, the WebSocket and the page |
//! | `batch` | yes | `math::simulation::batch`: many arms in the lanes of the processor's registers |
//! | `report` | yes | `report`, with its experiments |
//! | `record` | yes | `record`: records of runs, written, read and replayed |
//! | `cli` | yes | `command`: commands for a running pendularm, completions |
//! | `conformance` | yes | `referee`, `sabotage`: the rules of the specification against any server, and servers with a fault |
//!
//! Without default features the library is [`math`] and [`study`], which is enough to step arms. Its dependencies
//! are then `glam`, `libm` and `thiserror`. With `batch`, and `fearless_simd`, a free step of Runge-Kutta 4 on x86-64
//! takes 13 % (2 links) or 16 % (3 links) fewer instructions.
//!
//! ```
//! use pendularm::math::{arm::Arm, integrator::Method, pid::{Gains, Setpoint}, simulation::Simulation};
//!
//! let arm = Arm::new([1.0, 1.0], [1.0, 1.0], 9.81)?; // lengths, masses, gravity
//! let mut simulation = Simulation::new(arm, Gains { kp: [1000.0, 250.0], ki: [3000.0, 750.0], kd: [110.0, 22.0] });
//! simulation.set_method(Method::Rk4);
//! simulation.set_timestep(0.001);
//! simulation.set_setpoint(Setpoint { position: [0.3, -0.5], velocity: [0.0; 2] });
//! simulation.enable(true);
//! assert_eq!(simulation.advance(4000), 4000, "it has not diverged");
//! assert!((simulation.state().position[0] - 0.3).abs() < 0.01);
//! # Ok::<(), pendularm::math::arm::ArmError>(())
//! ```

#[cfg(feature = "runtime")]
pub mod actors;
#[cfg(feature = "runtime")]
pub mod address;
#[cfg(feature = "cli")]
pub mod command;
#[cfg(feature = "services")]
pub mod live;
#[cfg(feature = "runtime")]
pub mod logging;
pub mod math;
#[cfg(feature = "runtime")]
pub mod options;
#[cfg(feature = "runtime")]
pub mod output;
#[cfg(feature = "runtime")]
pub mod plan;
#[cfg(feature = "services")]
pub mod protocol;
#[cfg(feature = "record")]
pub mod record;
#[cfg(feature = "conformance")]
pub mod referee;
#[cfg(feature = "report")]
pub mod report;
#[cfg(feature = "conformance")]
pub mod sabotage;
#[cfg(feature = "services")]
pub mod score;
#[cfg(feature = "services")]
pub mod services;
#[cfg(feature = "runtime")]
pub mod signals;
pub mod study;
#[cfg(feature = "runtime")]
mod value;
#[cfg(feature = "web")]
pub mod web;
