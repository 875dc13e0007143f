//! The services: the typed requests, their readers, and the writers of their answers. Both the runtime and the
//! page in one file use these functions.
//!
//! **Invariant:** these are plain values, without actors, sockets or clocks. A response has the service's name and the
//! `id` as the caller spelled them.

/// An object for a message, with its members in this order.
macro_rules! object {
    ($($member:ident: $value:expr),* $(,)?) => {{
        #[allow(non_camel_case_types, reason = "the type of a member has the member's name")]
        mod object {
            #[derive(serde::Serialize)]
            pub(super) struct Object<$($member),*> {
                $(pub(super) $member: $member,)*
            }
        }
        object::Object {
            $($member: $value,)*
        }
    }};
}

/// The writer of an answer: a function, or the members that an `Echo` shows of its values.
macro_rules! writer {
    (|$values:ident| { $($members:tt)* }) => {
        fn write(echo: Self::Answer, to: &$crate::services::Address) -> bytes::Bytes {
            let $values = &echo.values;
            to.response(&object! { $($members)* }, &echo.rejected.status())
        }
    };
    ($($write:tt)*) => { $($write)* };
}

/// A request: its answer, its fields with the expression that reads each, and the `writer` of the answer. The fields of a
/// `whole` request are all valid, or it is rejected. Of the others each field is checked alone: an invalid one never
/// prevents a valid one from taking effect, and the request has the rejections.
macro_rules! request {
    (whole $(#[$about:meta])* pub struct $request:ident$(<$n:ident>)? -> $answer:ty, |$fields:ident| {
        $($(#[$doc:meta])* $field:ident: $kind:ty = $read:expr,)*
    } $($write:tt)*) => {
        $(#[$about])*
        pub struct $request$(<const $n: usize>)? {
            $($(#[$doc])* pub $field: $kind,)*
        }

        impl$(<const $n: usize>)? $crate::services::Ask for $request$(<$n>)? {
            type Answer = $answer;

            fn read(
                service: $crate::protocol::catalog::Service,
                arguments: &$crate::protocol::op::Arguments,
            ) -> Result<Self, Rejections> {
                let mut $fields = Fields::read(arguments, service)?;
                let request = Self {
                    $($field: $read,)*
                };
                $fields.accept(request)
            }

            $($write)*
        }
    };
    ($(#[$about:meta])* pub struct $request:ident$(<$n:ident>)? -> $answer:ty, |$fields:ident| {
        $($(#[$doc:meta])* $field:ident: $kind:ty = $read:expr,)*
    } $($write:tt)*) => {
        $(#[$about])*
        #[derive(Debug, Clone, PartialEq, Default)]
        pub struct $request$(<const $n: usize>)? {
            $($(#[$doc])* pub $field: $kind,)*
            /// Fields that were not valid.
            pub rejected: Rejections,
        }

        impl$(<const $n: usize>)? $request$(<$n>)? {
            /// The request with the valid fields and the rejections.
            pub fn from_fields($fields: &mut Fields<'_>) -> Self {
                Self {
                    $($field: $read,)*
                    rejected: $fields.rejections(),
                }
            }
        }

        impl$(<const $n: usize>)? $crate::services::Ask for $request$(<$n>)? {
            type Answer = $answer;

            fn read(
                service: $crate::protocol::catalog::Service,
                arguments: &$crate::protocol::op::Arguments,
            ) -> Result<Self, Rejections> {
                Ok(Self::from_fields(&mut Fields::read_or_none(arguments, service)))
            }

            writer! { $($write)* }
        }
    };
}

pub mod arm;
pub mod goals;
pub mod study;
pub mod trajectory;
pub mod trial;

use bytes::Bytes;
use serde::Serialize;

use crate::protocol::catalog::Service;
use crate::protocol::messages::{self, ErrorForm};
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::Rejections;
use crate::protocol::wire::json::Payload;

/// Why no node or client serves a call.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NoService {
    /// The runtime has no service of that name, and no client provides it.
    #[error("no provider for service {0}")]
    NoProvider(String),
    /// The service is in the catalog, but no node serves it here.
    #[error("{0} is not served by this runtime")]
    NotServed(String),
}

/// A request of a service: the question that a node answers. Clients send it as a service call.
pub trait Ask: Sized + Send + 'static {
    /// The answer. It is a `Result` if the request may be refused.
    type Answer: Send + 'static;

    /// Reads it.
    ///
    /// # Errors
    /// If it is rejected before it reaches the node: all rejected fields, by name.
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections>;

    /// Writes the response.
    fn write(answer: Self::Answer, to: &Address) -> Bytes;
}

/// The answer to a request whose fields are checked one by one.
#[derive(Debug, Clone, PartialEq)]
pub struct Echo<T> {
    /// The values after the request.
    pub values: T,
    /// The rejected fields of the request.
    pub rejected: Rejections,
}

// ---- the response ---------------------------------------------------------------------------------------------------

/// Destination of a response, with the call's name and id.
pub struct Address {
    service: Service,
    name: Box<str>,
    id: Option<Payload>,
    /// The form in which the caller gets the reason of a failed call.
    error_form: ErrorForm,
}

impl Address {
    /// A caller that has spelled `service` as `name`.
    #[must_use]
    pub fn new(service: Service, name: Box<str>, id: Option<Payload>) -> Self {
        Self {
            service,
            name,
            id,
            error_form: ErrorForm::default(),
        }
    }

    /// The form in which the caller gets the reason of a failed call.
    #[must_use]
    pub fn with_errors(self, error_form: ErrorForm) -> Self {
        Self { error_form, ..self }
    }

    /// The service that was called.
    #[must_use]
    pub fn service(&self) -> Service {
        self.service
    }

    /// The service's name as the caller spelled it.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The caller's `id`, which the response echoes.
    #[must_use]
    pub fn id(&self) -> Option<&Payload> {
        self.id.as_ref()
    }

    /// The response with `values`; `result` is true if `status` is empty. Otherwise callers that selected the text get
    /// it in place of `values`.
    #[must_use]
    pub fn response(&self, values: &impl Serialize, status: &str) -> Bytes {
        let is_good = status.is_empty();
        if !is_good && self.error_form == ErrorForm::Text {
            return self.failure(status);
        }
        messages::response(&self.name, self.id.as_ref(), values, is_good, status)
    }

    /// The response `result: false` without values.
    #[must_use]
    pub fn failure(&self, why: &str) -> Bytes {
        messages::failure(&self.name, self.id.as_ref(), why, self.error_form)
    }

    /// The response with values, or with the reason for none.
    #[must_use]
    pub fn outcome<T: Serialize, E: ToString>(&self, outcome: Result<T, E>) -> Bytes {
        match outcome {
            Ok(values) => self.response(&values, ""),
            Err(why) => self.failure(&why.to_string()),
        }
    }
}
