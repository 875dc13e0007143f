//! The reasons for which an op or a call is refused, as clients read them.
//!
//! **Invariant:** a sentence about a field begins with the field, and a sentence about a call or goal names its service
//! or action.

use super::registrations::TooMuchRegistered;
use crate::actors::resources::memory::{MAX_BACKLOG, MAX_LONG_BACKLOG};
use crate::protocol::catalog::{Action, Service, Topic};
use crate::protocol::names;
use crate::protocol::op::{Problem, Served};
use crate::services::NoService;

/// An op or a call that changed nothing.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(in crate::actors) enum Refusal {
    #[error("topic: {0} belongs to the runtime; a client can't advertise it or publish there")]
    RuntimeTopic(String),
    #[error(transparent)]
    TooMuchRegistered(#[from] TooMuchRegistered),
    #[error(
        "compression: cbor-raw needs a message type that this runtime knows; give it as type, or subscribe with cbor"
    )]
    UnknownType,
    #[error("{noun}: {1} belongs to the runtime itself", noun = .0.noun())]
    OfRuntime(Served, String),
    #[error("{noun}: this connection does not serve {1}", noun = .0.noun())]
    NotServed(Served, String),
    #[error("{noun}: the request with this id belongs to {1}", noun = .0.noun())]
    OfAnother(Served, String),
    #[error("id: no call of {0} with this id waits for this connection")]
    StaleCall(String),
    #[error("id: this connection executes no goal of {0} with this id")]
    StaleGoal(String),
    #[error("{0}")]
    Unreadable(Problem),
    #[error("the answer of {0} was discarded: {1}")]
    BadAnswer(String, Box<Self>),
    #[error("args {0}")]
    BadArguments(String),
    #[error(transparent)]
    NoService(#[from] NoService),
    #[error("the provider of {0} is gone")]
    ProviderGone(String),
    #[error("timeout: the provider of {0} did not answer in time")]
    TimedOut(String),
    #[error("the provider of {0} does not read: more than {MAX_BACKLOG} bytes wait for it")]
    ProviderBusy(String),
    #[error(
        "the provider of {0} does not read: at most {MAX_LONG_BACKLOG} bytes of long calls wait for it; call again later"
    )]
    ProviderFull(String),
    #[error(
        "the answer of {0} was discarded: more than {MAX_BACKLOG} bytes wait for this connection"
    )]
    CallerBusy(String),
    #[error(
        "the answer of {0} was discarded: at most {MAX_LONG_BACKLOG} bytes of long answers wait for this connection"
    )]
    CallerFull(String),
    #[error("id: no goal of {0} with this id was sent by this connection")]
    NoGoal(String),
    #[error(
        "goal_info must be left out: this service cancels all goals of its action, and cancel_action_goal one of them"
    )]
    OneGoal,
    #[error("action: no action is called {0}")]
    NoAction(String),
    #[error("action_type must be {0}")]
    ActionType(&'static str),
    #[error("{0}")]
    Closed(&'static str),
}

/// Refuses to publish on topics that only the runtime may publish. Returns the topic of that name to which the runtime
/// subscribes, if there is one.
pub(in crate::actors) fn check_published(topic: &str) -> Result<Option<Topic>, Refusal> {
    match Topic::from_name(topic) {
        Some(own) if !own.is_subscribed() => Err(Refusal::RuntimeTopic(topic.to_owned())),
        own => Ok(own),
    }
}

/// Refuses to serve the services and actions of the runtime.
pub(in crate::actors) fn check_served(kind: Served, name: &str) -> Result<(), Refusal> {
    let is_own = match kind {
        Served::Service => {
            let action = names::cancelled_action(name).and_then(Action::from_name);
            Service::from_name(name).is_some() || action.is_some()
        }
        Served::Action => Action::from_name(name).is_some(),
    };
    if is_own {
        return Err(Refusal::OfRuntime(kind, name.to_owned()));
    }
    Ok(())
}
