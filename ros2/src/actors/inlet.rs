//! A service in the graph: requests in, replies out.
//!
//! **Invariant:** every accepted request gets a response or an error with the reason.

use pendularm::protocol::ros::{cdr, cdr_reader};
use serde_json::Value;
use zenoh::liveliness::LivelinessToken;
use zenoh::query::{Query, Queryable};
use zenoh::{Session, Wait};

use crate::convention::Endpoint;
use crate::convention::attachment::Attachment;
use crate::interfaces::ServiceInterface;
use crate::report;

/// A service in the graph, while this value exists.
pub(super) struct Inlet {
    _queryable: Queryable<()>,
    _token: LivelinessToken,
}

impl Inlet {
    /// Declares a service. `take` gets every request, and returns it if there is no space for it.
    pub(super) fn new(
        session: &Session,
        endpoint: Endpoint,
        take: impl Fn(Request) -> Option<Request> + Send + Sync + 'static,
    ) -> zenoh::Result<Self> {
        let take = move |query| {
            if let Some(Request(query)) = take(Request(query)) {
                refuse(&query, "too many requests wait");
            }
        };
        let queryable = session.declare_queryable(endpoint.key).complete(true);
        Ok(Self {
            _queryable: queryable.callback(take).wait()?,
            _token: session.liveliness().declare_token(endpoint.token).wait()?,
        })
    }
}

/// A request.
pub(super) struct Request(Query);

impl Request {
    /// Its fields.
    pub(super) fn read(&self, interface: &ServiceInterface) -> Result<Value, String> {
        let bytes = self.0.payload().map(|payload| payload.to_bytes());
        let read = cdr_reader::decode(interface.request, &bytes.unwrap_or_default());
        read.map_err(|why| why.to_string())
    }

    /// Replies with a response, with the number and the id of the caller.
    pub(super) fn respond(self, interface: &ServiceInterface, response: &Value) {
        let Self(query) = self;
        let asked = query
            .attachment()
            .and_then(|bytes| Attachment::read(&bytes.to_bytes()));
        let Some(asked) = asked else {
            return refuse(&query, "a request needs an attachment");
        };
        let attachment = Attachment::now(asked.sequence, asked.gid).bytes();
        let payload = cdr::encode(interface.response, response);
        let reply = query.reply(query.key_expr(), payload);
        if let Err(error) = reply.attachment(attachment).wait() {
            report::say(&format!("{}: {error}", query.key_expr()));
        }
    }

    /// Replies with a reason, which ROS 2 clients log.
    pub(super) fn refuse(self, why: &str) {
        refuse(&self.0, why);
    }
}

fn refuse(query: &Query, why: &str) {
    if let Err(error) = query.reply_err(why).wait() {
        report::say(&format!("{}: {error}", query.key_expr()));
    }
}
