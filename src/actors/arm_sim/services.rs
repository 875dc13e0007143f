//! `/arm_sim/*` and `/pid_controller/*`: every field is read alone, what is valid takes effect, and the answer echoes the
//! values as they now are.
//!
//! **Invariant:** a request that changes nothing leaves the arm exactly as it was, down to the fraction of a step.

use actix::prelude::*;
use serde::Serialize;

use super::{ArmSim, GoalJudged};
use crate::actors::node::{Reply, ServiceCall};
use crate::math::arm::{Arm, ArmError};
use crate::math::integrator::Method;
use crate::math::pid::Gains;
use crate::protocol::catalog::Service;
use crate::protocol::fields::{Bound, Fields, Rejection};
use crate::protocol::messages::Empty;
use crate::protocol::op::Arguments;

#[derive(Serialize)]
struct Integrator {
    method: &'static str,
    timestep: f64,
}

#[derive(Serialize)]
struct Parameters<'a> {
    gravity: f64,
    masses: &'a [f64],
    lengths: &'a [f64],
}

#[derive(Serialize)]
struct Switch {
    data: bool,
}

#[derive(Serialize)]
struct Pose<'a> {
    position: &'a [f64],
    velocity: &'a [f64],
}

#[derive(Serialize)]
struct GainsOf<'a> {
    kp: &'a [f64],
    ki: &'a [f64],
    kd: &'a [f64],
}

impl<const N: usize> ArmSim<N> {
    /// Answers one call. The caller's next request waits until this has returned.
    pub(super) fn serve(&mut self, call: ServiceCall, ctx: &mut Context<Self>) {
        let ServiceCall {
            service,
            arguments,
            reply,
        } = call;
        let nothing = Arguments::none();
        let mut fields = match read(&arguments, &nothing, service) {
            Ok(fields) => fields,
            Err(rejection) => return reply.conclude(&Empty {}, &rejection.to_string()),
        };
        match service {
            Service::SetIntegrator => {
                let values = self.set_integrator(&mut fields);
                reply.conclude(&values, &fields.status());
            }
            Service::SetParams => {
                self.set_params(&mut fields);
                let arm = self.simulation.arm();
                let (gravity, masses, lengths) = (arm.gravity(), arm.masses(), arm.lengths());
                reply.conclude(
                    &Parameters {
                        gravity,
                        masses,
                        lengths,
                    },
                    &fields.status(),
                );
            }
            Service::Pause => {
                let data = self.pause(&mut fields);
                reply.conclude(&Switch { data }, &fields.status());
            }
            Service::Reset => {
                // A reset has no fields: what is rejected here is `args` itself.
                let ended = if fields.accepted() {
                    self.reset()
                } else {
                    None
                };
                self.answer_reset(reply, fields.status(), ended, ctx);
            }
            Service::Step => self.step_by_hand(&mut fields, reply),
            Service::Disturb => self.disturb(&mut fields, reply),
            Service::Enable => {
                let data = self.enable(&mut fields);
                reply.conclude(&Switch { data }, &fields.status());
            }
            Service::SetGains => {
                self.set_gains(&mut fields);
                let Gains { kp, ki, kd } = self.simulation.pid().gains();
                reply.conclude(&GainsOf { kp, ki, kd }, &fields.status());
            }
            other => {
                debug_assert!(false, "{} is not the arm's", other.name());
                reply.conclude(&Empty {}, "the arm does not serve this");
            }
        }
    }

    fn set_integrator(&mut self, fields: &mut Fields) -> Integrator {
        if let Some(method) = fields.choice("method", &Method::ALL, Method::name) {
            self.simulation.set_method(method);
        }
        // Setting the timestep that is in force already must not cost the unfinished fraction of a step.
        if let Some(timestep) = fields.number("timestep", Bound::Positive)
            && timestep.to_bits() != self.simulation.timestep().to_bits()
        {
            self.simulation.set_timestep(timestep);
            self.restart_pacer();
        }
        Integrator {
            method: self.simulation.method().name(),
            timestep: self.simulation.timestep(),
        }
    }

    fn set_params(&mut self, fields: &mut Fields) {
        let gravity = fields.number("gravity", Bound::NonNegative);
        let masses = array(fields.numbers("masses", N, Bound::Positive));
        let lengths = array(fields.numbers("lengths", N, Bound::Positive));
        let arm = self.simulation.arm();
        let changed: Result<Arm<N>, ArmError> = Arm::new(
            lengths.unwrap_or(*arm.lengths()),
            masses.unwrap_or(*arm.masses()),
            gravity.unwrap_or(arm.gravity()),
        );
        match changed {
            Ok(changed) if changed != *arm => {
                self.simulation.set_arm(changed);
                self.restart_energy_drift();
                self.publish_description();
            }
            Ok(_) => {}
            // The fields were checked with the same bounds; should the two ever differ, the arm's word counts.
            Err(why) => fields.refuse("params", &why),
        }
    }

    fn pause(&mut self, fields: &mut Fields) -> bool {
        if let Some(paused) = fields.boolean("data")
            && paused != self.paused
        {
            self.paused = paused;
            self.restart_pacer();
            self.publish_diagnostics();
        }
        self.paused
    }

    /// Gives the goal that ended by it, and who is to hear of that.
    fn reset(&mut self) -> Option<(Recipient<GoalJudged<N>>, GoalJudged<N>)> {
        let ended = self.end_goal_for_reset();
        let diverged = self.simulation.divergence().is_some();
        self.simulation.reset();
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
        reply: Reply,
        status: String,
        ended: Option<(Recipient<GoalJudged<N>>, GoalJudged<N>)>,
        ctx: &mut Context<Self>,
    ) {
        let state = *self.simulation.state();
        let answer = move || {
            let pose = Pose {
                position: &state.position,
                velocity: &state.velocity,
            };
            reply.conclude(&pose, &status);
        };
        match ended {
            None => answer(),
            Some((owner, news)) => {
                let heard = owner.send(news).into_actor(self);
                ctx.spawn(heard.map(move |_, _, _| answer()));
            }
        }
    }

    fn enable(&mut self, fields: &mut Fields) -> bool {
        if let Some(on) = fields.boolean("data")
            && on != self.simulation.pid().is_enabled()
        {
            self.simulation.enable(on);
            self.restart_energy_drift();
        }
        self.simulation.pid().is_enabled()
    }

    fn set_gains(&mut self, fields: &mut Fields) {
        let mut gains = *self.simulation.pid().gains();
        for (name, values) in [
            ("kp", &mut gains.kp),
            ("ki", &mut gains.ki),
            ("kd", &mut gains.kd),
        ] {
            if let Some(given) = array(fields.numbers(name, N, Bound::NonNegative)) {
                *values = given;
            }
        }
        self.simulation.set_gains(gains);
    }
}

/// The fields of a request. Arguments that are rejected as a whole count as `nothing`, so that the answer to them, too, echoes
/// the values as they are.
fn read<'a>(
    arguments: &'a Arguments,
    nothing: &'a Arguments,
    service: Service,
) -> Result<Fields<'a>, Rejection> {
    Fields::read(arguments, service).or_else(|rejection| {
        let mut fields = Fields::read(nothing, service)?;
        fields.refuse(&rejection.field, &rejection.reason);
        Ok(fields)
    })
}

/// The values as an array; the reader has checked how many they are.
fn array<const N: usize>(values: Option<Vec<f64>>) -> Option<[f64; N]> {
    values?.try_into().ok()
}
