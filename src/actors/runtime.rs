//! Starts every node in order, chooses their threads, and ends everything within a second.
//!
//! Threads: this one for the gateway (listeners, connections, registry) and the small nodes; one for the arm; a few
//! workers for heavy requests. The only place that knows threads, and the only one that looks at the number of links.
//!
//! **Invariant:** no client is accepted before every node is attached.

use std::io::Write;
use std::net::{IpAddr, Ipv6Addr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;

use actix::prelude::*;
use tokio::net::TcpListener;
use tokio::runtime::Builder;
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::time::{Instant, sleep};

use super::arm_sim::{ArmSim, Consult, joint_names};
use super::connection::gate::Gate;
use super::files;
use super::gauges::Gauges;
use super::ik::Ik;
use super::ik_action::{GoalTracker, IkAction};
use super::ik_trial::{GoalClient, IkTrial};
use super::integration::Integration;
use super::listener::{Listener, StopListening};
use super::registry::{Attach, FinishAll, Nodes, RefuseCalls, Registry};
use super::rosapi::Rosapi;
use super::rosout::Rosout;
use super::study::Study;
use super::workers::WorkerPool;
use crate::math::arm::Arm;
use crate::math::pid::Gains;
use crate::options::{Links, Options};
#[cfg(feature = "web")]
use crate::{
    options::WebOptions,
    web::{Door, access::Access, authority::Host},
};

/// What waiting calls are told when the runtime ends.
const SHUTTING_DOWN: &str = "shutting down";
/// How long computations may take to answer that they were refused, and outboxes to empty, when the runtime ends:
/// together well within the second that a signal is given.
const ANSWER_TIME: Duration = Duration::from_millis(250);
const FLUSH_TIME: Duration = Duration::from_millis(400);

/// Why the runtime could not start.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The address can't be listened on.
    #[error("cannot listen on {address}: {source}")]
    Bind {
        /// The address.
        address: SocketAddr,
        /// The operating system's reason.
        source: std::io::Error,
    },
    /// A thread or a signal handler was refused.
    #[error("cannot start: {0}")]
    Start(#[from] std::io::Error),
}

/// Serves clients until SIGINT or SIGTERM.
///
/// # Errors
/// If the port can't be bound, or the operating system refuses a thread or a signal handler.
pub fn run(options: &Options) -> Result<(), RunError> {
    System::new().block_on(serve(options))
}

async fn serve(options: &Options) -> Result<(), RunError> {
    let mut interrupt = signal(SignalKind::interrupt())?;
    let mut terminate = signal(SignalKind::terminate())?;
    let sockets = bind(options).await?;
    let address = sockets
        .first()
        .and_then(|socket| socket.local_addr().ok())
        .unwrap_or(options.bind);

    let gauges = Arc::new(Gauges::default());
    let registry = Registry::new(Arc::clone(&gauges))
        .serving_at_most(files::make_room())
        .start();
    let workers = WorkerPool::start(WorkerPool::default_threads())?;
    // The arm has no sockets: without them its thread sleeps on a lock instead of a poll, and wakes sooner.
    let arm_thread =
        Arbiter::try_with_tokio_rt(|| Builder::new_current_thread().enable_time().build())?;
    let mut nodes = Nodes::default();
    let rng = options
        .seed
        .map_or_else(fastrand::Rng::new, fastrand::Rng::with_seed);
    let start = match options.links {
        Links::Two => start_nodes::<2>,
        Links::Three => start_nodes::<3>,
    };
    start(&registry, &gauges, &arm_thread, &workers, rng, &mut nodes);
    let integration = Integration::new(workers.clone()).start();
    Integration::attach(&integration, &mut nodes);
    // The registry lives as long as this function: it can't be gone.
    let _ = registry.send(Attach(nodes)).await;

    let gate = Arc::new(gate(options));
    let listeners: Vec<Addr<Listener>> = sockets
        .into_iter()
        .map(|socket| {
            let (registry, gauges) = (registry.clone(), Arc::clone(&gauges));
            Listener::behind(Arc::clone(&gate), socket, registry, gauges).start()
        })
        .collect();
    announce(address);
    #[cfg(feature = "web")]
    announce_page(address, options.token.is_some());
    wait_for_signal(&mut interrupt, &mut terminate).await;

    for listener in listeners {
        listener.do_send(StopListening);
    }
    shut_down(&registry, &workers, &gauges).await;
    arm_thread.stop();
    Ok(())
}

/// What is asked of clients, and what they find behind it.
fn gate(options: &Options) -> Gate {
    Gate {
        token: options.token.clone(),
        #[cfg(feature = "web")]
        door: {
            let WebOptions {
                hosts,
                origins,
                strict_origin,
                report,
            } = options.web.clone();
            let token = options.token.clone();
            let access = Access {
                token,
                hosts,
                origins,
                strict_origin,
            };
            Door::new(access, report)
        },
    }
}

/// The arm and the nodes that know its number of links.
fn start_nodes<const N: usize>(
    registry: &Addr<Registry>,
    gauges: &Arc<Gauges>,
    arm_thread: &Arbiter,
    workers: &WorkerPool,
    rng: fastrand::Rng,
    nodes: &mut Nodes,
) where
    Gains<N>: Default,
{
    let (publish, respond) = (registry.clone().recipient(), registry.clone().recipient());
    let gauges = Arc::clone(gauges);
    let arm = ArmSim::<N>::start_in_arbiter(&arm_thread.handle(), move |_| {
        ArmSim::new(Arm::default(), Gains::default(), publish, respond, gauges)
    });
    ArmSim::attach(&arm, nodes);
    let introspection = Rosapi::new(
        registry.clone().recipient(),
        arm.clone().recipient(),
        arm.clone().recipient(),
        &joint_names::<N>(),
    );
    Rosapi::attach(&introspection.start(), nodes);
    let rosout = Rosout::new(arm.clone().recipient(), registry.clone().recipient());
    Rosout::attach(&rosout.start(), nodes);

    let study = Study::<N>::new(arm.clone().recipient(), workers.clone()).start();
    Study::attach(&study, nodes);
    arm.do_send(Consult(study.recipient()));

    let publish = registry.clone().recipient();
    let ik = Ik::<N>::new(arm.clone().recipient()).start();
    Ik::attach(&ik, nodes);
    let tracker = GoalTracker {
        track: arm.clone().recipient(),
        end: arm.clone().recipient(),
    };
    let action = IkAction::<N>::new(ik.recipient(), tracker, publish.clone()).start();
    IkAction::attach(&action, nodes);
    let goals = GoalClient {
        send: action.clone().recipient(),
        cancel: action.clone().recipient(),
        settle: action.recipient(),
    };
    let trial = IkTrial::<N>::new(arm.recipient(), goals, publish, rng).start();
    IkTrial::attach(&trial, nodes);
}

/// The address asked for; for the default one also its IPv6 twin, where that is to be had.
async fn bind(options: &Options) -> Result<Vec<TcpListener>, RunError> {
    let address = options.bind;
    let first = TcpListener::bind(address)
        .await
        .map_err(|source| RunError::Bind { address, source })?;
    let mut sockets = vec![first];
    if options.is_default_bind {
        let twin = SocketAddr::new(IpAddr::V6(Ipv6Addr::LOCALHOST), address.port());
        match TcpListener::bind(twin).await {
            Ok(socket) => sockets.push(socket),
            Err(error) => tracing::info!(address = %twin, %error, "not listening on IPv6"),
        }
    }
    Ok(sockets)
}

/// The one line on stdout. Nobody may be reading it: that is no reason to end.
fn announce(address: SocketAddr) {
    let mut stdout = std::io::stdout();
    if let Err(error) = writeln!(stdout, "listening on {address}").and_then(|()| stdout.flush()) {
        tracing::warn!(%address, %error, "standard output can't be told where this listens");
    }
    tracing::info!(%address, "serving rosbridge clients");
}

/// Where a browser finds the page. The token is not for the log.
#[cfg(feature = "web")]
fn announce_page(address: SocketAddr, asks_token: bool) {
    let host = if address.ip().is_unspecified() {
        "localhost".to_owned()
    } else {
        Host::Address(address.ip()).to_string()
    };
    let port = address.port();
    if asks_token {
        tracing::info!("page: http://{host}:{port}/?token=... (with the token, once)");
    } else {
        tracing::info!("page: http://{host}:{port}/");
    }
}

async fn wait_for_signal(interrupt: &mut Signal, terminate: &mut Signal) {
    tokio::select! {
        _ = interrupt.recv() => tracing::info!("SIGINT: shutting down"),
        _ = terminate.recv() => tracing::info!("SIGTERM: shutting down"),
    }
}

/// Refuses what waits, lets every connection send what it owes, for a bounded time.
async fn shut_down(registry: &Addr<Registry>, workers: &WorkerPool, gauges: &Gauges) {
    let _ = registry.send(RefuseCalls(SHUTTING_DOWN)).await;
    workers.close(SHUTTING_DOWN);
    until(ANSWER_TIME, || workers.is_idle()).await;
    let _ = registry.send(FinishAll).await;
    until(FLUSH_TIME, || gauges.connections() == 0).await;
}

/// Waits for `done`, but no longer than `limit`.
async fn until(limit: Duration, done: impl Fn() -> bool) {
    let deadline = Instant::now() + limit;
    while !done() && Instant::now() < deadline {
        sleep(Duration::from_millis(2)).await;
    }
}
