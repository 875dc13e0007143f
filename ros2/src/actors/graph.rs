//! The Zenoh session, and the arm's entries in the graph.
//!
//! **Invariant:** the graph shows the arm's nodes, topics and services only while the arm is connected.

use std::rc::Rc;
use std::time::Duration;

use actix::prelude::*;
use pendularm::protocol::catalog::types;
use pendularm::protocol::catalog::{Action, Direction, Node, Rosapi, Service, Topic};
use serde_json::json;
use tokio::sync::oneshot;
use zenoh::liveliness::LivelinessToken;
use zenoh::sample::SampleKind;
use zenoh::session::TransportEvent;
use zenoh::{Config, Session, Wait};

use super::action::ActionBridge;
use super::endpoints::{Endpoints, graph_node};
use super::gateway::Gateway;
use super::publisher::Publisher;
use super::service::ServiceBridge;
use super::subscription::Subscription;
use super::{ArmPresence, Leave};
use crate::convention::hash::type_hash;
use crate::convention::{EndpointKind, Place};
use crate::interfaces::{ActionInterface, ServiceInterface};
use crate::options::Options;
use crate::report::{self, Repeated};

/// Pause between two tries to find the router.
const RETRY: Duration = Duration::from_secs(1);

/// The graph's side.
pub struct GraphBridge {
    options: Options,
    services: Vec<(Service, Rc<ServiceInterface>)>,
    actions: Vec<(Action, Rc<ActionInterface>)>,
    session: Option<Session>,
    /// `Some` while the arm is connected.
    gateway: Option<Addr<Gateway>>,
    is_arm_here: bool,
    nodes: Vec<LivelinessToken>,
    bridges: Vec<Recipient<Leave>>,
    /// The last used number of an endpoint. No number is reused, because its endpoint may still be closing.
    last_endpoint: usize,
    warning: Repeated,
}

/// The router has connected or disconnected.
#[derive(Message)]
#[rtype(result = "()")]
struct RouterChanged {
    is_here: bool,
}

impl GraphBridge {
    /// A graph with these options.
    #[must_use]
    pub fn new(options: Options) -> Self {
        let rosapi = Rosapi::ALL.into_iter().map(Service::Rosapi);
        let services = Service::ALL.into_iter().chain(rosapi);
        Self {
            options,
            services: services
                .map(|service| (service, Rc::new(ServiceInterface::of_catalogue(service))))
                .collect(),
            actions: Action::ALL
                .into_iter()
                .map(|action| (action, Rc::new(ActionInterface::of_catalogue(action))))
                .collect(),
            session: None,
            gateway: None,
            is_arm_here: false,
            nodes: Vec::new(),
            bridges: Vec::new(),
            // After the numbers of the nodes.
            last_endpoint: Node::ALL.len(),
            warning: Repeated::default(),
        }
    }

    /// Searches the router, on a separate thread.
    fn open(&mut self, ctx: &mut Context<Self>) {
        let config = match config(&self.options.router) {
            Ok(config) => config,
            Err(error) => {
                report::say(&format!("--router {}: {error}", self.options.router));
                std::process::exit(2);
            }
        };
        let (sender, receiver) = oneshot::channel();
        let news = ctx.address().recipient();
        std::thread::spawn(move || sender.send(open_session(config, news)));
        let opened = receiver.into_actor(self).map(|opened, graph, ctx| {
            match opened {
                Ok(Ok(session)) => graph.opened(session),
                Ok(Err(_)) | Err(_) => {
                    let router = &graph.options.router;
                    graph.warning.say(format!("no router at {router} yet"));
                    ctx.run_later(RETRY, Self::open);
                }
            };
        });
        ctx.spawn(opened);
    }

    fn opened(&mut self, session: Session) {
        self.session = Some(session);
        self.join();
    }

    /// Adds the arm to the graph, if both are connected.
    fn join(&mut self) {
        if !self.is_arm_here || !self.bridges.is_empty() {
            return;
        }
        if let Err(error) = self.try_join() {
            report::say(&format!("not all of the arm could join: {error}"));
        }
    }

