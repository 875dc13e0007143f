//! Requests whose fields are checked one by one, and the answers of services that set values.
//!
//! **Invariant:** an invalid field never prevents a valid one from taking effect. The echoed values are those
//! after the request.

use super::{Ask, Callable};
use crate::protocol::catalog::Service;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Fields, Rejections};

/// A request with its valid fields and its rejections.
pub trait FieldByField: Ask {
    /// The request with the valid fields and no rejections yet.
    fn of(fields: &mut Fields<'_>) -> Self;

    /// Its rejections.
    fn rejected(&mut self) -> &mut Rejections;

    /// The request with these fields.
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

/// The answer to a request whose fields are checked one by one.
#[derive(Debug, Clone, PartialEq)]
pub struct Echo<T> {
    /// The present values.
    pub values: T,
    /// The rejected fields of the request.
    pub rejected: Rejections,
}
