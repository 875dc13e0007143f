//! The questions to the arm in JSON: a row per service, how each is read, and how its response is written.
//!
//! **Invariant:** a bad field never keeps a good one from the arm, which hears of both.

use actix::prelude::*;
use bytes::Bytes;
use serde::Serialize;

use super::{
    ArmSim, Disturb, Echo, Enable, Integrator, Pause, Push, Reset, SetGains, SetIntegrator,
    SetParams, SetSetpoint, Step, Stepped, StepsEnd, joint_names,
};
use crate::actors::node::Respond;
use crate::actors::wire::{Address, Answered, Nodes, Route, Served, TopicMessage};
use crate::math::arm::{Arm, State};
use crate::math::integrator::Method;
use crate::math::pid::{Gains, Setpoint};
use crate::protocol::catalog::{Direction, Node, Service, Topic};
use crate::protocol::messages::trajectory::{TrajectoryError, joint_trajectory};
use crate::protocol::messages::{self, Empty, Level};
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, Rejections};

// ---- routes ---------------------------------------------------------------------------------------------------------

impl<const N: usize> ArmSim<N> {
    /// Enters this node's services and topics into the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        let arm = || address.clone();
        nodes.serve::<SetIntegrator>(Service::SetIntegrator, arm());
        nodes.serve::<SetParams<N>>(Service::SetParams, arm());
        nodes.serve::<Pause>(Service::Pause, arm());
        nodes.serve::<Reset<N>>(Service::Reset, arm());
        nodes.serve::<Step>(Service::Step, arm());
        nodes.serve::<Disturb<N>>(Service::Disturb, arm());
        nodes.serve::<Enable>(Service::Enable, arm());
        nodes.serve::<SetGains<N>>(Service::SetGains, arm());
        let setpoints = setpoints(arm().recipient());
        nodes.listeners.insert(Topic::JointTrajectory, setpoints);
        for topic in Topic::ALL {
            let published = topic.direction() == Direction::Published;
            if published && topic.owner() == Node::ArmSim {
                nodes.publishers.insert(topic, arm().recipient());
            }
        }
    }
}

/// Setpoints on their way to the arm; an error status for what is none.
fn setpoints<const N: usize>(arm: Recipient<SetSetpoint<N>>) -> Route<TopicMessage> {
    Box::new(move |message| match read_setpoint(&message) {
        Ok(setpoint) => arm.do_send(SetSetpoint {
            setpoint,
            done: Some(message.done),
        }),
        Err(why) => {
            let msg = format!("{}: {why}", Topic::JointTrajectory.name());
            let frame = messages::status(Level::Error, &msg, message.id.as_ref());
            message.respond.do_send(Respond {
                connection: message.connection,
                frame: frame.into(),
                service: None,
                status: Some(Level::Error),
                done: Some(message.done),
            });
        }
    })
}

fn read_setpoint<const N: usize>(message: &TopicMessage) -> Result<Setpoint<N>, TrajectoryError> {
    let request = joint_trajectory(message.msg.raw(), &joint_names::<N>())?;
    // The reader has checked how many they are.
    let array = |values: &[f64]| std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0));
    Ok(Setpoint {
        position: array(&request.position),
        velocity: array(&request.velocity),
    })
}

// ---- reading and writing ----------------------------------------------------------------------------------------------

impl Served for SetIntegrator {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        Ok(Self::request(Fields::read_or_none(arguments, service)))
    }
}

impl Answered for SetIntegrator {
    fn write(Echo { values, rejected }: Echo<Integrator>, to: &Address) -> Bytes {
        #[derive(Serialize)]
        struct Values {
            method: &'static str,
            timestep: f64,
        }
        let Integrator { method, timestep } = values;
        let method = method.name();
        to.response(&Values { method, timestep }, &rejected.status())
    }
}

impl SetIntegrator {
    /// The request that these fields make.
    #[must_use]
    pub fn request(mut fields: Fields<'_>) -> Self {
        Self {
            method: fields.choice("method", &Method::ALL, Method::name),
            timestep: fields.number("timestep", Bound::Positive),
            rejected: fields.finish(),
        }
    }
}

impl<const N: usize> Served for SetParams<N> {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        Ok(Self::request(Fields::read_or_none(arguments, service)))
    }
}

impl<const N: usize> Answered for SetParams<N> {
    fn write(Echo { values, rejected }: Echo<Arm<N>>, to: &Address) -> Bytes {
        #[derive(Serialize)]
        struct Values<'a> {
            gravity: f64,
            masses: &'a [f64],
            lengths: &'a [f64],
        }
        let values = Values {
            gravity: values.gravity(),
            masses: values.masses(),
            lengths: values.lengths(),
        };
        to.response(&values, &rejected.status())
    }
}

impl<const N: usize> SetParams<N> {
    /// The request that these fields make.
    #[must_use]
    pub fn request(mut fields: Fields<'_>) -> Self {
        let ask = Self::of(&mut fields);
        Self {
            rejected: fields.finish(),
            ..ask
        }
    }

