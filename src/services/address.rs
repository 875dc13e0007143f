//! The destination of an answer, and the form of its response.
//!
//! **Invariant:** a response has the service's name and the `id` as the caller spelled them.

use bytes::Bytes;
use serde::Serialize;

use crate::protocol::catalog::Service;
use crate::protocol::messages::{self, ErrorForm};
use crate::protocol::wire::json::Payload;

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
