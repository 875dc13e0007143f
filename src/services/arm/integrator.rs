//! `/arm_sim/set_integrator`: method and timestep of the live arm.
//!
//! **Invariant:** setting the present values does not change the arm, not even the fraction of a step.

use bytes::Bytes;

use crate::math::integrator::Method;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::services::{Address, Answered, Ask, Echo, FieldByField};

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

/// The present method and timestep.
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

impl FieldByField for SetIntegrator {
    fn from_fields(fields: &mut Fields<'_>) -> Self {
        Self {
            method: fields.choice("method", &Method::ALL, Method::name),
            timestep: fields.number("timestep", Bound::Positive),
            rejected: fields.rejections(),
        }
    }
}

impl Answered for SetIntegrator {
    fn write(Echo { values, rejected }: Echo<Integrator>, to: &Address) -> Bytes {
        let values = object! {
            method: values.method.name(),
            timestep: values.timestep,
        };
        to.response(&values, &rejected.status())
    }
}
