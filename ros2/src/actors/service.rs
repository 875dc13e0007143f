//! A service of the arm in the graph: a request becomes a call, and its answer the response.
//!
//! **Invariant:** every request is answered, even if the arm disconnects while it waits.

use std::rc::Rc;

use actix::prelude::*;
use pendularm::protocol::catalog::Service;
use zenoh::Session;

use super::gateway::Gateway;
use super::inlet::{Inlet, Request};
use super::{Answer, CallArm, MAILBOX};
use crate::convention::Endpoint;
use crate::interfaces::ServiceInterface;
use crate::translation;

/// A service in the graph.
pub struct ServiceBridge {
    service: Service,
    interface: Rc<ServiceInterface>,
    gateway: Addr<Gateway>,
    _inlet: Inlet,
}

/// A request.
#[derive(Message)]
#[rtype(result = "()")]
struct Requested(Request);

impl ServiceBridge {
    /// Starts it.
    ///
    /// # Errors
    /// If Zenoh refuses.
    pub fn join(
        session: &Session,
        service: Service,
        interface: Rc<ServiceInterface>,
        endpoint: Endpoint,
        gateway: Addr<Gateway>,
    ) -> zenoh::Result<Addr<Self>> {
        let mut context = Context::new();
        context.set_mailbox_capacity(MAILBOX);
        let address: Addr<Self> = context.address();
        let inlet = Inlet::new(session, endpoint, move |request| {
            let sent = address.try_send(Requested(request));
            sent.err().map(|error| error.into_inner().0)
        })?;
        Ok(context.run(Self {
            service,
            interface,
            gateway,
            _inlet: inlet,
        }))
    }
}

impl Actor for ServiceBridge {
    type Context = Context<Self>;
}

impl Handler<Requested> for ServiceBridge {
    type Result = ();

    fn handle(&mut self, Requested(request): Requested, _: &mut Self::Context) {
        let mut read = match request.read(&self.interface) {
            Ok(read) => read,
            Err(why) => return request.refuse(&why),
        };
        let asked = self.gateway.send(CallArm {
            service: self.service.name(),
            args: translation::arguments(self.service.fields(), &mut read),
        });
        let interface = Rc::clone(&self.interface);
        // This task is independent of the actor, so the request is answered even after the actor has ended.
        actix_rt::spawn(async move {
            match asked.await {
                Ok(Ok(answer)) => reply(request, &interface, answer),
                Ok(Err(why)) => request.refuse(&why),
                Err(error) => request.refuse(&error.to_string()),
            }
        });
    }
}

stops_with_the_arm!(ServiceBridge);

/// Replies with the arm's answer.
fn reply(request: Request, interface: &ServiceInterface, answer: Answer) {
    let Answer {
        values,
        is_success,
        status,
    } = answer;
    if is_success || interface.tells_outcome() {
        let response = translation::response(interface, values, is_success, &status);
        request.respond(interface, &response);
    } else {
        request.refuse(&status);
    }
}
