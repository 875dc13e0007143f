//! The effects of requests on the arm.
//!
//! **Invariant:** a request with the present values does not change the arm, not even the fraction of a step.
//! Setting a switch to its present position only ends a commanded effort.

use super::{LiveArm, World};
use crate::math::arm::{Arm, State};
use crate::math::kinematics::Unreachable;
use crate::math::limits::Limits;
use crate::math::pid::Gains;
use crate::math::simulation::{ArmInput, ControlPeriod};
use crate::protocol::op::fields::Rejections;
use crate::services::arm::{
    DIVERGED, Disturb, Enable, GetTime, Integrator, Pause, PeriodInForce, Push, Reset,
    SensorsInForce, SetFriction, SetGains, SetIntegrator, SetLimits, SetParams, SetPeriod,
    SetSensors, SetState,
};
use crate::services::goals::Solve;
use crate::services::{Ask, Echo};

/// A request that the arm answers at once.
pub trait ArmRequest<const N: usize>: Ask {
    /// Executes the request.
    fn perform<W: World<N>>(self, arm: &mut LiveArm<N, W>) -> Self::Answer;

    /// Whether the answer must wait until all earlier news of goals have been sent.
    fn waits_for_news<W: World<N>>(_arm: &LiveArm<N, W>) -> bool {
        false
    }
}

impl<const N: usize> ArmRequest<N> for Disturb<N> {
    fn perform<W: World<N>>(self, arm: &mut LiveArm<N, W>) -> Result<Push<N>, Rejections> {
        let mut rejected = self.rejected;
        if arm.simulation.divergence().is_some() {
            rejected.refuse("effort", &DIVERGED);
        }
        match (self.effort, self.duration) {
            (Some(effort), Some(duration)) if rejected.is_empty() => {
                arm.change(ArmInput::Disturbance { effort, duration });
                Ok(Push { effort, duration })
            }
            _ => Err(rejected),
        }
    }
}

impl<const N: usize> ArmRequest<N> for SetGains<N> {
    fn perform<W: World<N>>(self, arm: &mut LiveArm<N, W>) -> Echo<Gains<N>> {
        let gains = self.applied_to(arm.simulation.pid().gains());
        if [self.kp, self.ki, self.kd].iter().any(Option::is_some) {
            arm.change(ArmInput::Gains(gains));
        }
        Echo {
            values: *arm.simulation.pid().gains(),
            rejected: self.rejected,
        }
    }
}

impl<const N: usize> ArmRequest<N> for SetIntegrator {
    fn perform<W: World<N>>(self, arm: &mut LiveArm<N, W>) -> Echo<Integrator> {
        if let Some(method) = self.method {
            arm.change(ArmInput::Method(method));
        }
        // Setting the present timestep must not discard the unfinished fraction of a step.
        let present = arm.simulation.timestep().to_bits();
        if let Some(timestep) = self.timestep.filter(|new| new.to_bits() != present) {
            arm.change(ArmInput::Timestep(timestep));
            arm.restart_pacer();
        }
        Echo {
            values: Integrator {
                method: arm.simulation.method(),
                timestep: arm.simulation.timestep(),
            },
            rejected: self.rejected,
        }
    }
}

impl<const N: usize> ArmRequest<N> for GetTime {
    fn perform<W: World<N>>(self, arm: &mut LiveArm<N, W>) -> f64 {
        arm.simulation.time()
    }
}

impl<const N: usize> ArmRequest<N> for Solve<N> {
    fn perform<W: World<N>>(self, arm: &mut LiveArm<N, W>) -> Result<[f64; N], Unreachable> {
        arm.solve(&self.0)
    }
}

/// The arm is replaced as a whole, or not at all.
impl<const N: usize> ArmRequest<N> for SetParams<N> {
    fn perform<W: World<N>>(self, arm: &mut LiveArm<N, W>) -> Echo<Arm<N>> {
        let present = *arm.simulation.arm();
        let changed = self.applied_to(&present);
        let mut rejected = self.rejected;
        match changed {
            Ok(changed) if changed != present => {
                arm.change(ArmInput::Arm(changed));
                arm.restart_energy_drift();
                arm.publish_description(&present);
            }
            Ok(_) => {}
            // The fields were checked with the same bounds. If the two differ, the arm's error counts.
            Err(why) => rejected.refuse("params", &why),
        }
        let values = *arm.simulation.arm();
        Echo { values, rejected }
    }
}

impl<const N: usize> ArmRequest<N> for SetPeriod {
    fn perform<W: World<N>>(self, arm: &mut LiveArm<N, W>) -> Echo<PeriodInForce> {
        let present = arm.simulation.control_period();
        let period = ControlPeriod {
            period: self.period.unwrap_or(present.period),
            delay: self.delay.map_or(present.delay, u8::from),
        };
        if period != present {
            arm.change(ArmInput::Period(period));
        }
        Echo {
            values: PeriodInForce {
                period,
                effective: period.effective(arm.simulation.timestep()),
            },
            rejected: self.rejected,
        }
    }
}

