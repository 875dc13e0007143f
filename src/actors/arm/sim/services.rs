//! The questions to the arm: `/arm_sim/*` and `/pid_controller/*`, and setpoints.
//!
//! A request carries what was given and valid, field by field, and what was rejected, by name. What is valid takes
//! effect, and the answer echoes the values as they now are.
//!
//! **Invariant:** a request that changes nothing leaves the arm exactly as it was, down to the fraction of a step.

use actix::prelude::*;

use super::{ArmSim, GoalJudged};
use crate::actors::gateway::awake::stay_awake;
use crate::actors::node::{Ask, Call, Done, Reply};
use crate::math::arm::{Arm, ArmError, State};
use crate::math::integrator::Method;
use crate::math::pid::{Gains, Setpoint};
use crate::math::simulation::ArmInput;
use crate::protocol::op::fields::Rejections;

// ---- messages -------------------------------------------------------------------------------------------------------

/// The answer to a request whose fields are taken one by one.
#[derive(Debug, Clone, PartialEq)]
pub struct Echo<T> {
    /// The values as they are now.
    pub values: T,
    /// Fields of the request that were not taken.
    pub rejected: Rejections,
}

/// Sets method and timestep.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SetIntegrator {
    /// The method that takes the steps.
    pub method: Option<Method>,
    /// Length of a step \[s\], greater than 0.
    pub timestep: Option<f64>,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

/// Method and timestep in force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Integrator {
    /// The method that takes the steps.
    pub method: Method,
    /// Length of a step \[s\].
    pub timestep: f64,
}

impl Ask for SetIntegrator {
    type Answer = Echo<Integrator>;
}

/// Sets the arm's parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct SetParams<const N: usize> {
    /// \[m/s²\], at least 0.
    pub gravity: Option<f64>,
    /// \[kg\], greater than 0.
    pub masses: Option<[f64; N]>,
    /// \[m\], greater than 0.
    pub lengths: Option<[f64; N]>,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

impl<const N: usize> Default for SetParams<N> {
    fn default() -> Self {
        Self {
            gravity: None,
            masses: None,
            lengths: None,
            rejected: Rejections::default(),
        }
    }
}

impl<const N: usize> SetParams<N> {
    /// The arm that `arm` becomes.
    ///
    /// # Errors
    /// If there can't be such an arm.
    pub fn applied_to(&self, arm: &Arm<N>) -> Result<Arm<N>, ArmError> {
        Arm::new(
            self.lengths.unwrap_or(*arm.lengths()),
            self.masses.unwrap_or(*arm.masses()),
            self.gravity.unwrap_or(arm.gravity()),
        )
    }
}

impl<const N: usize> Ask for SetParams<N> {
    type Answer = Echo<Arm<N>>;
}

/// Sets the controller's gains, each at least 0.
#[derive(Debug, Clone, PartialEq)]
pub struct SetGains<const N: usize> {
    /// \[N m/rad\].
    pub kp: Option<[f64; N]>,
    /// \[N m/(rad s)\].
    pub ki: Option<[f64; N]>,
    /// \[N m s/rad\].
    pub kd: Option<[f64; N]>,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

impl<const N: usize> Default for SetGains<N> {
    fn default() -> Self {
        Self {
            kp: None,
            ki: None,
            kd: None,
            rejected: Rejections::default(),
        }
    }
}

impl<const N: usize> SetGains<N> {
    /// The gains that `gains` become.
    #[must_use]
    pub fn applied_to(&self, gains: &Gains<N>) -> Gains<N> {
        Gains {
            kp: self.kp.unwrap_or(gains.kp),
            ki: self.ki.unwrap_or(gains.ki),
            kd: self.kd.unwrap_or(gains.kd),
        }
    }
}

impl<const N: usize> Ask for SetGains<N> {
    type Answer = Echo<Gains<N>>;
}

/// Freezes or resumes simulation time. The answer is whether it is frozen.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Pause {
    /// True to freeze it.
    pub paused: Option<bool>,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

impl Ask for Pause {
    type Answer = Echo<bool>;
}

/// Switches the controller on or off. The answer is whether it is on.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Enable {
    /// True to switch it on.
    pub enabled: Option<bool>,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

impl Ask for Enable {
    type Answer = Echo<bool>;
}

/// Puts the arm back to its starting pose at time 0, unless something was rejected.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Reset<const N: usize> {
    /// A reset has no fields: what is rejected is the request as a whole.
    pub rejected: Rejections,
}

impl<const N: usize> Ask for Reset<N> {
    type Answer = Echo<State<N>>;
}

/// A setpoint for the controller, from the next step on. From clients, by `/joint_trajectory`.
#[derive(Message)]
#[rtype(result = "()")]
pub struct SetSetpoint<const N: usize> {
    /// The joint state to be held.
    pub setpoint: Setpoint<N>,
    /// Dropped when it is held.
    pub done: Option<Done>,
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<Call<SetIntegrator>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, call: Call<SetIntegrator>, ctx: &mut Context<Self>) {
        self.attend_call(ctx);
        call.reply.conclude(self.set_integrator(call.ask));
    }
}