    fn try_join(&mut self) -> zenoh::Result<()> {
        let (Some(session), Some(gateway)) = (&self.session, &self.gateway) else {
            return Ok(());
        };
        let place = Place {
            domain: self.options.domain,
            namespace: self.options.namespace.clone(),
            zid: session.zid().to_string(),
        };
        let mut endpoints = Endpoints {
            place,
            last: self.last_endpoint,
        };
        for node in Node::ALL {
            let token = endpoints.place.node_token(graph_node(node));
            self.nodes
                .push(session.liveliness().declare_token(token).wait()?);
        }
        for topic in Topic::ALL {
            let Some(one) = types::find(topic.type_name()) else {
                continue;
            };
            let hash = type_hash(one, &[]);
            let kind = match topic.direction() {
                Direction::Subscribed => EndpointKind::Subscription,
                Direction::Published if topic.is_latched() => EndpointKind::LatchedPublisher,
                Direction::Published => EndpointKind::Publisher,
            };
            let endpoint = endpoints.next(topic.owner(), kind, topic.name(), one.name, &hash);
            let gateway = gateway.clone();
            self.bridges.push(match topic.direction() {
                Direction::Published => {
                    Publisher::join(session, topic, one, endpoint, gateway)?.recipient()
                }
                Direction::Subscribed => {
                    Subscription::join(session, topic, one, endpoint, gateway)?.recipient()
                }
            });
        }
        for (service, interface) in &self.services {
            let endpoint = endpoints.service(service.owner(), service.name(), interface);
            let interface = Rc::clone(interface);
            let bridge =
                ServiceBridge::join(session, *service, interface, endpoint, gateway.clone())?;
            self.bridges.push(bridge.recipient());
        }
        for (action, interface) in &self.actions {
            let interface = Rc::clone(interface);
            let bridge =
                ActionBridge::join(session, *action, interface, &mut endpoints, gateway.clone())?;
            self.bridges.push(bridge.recipient());
        }
        self.last_endpoint = endpoints.last;
        self.say_joined();
        Ok(())
    }

    fn say_joined(&self) {
        let published = |topic: &Topic| topic.direction() == Direction::Published;
        let out = Topic::ALL.iter().filter(|topic| published(topic)).count();
        report::say(&format!(
            "the arm at {} is in domain {} as {}: {} nodes, {out} topics out, {} in, {} services, {} actions",
            self.options.connect,
            self.options.domain,
            match self.options.namespace.as_str() {
                "" => "/",
                namespace => namespace,
            },
            Node::ALL.len(),
            Topic::ALL.len() - out,
            self.services.len(),
            self.actions.len()
        ));
    }

    fn leave(&mut self) {
        for bridge in self.bridges.drain(..) {
            bridge.do_send(Leave);
        }
        self.nodes.clear();
    }
}

impl Actor for GraphBridge {
    type Context = Context<Self>;

    fn started(&mut self, ctx: &mut Self::Context) {
        let connect = self.options.connect.clone();
        let token = self.options.token.take();
        let gateway = Gateway::new(connect, token, ctx.address().recipient());
        self.gateway = Some(gateway.start());
        self.open(ctx);
    }
}

impl Handler<ArmPresence> for GraphBridge {
    type Result = ();

    fn handle(&mut self, news: ArmPresence, _: &mut Self::Context) {
        self.is_arm_here = news == ArmPresence::Here;
        match news {
            ArmPresence::Here => self.join(),
            ArmPresence::Gone => self.leave(),
        }
    }
}

impl Handler<RouterChanged> for GraphBridge {
    type Result = ();

    fn handle(&mut self, RouterChanged { is_here }: RouterChanged, _: &mut Self::Context) {
        let router = &self.options.router;
        // Zenoh reconnects by itself, and declares everything again.
        if is_here {
            report::say(&format!("connected to the router at {router}"));
        } else {
            report::say(&format!("lost the router at {router}; reconnecting"));
        }
    }
}

/// Opens a session, and reports when the router connects and disconnects. Zenoh blocks here, which is not allowed on a
/// thread of an asynchronous runtime.
fn open_session(config: Config, news: Recipient<RouterChanged>) -> zenoh::Result<Session> {
    let session = zenoh::open(config).wait()?;
    let info = session.info();
    let listener = info.transport_events_listener().history(true);
    let tell = move |event: TransportEvent| {
        news.do_send(RouterChanged {
            is_here: event.kind() == SampleKind::Put,
        });
    };
    listener.callback(tell).background().wait()?;
    Ok(session)
}

/// A session that connects only to the router. It neither listens nor scouts.
fn config(router: &str) -> zenoh::Result<Config> {
    let config = json!({
        "mode": "client",
        "connect": {"endpoints": [router]},
        "listen": {"endpoints": []},
        "scouting": {"multicast": {"enabled": false}, "gossip": {"enabled": false}},
        // Latched messages are stored by time.
        "timestamping": {"enabled": true},
    });
    Config::from_json5(&config.to_string())
}
