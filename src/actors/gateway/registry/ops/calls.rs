//! Calls: to the node or the client that serves them, and the responses of clients back to their callers.
//!
//! **Invariant:** every call has one response.

use std::sync::Arc;

use actix::prelude::*;
use bytes::Bytes;
use tokio::time::Instant;

use crate::actors::gateway::limits::{DEFAULT_TIMEOUT, MAX_BACKLOG};
use crate::actors::gateway::messages::{Handled, Tapped};
use crate::actors::gateway::registry::refusal::Refusal;
use crate::actors::gateway::registry::state::{FrameOrigin, Registry};
use crate::actors::gateway::registry::tables::services::{Forwarded, Services};
use crate::actors::wire::{Caller, ServiceCall};
use crate::protocol::catalog::Service;
use crate::protocol::messages;
use crate::protocol::names;
use crate::protocol::op::{Arguments, CallService};
use crate::protocol::wire::payload::Payload;
use crate::services::NoService;

impl Registry {
    /// Sends a call to the node or the client that serves it. A failure is the call's one response.
    pub(crate) fn call(
        &mut self,
        origin: FrameOrigin,
        call: CallService,
        ctx: &mut Context<Self>,
    ) -> Handled {
        let Some(client) = self.clients.get(&origin.from) else {
            return Handled::at_once();
        };
        let own = Service::from_name(&call.service);
        let refusal = if let Some(why) = self.closed {
            Err(Refusal::Closed(why))
        } else if let Some(service) = own {
            match self.nodes.services.get(&service) {
                Some(node) => {
                    self.tap.pass(Tapped::Called {
                        from: origin.from,
                        service,
                        id: origin.id.as_ref(),
                        args: call.args.payload(),
                    });
                    let name = call.service.into_boxed_str();
                    let registry = ctx.address().recipient();
                    let (caller, ended) = Caller::new(
                        registry,
                        origin.from,
                        service,
                        name,
                        origin.id,
                        Arc::clone(&client.outlets.gone),
                    );
                    node(ServiceCall {
                        service,
                        arguments: call.args,
                        caller: caller
                            .within(self.gauges.memory().clone(), self.permit.clone())
                            .with_errors(client.outlets.error_form()),
                    });
                    return Handled::by_node(ended);
                }
                None => Err(NoService::NotServed(call.service.clone()).into()),
            }
        } else {
            self.forward(&origin, &call, ctx)
        };
        if let Err(why) = refusal {
            self.refuse_call(origin.from, &call.service, origin.id.as_ref(), &why);
        }
        Handled::at_once()
    }

    /// Passes a call on to the client that provides the service.
    fn forward(
        &mut self,
        origin: &FrameOrigin,
        call: &CallService,
        ctx: &mut Context<Self>,
    ) -> Result<(), Refusal> {
        let service = call.service.as_str();
        let name = &*names::absolute(service);
        // A provider that has stopped sending provides nothing, though its services may not be withdrawn yet.
        let provider = self.services.provider(name).cloned().and_then(|provider| {
            let client = self.clients.get(&provider.connection)?;
            client
                .provided
                .contains_key(name)
                .then_some((client, provider))
        });
        let Some((client, provider)) = provider else {
            return Err(NoService::NoProvider(service.to_owned()).into());
        };
        if matches!(call.args, Arguments::Neither(_)) {
            return Err(Refusal::BadArguments);
        }
        if client.backlog() > MAX_BACKLOG {
            return Err(Refusal::ProviderBusy(service.to_owned()));
        }
        let Some(caller) = self.clients.get(&origin.from) else {
            return Ok(());
        };
        let id_bytes = origin.id.as_ref().map_or(0, Payload::allocated);
        let entry = caller.kept.enter(id_bytes + service.len(), None)?;
        let number = self.services.next_call();
        let frame = messages::call(
            &provider.spelling,
            &Services::call_id(number),
            call.args.payload(),
        );
        client.send(self.covered(frame));
        let deadline = Instant::now() + call.timeout.unwrap_or(DEFAULT_TIMEOUT);
        self.services.remember(
            number,
            Forwarded {
                caller: origin.from,
                id: origin.id.clone(),
                provider: provider.connection,
                service: service.into(),
                deadline,
                _entry: entry,
            },
        );
        self.schedule_cleanup(ctx);
        Ok(())
    }

    /// A provider's answer goes back under the caller's own id.
    pub(crate) fn complete(
        &mut self,
        origin: &FrameOrigin,
        service: &str,
        encode: impl FnOnce(&str, Option<&Payload>) -> Bytes,
    ) -> Result<(), Refusal> {
        let call = self
            .services
            .complete(origin.id.as_ref(), None, origin.from)
            .ok_or_else(|| Refusal::StaleCall(service.to_owned()))?;
        if !names::are_same(&call.service, service) {
            return self.discard_answer(&call, Refusal::OtherService(call.service.to_string()));
        }
        let Some(caller) = self.clients.get(&call.caller) else {
            return Ok(());
        };
        if caller.backlog() > MAX_BACKLOG {
            let why = Refusal::CallerBusy(call.service.to_string());
            self.answer_forwarded(&call, &why);
            return Ok(());
        }
        let frame = encode(&call.service, call.id.as_ref());
        caller.send(self.covered(frame));
        self.note_answered(call.caller);
        Ok(())
    }

    /// Fails the call that a bad answer is for, if there is one.
    pub(crate) fn fail_call(
        &mut self,
        origin: &FrameOrigin,
        service: Option<&str>,
        why: Refusal,
    ) -> Result<(), Refusal> {
        match self
            .services
            .complete(origin.id.as_ref(), service, origin.from)
        {
            Some(call) => self.discard_answer(&call, why),
            None => Err(why),
        }
    }

    /// The caller is told why its provider's answer is discarded, and so is the provider.
    fn discard_answer(&mut self, call: &Forwarded, why: Refusal) -> Result<(), Refusal> {
        let service = call.service.to_string();
        self.answer_forwarded(call, &Refusal::BadAnswer(service, Box::new(why.clone())));
        Err(why)
    }
}