impl<const N: usize> ArmRequest<N> for SetFriction<N> {
    fn perform<W: World<N>>(self, arm: &mut LiveArm<N, W>) -> Echo<[f64; N]> {
        let present = *arm.simulation.arm();
        let mut rejected = self.rejected;
        match self.viscous.map(|viscous| present.with_friction(viscous)) {
            Some(Ok(changed)) if changed != present => {
                arm.change(ArmInput::Arm(changed));
                arm.restart_energy_drift();
            }
            Some(Err(why)) => rejected.refuse("viscous", &why),
            _ => {}
        }
        let values = *arm.simulation.arm().viscous();
        Echo { values, rejected }
    }
}

impl<const N: usize> ArmRequest<N> for SetLimits<N> {
    fn perform<W: World<N>>(self, arm: &mut LiveArm<N, W>) -> Echo<Limits<N>> {
        let present = *arm.simulation.limits();
        let values = self.applied_to(&present);
        if values != present {
            arm.change(ArmInput::Limits(values));
            arm.loads.restart();
        }
        Echo {
            values,
            rejected: self.rejected,
        }
    }
}

impl<const N: usize> ArmRequest<N> for SetSensors<N> {
    fn perform<W: World<N>>(self, arm: &mut LiveArm<N, W>) -> Echo<SensorsInForce<N>> {
        let period = arm.simulation.control_period();
        let present = SensorsInForce {
            sensors: *arm.simulation.sensors(),
            delay: period.delay,
        };
        let values = self.applied_to(&present);
        if values.sensors != present.sensors {
            arm.change(ArmInput::Sensors(values.sensors));
        }
        if values.delay != present.delay {
            let delay = values.delay;
            arm.change(ArmInput::Period(ControlPeriod { delay, ..period }));
        }
        Echo {
            values,
            rejected: self.rejected,
        }
    }
}

/// The result of a goal that it ends is published before the answer.
impl<const N: usize> ArmRequest<N> for Reset<N> {
    fn perform<W: World<N>>(self, arm: &mut LiveArm<N, W>) -> Echo<State<N>> {
        if self.rejected.is_empty() {
            let diverged = arm.simulation.divergence().is_some();
            arm.end_goal_for_reset();
            arm.change(ArmInput::Reset);
            arm.goals.setpoint_waits = false;
            arm.paused_at = arm.simulation.time();
            arm.restart_pacer();
            arm.restart_energy_drift();
            if diverged {
                arm.publish_new_state();
            }
        }
        Echo {
            values: *arm.simulation.state(),
            rejected: self.rejected,
        }
    }

    fn waits_for_news<W: World<N>>(_: &LiveArm<N, W>) -> bool {
        true
    }
}

impl<const N: usize> ArmRequest<N> for SetState<N> {
    fn perform<W: World<N>>(self, arm: &mut LiveArm<N, W>) -> Echo<State<N>> {
        if self.position.is_some() || self.velocity.is_some() {
            let present = *arm.simulation.state();
            let had_diverged = arm.simulation.divergence().is_some();
            arm.change(ArmInput::State(State {
                position: self.position.unwrap_or(present.position),
                velocity: self.velocity.unwrap_or(present.velocity),
            }));
            arm.restart_energy_drift();
            if had_diverged {
                // Simulation time did not pass meanwhile.
                arm.restart_pacer();
                arm.publish_new_state();
            }
        }
        Echo {
            values: *arm.simulation.state(),
            rejected: self.rejected,
        }
    }
}

impl<const N: usize> ArmRequest<N> for Pause {
    fn perform<W: World<N>>(self, arm: &mut LiveArm<N, W>) -> Echo<bool> {
        if self.paused == Some(true) {
            // An arm that was stepped while paused counts as paused from here.
            arm.paused_at = arm.simulation.time();
        }
        let present = arm.paused;
        if let Some(paused) = self.paused.filter(|&paused| paused != present) {
            arm.paused = paused;
            arm.restart_pacer();
            if paused {
                arm.publish_diagnostics();
            } else {
                arm.publish_new_state();
            }
        }
        Echo {
            values: arm.paused,
            rejected: self.rejected,
        }
    }

    fn waits_for_news<W: World<N>>(arm: &LiveArm<N, W>) -> bool {
        arm.paused
    }
}

impl<const N: usize> ArmRequest<N> for Enable {
    fn perform<W: World<N>>(self, arm: &mut LiveArm<N, W>) -> Echo<bool> {
        let is_on = arm.simulation.pid().is_enabled();
        let mut command = arm.simulation.command().iter();
        let commanded = command.any(|effort| *effort != 0.0);
        if let Some(on) = self.enabled.filter(|&on| on != is_on || commanded) {
            arm.change(ArmInput::Enabled(on));
            arm.goals.setpoint_waits = false;
            arm.restart_energy_drift();
        }
        Echo {
            values: arm.simulation.pid().is_enabled(),
            rejected: self.rejected,
        }
    }

    /// A path ends when the controller is switched off, before the answer.
    fn waits_for_news<W: World<N>>(arm: &LiveArm<N, W>) -> bool {
        !arm.simulation.pid().is_enabled()
    }
}