    /// The values that these fields give; what is rejected stays with them.
    #[must_use]
    pub fn of(fields: &mut Fields<'_>) -> Self {
        Self {
            gravity: fields.number("gravity", Bound::NonNegative),
            masses: fields.array("masses", Bound::Positive),
            lengths: fields.array("lengths", Bound::Positive),
            rejected: Rejections::default(),
        }
    }
}

impl<const N: usize> Served for SetGains<N> {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        Ok(Self::request(Fields::read_or_none(arguments, service)))
    }
}

impl<const N: usize> Answered for SetGains<N> {
    fn write(Echo { values, rejected }: Echo<Gains<N>>, to: &Address) -> Bytes {
        #[derive(Serialize)]
        struct Values<'a> {
            kp: &'a [f64],
            ki: &'a [f64],
            kd: &'a [f64],
        }
        let Gains { kp, ki, kd } = &values;
        to.response(&Values { kp, ki, kd }, &rejected.status())
    }
}

impl<const N: usize> SetGains<N> {
    /// The request that these fields make.
    #[must_use]
    pub fn request(mut fields: Fields<'_>) -> Self {
        let ask = Self::of(&mut fields);
        Self {
            rejected: fields.finish(),
            ..ask
        }
    }

    /// The values that these fields give; what is rejected stays with them.
    #[must_use]
    pub fn of(fields: &mut Fields<'_>) -> Self {
        Self {
            kp: fields.array("kp", Bound::NonNegative),
            ki: fields.array("ki", Bound::NonNegative),
            kd: fields.array("kd", Bound::NonNegative),
            rejected: Rejections::default(),
        }
    }
}

#[derive(Serialize)]
struct Switch {
    data: bool,
}

/// The one field of a switch, and what was rejected.
fn read_switch(service: Service, arguments: &Arguments) -> (Option<bool>, Rejections) {
    let mut fields = Fields::read_or_none(arguments, service);
    (fields.boolean("data"), fields.finish())
}

fn write_switch(echo: &Echo<bool>, to: &Address) -> Bytes {
    let data = echo.values;
    to.response(&Switch { data }, &echo.rejected.status())
}

impl Served for Pause {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let (paused, rejected) = read_switch(service, arguments);
        Ok(Self { paused, rejected })
    }
}

impl Answered for Pause {
    fn write(echo: Echo<bool>, to: &Address) -> Bytes {
        write_switch(&echo, to)
    }
}

impl Served for Enable {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let (enabled, rejected) = read_switch(service, arguments);
        Ok(Self { enabled, rejected })
    }
}

impl Answered for Enable {
    fn write(echo: Echo<bool>, to: &Address) -> Bytes {
        write_switch(&echo, to)
    }
}

impl<const N: usize> Served for Reset<N> {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let rejected = Fields::read_or_none(arguments, service).finish();
        Ok(Self { rejected })
    }
}

impl<const N: usize> Answered for Reset<N> {
    fn write(Echo { values, rejected }: Echo<State<N>>, to: &Address) -> Bytes {
        #[derive(Serialize)]
        struct Values<'a> {
            position: &'a [f64],
            velocity: &'a [f64],
        }
        let State { position, velocity } = &values;
        to.response(&Values { position, velocity }, &rejected.status())
    }
}

impl Served for Step {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read_or_none(arguments, service);
        Ok(Self {
            steps: fields.count("steps", super::MAX_STEPS),
            rejected: fields.finish(),
        })
    }
}

impl Answered for Step {
    fn write(answer: Result<Stepped, Rejections>, to: &Address) -> Bytes {
        #[derive(Serialize)]
        struct Values {
            steps: u64,
            time: f64,
        }
        match answer {
            Ok(Stepped { steps, time, end }) => {
                let status = match end {
                    StepsEnd::AllTaken => "",
                    StepsEnd::Diverged => "steps ended early: the simulation has diverged",
                    StepsEnd::Resumed => "steps ended early: the arm has been resumed",
                };
                to.response(&Values { steps, time }, status)
            }
            Err(rejected) => to.response(&Empty {}, &rejected.status()),
        }
    }
}

impl<const N: usize> Served for Disturb<N> {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read_or_none(arguments, service);
        Ok(Self {
            effort: fields.array("effort", Bound::Finite),
            duration: fields.number("duration", Bound::Positive),
            rejected: fields.finish(),
        })
    }
}

impl<const N: usize> Answered for Disturb<N> {
    fn write(answer: Result<Push<N>, Rejections>, to: &Address) -> Bytes {
        #[derive(Serialize)]
        struct Values<'a> {
            effort: &'a [f64],
            duration: f64,
        }
        let values = answer.as_ref().map(|push| Values {
            effort: &push.effort,
            duration: push.duration,
        });
        to.outcome(values)
    }
}
