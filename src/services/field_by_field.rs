//! Requests whose fields are taken one by one, and the answer to one that sets something.
//!
//! **Invariant:** a bad field never keeps a good one from the arm; the echoed values are those after the request.

use super::{Ask, Callable};
use crate::protocol::catalog::Service;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Fields, Rejections};

/// A question that carries the fields that were given and valid, and what was rejected.
pub trait FieldByField: Ask {
    /// The question with the fields that are valid, and with nothing rejected yet.
    fn of(fields: &mut Fields<'_>) -> Self;

    /// Its rejections.
    fn rejected(&mut self) -> &mut Rejections;

    /// The question that these fields make.
    #[must_use]
    fn request(mut fields: Fields<'_>) -> Self
    where
        Self: Sized,
    {
        let mut ask = Self::of(&mut fields);
        *ask.rejected() = fields.finish();
        ask
    }
}

impl<A: FieldByField> Callable for A {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        Ok(Self::request(Fields::read_or_none(arguments, service)))
    }
}

/// The answer to a request whose fields are taken one by one.
#[derive(Debug, Clone, PartialEq)]
pub struct Echo<T> {
    /// The values as they are now.
    pub values: T,
    /// Fields of the request that were not taken.
    pub rejected: Rejections,
}
