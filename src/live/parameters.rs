//! The arm's parameters: their present values, and the effect of setting one.
//!
//! **Invariant:** a parameter has no separate value. Setting it has the effect of the service with that field.

use super::{ArmRequest, LiveArm, World};
use crate::math::simulation::Simulation;
use crate::protocol::op::fields::Rejections;
use crate::protocol::ros::parameters::Parameter;
use crate::protocol::ros::urdf;
use crate::services::Ask;
use crate::services::arm::{
    AskParameters, NotSet, ParameterChange, ParameterRequest, ParameterValue, joint_names,
};

impl<const N: usize> ArmRequest<N> for AskParameters<N> {
    /// Answers for one parameter after the other.
    fn perform<W: World<N>>(self, arm: &mut LiveArm<N, W>) -> <Self as Ask>::Answer {
        let answers = self.entries.into_iter().map(|(named, request)| {
            let answer = match request {
                ParameterRequest::Describe => Ok(None),
                ParameterRequest::Get => {
                    Ok(named.parameter.map(|one| value_of(&arm.simulation, one)))
                }
                ParameterRequest::Refuse(why) => Err(why),
                ParameterRequest::Set(change) => match set(arm, change) {
                    rejected if rejected.is_empty() => Ok(None),
                    mut rejected => {
                        if let Some(parameter) = named.parameter
                            && let Some((_, field)) = parameter.field()
                        {
                            rejected.rename(field, parameter.name());
                        }
                        Err(NotSet::Rejected(rejected))
                    }
                },
            };
            (named, answer)
        });
        answers.collect()
    }
}

/// The present value of a parameter.
fn value_of<const N: usize>(simulation: &Simulation<N>, parameter: Parameter) -> ParameterValue<N> {
    use ParameterValue::{Number, PerJoint, Text, Unset, Whole};
    let (arm, gains) = (simulation.arm(), simulation.pid().gains());
    let (limits, sensors) = (simulation.limits(), simulation.sensors());
    match parameter {
        Parameter::Gravity => Number(arm.gravity()),
        Parameter::Masses => PerJoint(*arm.masses()),
        Parameter::Lengths => PerJoint(*arm.lengths()),
        Parameter::Viscous => PerJoint(*arm.viscous()),
        Parameter::Kp => PerJoint(gains.kp),
        Parameter::Ki => PerJoint(gains.ki),
        Parameter::Kd => PerJoint(gains.kd),
        Parameter::Integrator => Text(simulation.method().name().to_owned()),
        Parameter::Timestep => Number(simulation.timestep()),
        Parameter::ControlPeriod => Number(simulation.control_period().period),
        Parameter::EffortLimit => limits.effort.map_or(Unset, PerJoint),
        Parameter::AntiWindup => Text(limits.anti_windup.name().to_owned()),
        Parameter::TrackingTime => Number(limits.tracking_time),
        Parameter::EncoderStep => PerJoint(sensors.encoder_step),
        Parameter::MeasuredVelocity => Text(sensors.velocity.name().to_owned()),
        Parameter::ControlDelay => Whole(simulation.control_period().delay),
        Parameter::RobotDescription => {
            let (lengths, masses) = (arm.lengths(), arm.masses());
            Text(urdf::describe(&joint_names::<N>(), lengths, masses))
        }
    }
}

/// Sets a parameter. Returns the rejected value.
fn set<const N: usize, W: World<N>>(
    arm: &mut LiveArm<N, W>,
    change: ParameterChange<N>,
) -> Rejections {
    match change {
        ParameterChange::Params(ask) => ask.perform(arm).rejected,
        ParameterChange::Friction(ask) => ask.perform(arm).rejected,
        ParameterChange::Gains(ask) => ask.perform(arm).rejected,
        ParameterChange::Integrator(ask) => ask.perform(arm).rejected,
        ParameterChange::Period(ask) => ask.perform(arm).rejected,
        ParameterChange::Limits(ask) => ask.perform(arm).rejected,
        ParameterChange::Sensors(ask) => ask.perform(arm).rejected,
    }
}
