//! The limits of the motors, and the forms of anti-windup: what the integral does while an effort is at its limit.
//!
//! With a limit `L` of a joint, its motor applies `sat(τ) = max(-L, min(τ, L))`. The integral is that of the control law
//! (`math/pid.rs`), with one difference for each form:
//!
//! | form | the integral after a run of the law over `dt` |
//! | --- | --- |
//! | `clamp` | `clamp(I + e dt, -I_max, +I_max)` |
//! | `none` | `I + e dt` |
//! | `conditional` | `I` while the effort is at its limit and the error would drive it further, else `I + e dt` |
//! | `back_calculation` | `I + e dt + min(dt / Tt, 1) (sat(τ) - τ) / ki`, with the tracking time `Tt` |
//!
//! Source: Åström and Hägglund, *PID Controllers*, 2nd ed. (1995), section 3.5. A tracking time shorter than the control
//! period counts as the control period, which removes the whole excess at once.
//!
//! **Invariant:** without a limit and with `clamp`, the law is that of `math/pid.rs`, bit for bit.

#![allow(
    clippy::indexing_slicing,
    reason = "every index comes from `array::from_fn` over arrays of the same constant length"
)]

use super::arm::State;
use super::number::Number;
use super::pid::{Control, INTEGRAL_LIMIT, Pid};

/// What the integral does while an effort is at its limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum AntiWindup {
    /// It grows up to [`INTEGRAL_LIMIT`].
    #[default]
    Clamp,
    /// It grows without bound.
    None,
    /// It stops while the error would drive the effort further beyond its limit.
    Conditional,
    /// It is driven back by the excess of the effort.
    BackCalculation,
}

impl AntiWindup {
    /// All forms, the default first.
    pub const ALL: [Self; 4] = [
        Self::Clamp,
        Self::None,
        Self::Conditional,
        Self::BackCalculation,
    ];

    /// The name that requests and messages use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Clamp => "clamp",
            Self::None => "none",
            Self::Conditional => "conditional",
            Self::BackCalculation => "back_calculation",
        }
    }
}

/// Bounds of the efforts that the motors apply, and the anti-windup of the controller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits<const N: usize> {
    /// The largest effort of each joint \[N m\], not negative; 0 is a joint without a motor, and infinity one without a
    /// limit. `None`: no limit.
    pub effort: Option<[f64; N]>,
    /// The form of anti-windup.
    pub anti_windup: AntiWindup,
    /// Time in which [`AntiWindup::BackCalculation`] removes an excess \[s\], greater than 0.
    pub tracking_time: f64,
}

/// No limit. The tracking time is about the geometric mean of `kp/ki` and `kd/kp` of the default gains.
impl<const N: usize> Default for Limits<N> {
    fn default() -> Self {
        Self {
            effort: None,
            anti_windup: AntiWindup::Clamp,
            tracking_time: 0.2,
        }
    }
}

impl<const N: usize> Limits<N> {
    /// Whether they change nothing.
    pub(super) fn are_absent(&self) -> bool {
        self.effort.is_none() && self.anti_windup == AntiWindup::Clamp
    }

    /// The effort that the motors apply if this one is demanded \[N m\].
    #[must_use]
    pub fn applied(&self, demanded: [f64; N]) -> [f64; N] {
        match &self.effort {
            None => demanded,
            Some(limit) => {
                let mut applied = demanded;
                for i in 0..N {
                    applied[i] = bounded(demanded[i], limit[i]);
                }
                applied
            }
        }
    }

    /// The joints whose motor is at its limit if this effort is demanded \[N m\]. A joint without a motor is not.
    #[must_use]
    pub fn reached(&self, demanded: &[f64; N]) -> [bool; N] {
        match &self.effort {
            None => [false; N],
            Some(limit) => std::array::from_fn(|i| limit[i] > 0.0 && demanded[i].abs() >= limit[i]),
        }
    }

    /// The control law for a period of `dt` \[s\] that starts at `state`, with these limits.
    #[must_use]
    pub fn control(&self, pid: &Pid<N>, state: &State<N>, dt: f64) -> Control<N> {
        if self.are_absent() {
            return pid.control(state, dt);
        }
        // A loop, because the compiler does not inline a closure for each joint.
        let mut control = Control {
            effort: [0.0; N],
            integral: *pid.integral(),
        };
        for i in 0..N {
            let limit = self.effort.map_or(f64::INFINITY, |effort| effort[i]);
            let (integral, effort) = self.joint(pid, state, i, limit, dt);
            control.integral[i] = integral;
            control.effort[i] = bounded(effort, limit);
        }
        control
    }

    /// The integral \[rad s\] of joint `i` after a period, and its effort without the limit \[N m\].
    #[inline(always)]
    fn joint(&self, pid: &Pid<N>, state: &State<N>, i: usize, limit: f64, dt: f64) -> (f64, f64) {
        let (gains, setpoint) = (pid.gains(), pid.setpoint());
        let error = setpoint.position[i] - state.position[i];
        let velocity_error = setpoint.velocity[i] - state.velocity[i];
        let demanded = |integral: f64| {
            gains.kp[i] * error + gains.ki[i] * integral + gains.kd[i] * velocity_error
        };
        let before = pid.integral()[i];
        let integral = before + error * dt;
        match self.anti_windup {
            AntiWindup::Clamp => {
                let integral = integral.clamped(INTEGRAL_LIMIT);
                (integral, demanded(integral))
            }
            AntiWindup::None => (integral, demanded(integral)),
            AntiWindup::Conditional => {
                let effort = demanded(integral);
                if effort.abs() >= limit && effort * error > 0.0 {
                    (before, demanded(before))
                } else {
                    (integral, effort)
                }
            }
            AntiWindup::BackCalculation => {
                let effort = demanded(integral);
                let excess = bounded(effort, limit) - effort;
                if excess == 0.0 || gains.ki[i] <= 0.0 {
                    (integral, effort)
                } else {
                    let share = (dt / self.tracking_time).min(1.0);
                    (integral + share * excess / gains.ki[i], effort)
                }
            }
        }
    }
}

/// `effort` within ±`limit`. The sum turns -0 into 0, which is shown without a sign.
#[inline(always)]
fn bounded(effort: f64, limit: f64) -> f64 {
    if effort.abs() <= limit {
        effort
    } else {
        effort.clamp(-limit, limit) + 0.0
    }
}
