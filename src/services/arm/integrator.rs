//! `/arm_sim/set_integrator`: method and timestep of the live arm.
//!
//! **Invariant:** setting the present values does not change the arm, not even the fraction of a step.

use bytes::Bytes;

use crate::math::integrator::Method;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::services::{Address, Echo};

request! {
    /// Sets method and timestep.
    pub struct SetIntegrator -> Echo<Integrator>, |fields| {
        /// The method that takes the steps.
        method: Option<Method> = fields.choice("method", &Method::ALL, Method::name),
        /// Length of a step \[s\], greater than 0.
        timestep: Option<f64> = fields.number("timestep", Bound::Positive),
    }

    fn write(Echo { values, rejected }: Echo<Integrator>, to: &Address) -> Bytes {
        let values = object! {
            method: values.method.name(),
            timestep: values.timestep,
        };
        to.response(&values, &rejected.status())
    }
}

/// The present method and timestep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Integrator {
    /// The method that takes the steps.
    pub method: Method,
    /// Length of a step \[s\].
    pub timestep: f64,
}