impl<const N: usize> Handler<Call<SetParams<N>>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, call: Call<SetParams<N>>, ctx: &mut Context<Self>) {
        self.attend_call(ctx);
        call.reply.conclude(self.set_params(call.ask));
    }
}

impl<const N: usize> Handler<Call<SetGains<N>>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, call: Call<SetGains<N>>, ctx: &mut Context<Self>) {
        self.attend_call(ctx);
        call.reply.conclude(self.set_gains(call.ask));
    }
}

impl<const N: usize> Handler<Call<Pause>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, call: Call<Pause>, ctx: &mut Context<Self>) {
        self.attend_call(ctx);
        call.reply.conclude(self.pause(call.ask));
    }
}

impl<const N: usize> Handler<Call<Enable>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, call: Call<Enable>, ctx: &mut Context<Self>) {
        self.attend_call(ctx);
        call.reply.conclude(self.enable(call.ask));
    }
}

impl<const N: usize> Handler<Call<Reset<N>>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, call: Call<Reset<N>>, ctx: &mut Context<Self>) {
        self.attend_call(ctx);
        let ended = if call.ask.rejected.is_empty() {
            self.reset()
        } else {
            None
        };
        self.answer_reset(call.reply, call.ask.rejected, ended, ctx);
    }
}

impl<const N: usize> Handler<SetSetpoint<N>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, message: SetSetpoint<N>, ctx: &mut Context<Self>) {
        self.attend(ctx);
        self.change(ArmInput::Setpoint(message.setpoint));
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl<const N: usize> ArmSim<N> {
    /// To be called at every call: who calls once is likely to call again at once.
    pub(super) fn attend_call(&mut self, ctx: &mut Context<Self>) {
        self.attend(ctx);
        stay_awake();
    }

    fn set_integrator(&mut self, ask: SetIntegrator) -> Echo<Integrator> {
        if let Some(method) = ask.method {
            self.change(ArmInput::Method(method));
        }
        // Setting the timestep that is in force already must not cost the unfinished fraction of a step.
        if let Some(timestep) = ask.timestep
            && timestep.to_bits() != self.simulation.timestep().to_bits()
        {
            self.change(ArmInput::Timestep(timestep));
            self.restart_pacer();
        }
        Echo {
            values: Integrator {
                method: self.simulation.method(),
                timestep: self.simulation.timestep(),
            },
            rejected: ask.rejected,
        }
    }

    fn set_params(&mut self, ask: SetParams<N>) -> Echo<Arm<N>> {
        let arm = self.simulation.arm();
        let changed = ask.applied_to(arm);
        let mut rejected = ask.rejected;
        match changed {
            Ok(changed) if changed != *arm => {
                self.change(ArmInput::Arm(changed));
                self.restart_energy_drift();
                self.publish_description();
            }
            Ok(_) => {}
            // The fields were checked with the same bounds; should the two ever differ, the arm's word counts.
            Err(why) => rejected.refuse("params", &why),
        }
        let values = *self.simulation.arm();
        Echo { values, rejected }
    }

    fn set_gains(&mut self, ask: SetGains<N>) -> Echo<Gains<N>> {
        let gains = ask.applied_to(self.simulation.pid().gains());
        if [ask.kp, ask.ki, ask.kd].iter().any(Option::is_some) {
            self.change(ArmInput::Gains(gains));
        }
        Echo {
            values: *self.simulation.pid().gains(),
            rejected: ask.rejected,
        }
    }

    fn pause(&mut self, ask: Pause) -> Echo<bool> {
        if let Some(paused) = ask.paused
            && paused != self.paused
        {
            self.paused = paused;
            self.restart_pacer();
            self.publish_diagnostics();
        }
        Echo {
            values: self.paused,
            rejected: ask.rejected,
        }
    }

    fn enable(&mut self, ask: Enable) -> Echo<bool> {
        if let Some(on) = ask.enabled
            && on != self.simulation.pid().is_enabled()
        {
            self.change(ArmInput::Enabled(on));
            self.restart_energy_drift();
        }
        Echo {
            values: self.simulation.pid().is_enabled(),
            rejected: ask.rejected,
        }
    }

    /// Gives the goal that ended by it, and who is to hear of that.
    fn reset(&mut self) -> Option<(Recipient<GoalJudged<N>>, GoalJudged<N>)> {
        let ended = self.end_goal_for_reset();
        let diverged = self.simulation.divergence().is_some();
        self.change(ArmInput::Reset);
        self.restart_pacer();
        self.restart_energy_drift();
        if diverged {
            self.publish_diagnostics();
        }
        ended
    }

    /// Answers with the pose after the reset, but not before the goal's owner has published how the goal ended.
    fn answer_reset(
        &self,
        reply: Reply<Echo<State<N>>>,
        rejected: Rejections,
        ended: Option<(Recipient<GoalJudged<N>>, GoalJudged<N>)>,
        ctx: &mut Context<Self>,
    ) {
        let values = *self.simulation.state();
        let echo = Echo { values, rejected };
        match ended {
            None => reply.conclude(echo),
            Some((owner, news)) => {
                let heard = owner.send(news).into_actor(self);
                ctx.spawn(heard.map(move |_, _, _| reply.conclude(echo)));
            }
        }
    }
}
