//! Starts every node in order, chooses their threads, and ends everything within a second.
//!
//! Threads: this one for the gateway (listeners, connections, registry) and the small nodes; one for the arm; a few
//! workers for heavy requests; one that waits for signals; a few for long work of the gateway, and one each for the log
//! and a record, which they start themselves. The only place that decides which thread a node is on, and that looks at
//! the number of links.
//!
//! **Invariant:** no client is accepted before every node is attached.

use std::io::Write;
use std::net::{IpAddr, Ipv6Addr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;

use actix::prelude::*;
use tokio::net::TcpListener;
use tokio::runtime::Builder;
use tokio::time::{Instant, sleep, timeout_at};

use super::signals::Signals;
use crate::actors::arm::follow::{PathArm, PathFollower};
use crate::actors::arm::ik::Ik;
use crate::actors::arm::ik_action::{GoalTracker, IkAction};
use crate::actors::arm::ik_trial::{GoalClient, IkTrial};
use crate::actors::arm::sim::{ArmSim, Consult};
use crate::actors::compute::integration::Integration;
use crate::actors::compute::study::Study;
use crate::actors::compute::workers::WorkerPool;
use crate::actors::gateway::connection::admission::{Admission, Newcomers};
use crate::actors::gateway::files;
use crate::actors::gateway::listener::{Listener, StopListening};
use crate::actors::gateway::messages::{FinishAll, RefuseCalls};
use crate::actors::gateway::registry::{Attach, Registry};
use crate::actors::node::ShutDown;
use crate::actors::resources::gauges::Gauges;
use crate::actors::resources::priority::give_way;
use crate::actors::ros::parameters::Parameters;
use crate::actors::ros::rosapi::{ArmParameters, RosapiNode};
use crate::actors::ros::rosout::Rosout;
use crate::actors::ros::tf_web::TfRepublisher;
use crate::actors::wire::Nodes;
use crate::math::arm::Arm;
use crate::math::pid::Gains;
use crate::options::{Links, Options};
#[cfg(feature = "record")]
use crate::{
    actors::player::{self, NotReplayed},
    actors::recorder::{self, EndRecord, NotRecorded, RecordTo, Recorder},
};
#[cfg(feature = "web")]
use crate::{
    options::WebOptions,
    web::{Site, access::Access, authority::Host},
};

/// The answer to waiting calls when the runtime ends.
const SHUTTING_DOWN: &str = "shutting down";
/// How long computations may take to answer that they were refused, and outboxes to empty, when the runtime ends:
/// together well within the second that a signal is given.
const ANSWER_TIME: Duration = Duration::from_millis(250);
const FLUSH_TIME: Duration = Duration::from_millis(400);
/// How long the end of a record may take when the runtime ends.
#[cfg(feature = "record")]
const RECORD_TIME: Duration = Duration::from_millis(250);

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
    /// The run can't be recorded.
    #[cfg(feature = "record")]
    #[error("cannot record: {0}")]
    Record(#[from] NotRecorded),
    /// The record can't be played.
    #[cfg(feature = "record")]
    #[error(transparent)]
    Replay(#[from] NotReplayed),
    /// A thread or a signal handler was refused.
    #[error("cannot start: {0}")]
    Start(#[from] std::io::Error),
}

/// Serves clients until SIGINT or SIGTERM. Should the end that it asks for take too long, `last_resort` is called, on
/// another thread; it should not return. It is boxed because a generic runtime would be compiled anew, with all of its
/// actors, in every crate that runs one.
///
/// # Errors
/// If the port can't be bound, or the operating system refuses a thread or a signal handler.
pub fn run(options: &Options, last_resort: Box<dyn FnOnce() + Send>) -> Result<(), RunError> {
    let mut signals = Signals::hear(last_resort)?;
    // The threads that it starts are those for long work of the gateway.
    let tokio = Builder::new_current_thread()
        .enable_all()
        .on_thread_start(give_way)
        .build()?;
    // Answers that clients were owed are dropped here, which is part of the end.
    System::with_tokio_rt(move || tokio).block_on(serve(options, &mut signals))
}

async fn serve(options: &Options, signals: &mut Signals) -> Result<(), RunError> {
    let sockets = bind(options).await?;
    let address = sockets
        .first()
        .and_then(|socket| socket.local_addr().ok())
        .unwrap_or(options.bind);

    let gauges = Arc::new(Gauges::default());
    let room = files::make_room(options.token.is_some());
    let registry = Registry::new(Arc::clone(&gauges))
        .serving_at_most(room.clients)
        .start();
    let workers = WorkerPool::start(WorkerPool::default_threads())?;
    // The arm has no sockets: without them its thread sleeps on a lock instead of a poll, and wakes sooner.
    let arm_thread =
        Arbiter::try_with_tokio_rt(|| Builder::new_current_thread().enable_time().build())?;
    let mut nodes = Nodes::default();
    let seed = options.seed.unwrap_or_else(|| fastrand::u64(..));
    #[cfg(feature = "record")]
    let is_replay = start_replay(options, &registry, &arm_thread, &mut nodes)?;
    #[cfg(not(feature = "record"))]
    let is_replay = false;
    let ends = if is_replay {
        NodeEnds::default()
    } else {
        let start = match options.links {
            Links::Two => start_nodes::<2>,
            Links::Three => start_nodes::<3>,
        };
        let ends = start(
            options,
            seed,
            &registry,
            &gauges,
            &arm_thread,
            &workers,
            &mut nodes,
        );
        let integration = Integration::new(workers.clone()).start();
        Integration::attach(&integration, &mut nodes);
        ends
    };
    // The registry lives as long as this function: it can't be gone.
    let _ = registry.send(Attach(nodes)).await;
    #[cfg(feature = "record")]
    ends.record(options).await?;

    let admission = Arc::new(admission(options, room.unauthenticated));
    let listeners: Vec<Addr<Listener>> = sockets
        .into_iter()
        .map(|socket| {
            let (registry, gauges) = (registry.clone(), Arc::clone(&gauges));
            Listener::with(Arc::clone(&admission), socket, registry, gauges).start()
        })
        .collect();
    announce(address);
    #[cfg(feature = "web")]
    announce_page(address, options.token.is_some());
    let _ = (&mut signals.came).await;

    for listener in listeners {
        listener.do_send(StopListening);
    }
    shut_down(&registry, &ends.busy, &workers, &gauges).await;
    #[cfg(feature = "record")]
    ends.finish_record().await;
    arm_thread.stop();
    Ok(())
}

/// The conditions under which clients are admitted, by the options.
fn admission(options: &Options, unauthenticated: usize) -> Admission {
    Admission {
        token: options.token.clone(),
        #[cfg(feature = "web")]
        site: {
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
            Site::new(access, report)
        },
        newcomers: Newcomers::of(unauthenticated),
    }
}

/// The ways by which the nodes that know the number of links are told of the end.
#[derive(Default)]
struct NodeEnds {
    /// The nodes that have something under way for clients.
    busy: Vec<Recipient<ShutDown>>,
    #[cfg(feature = "record")]
    record: Option<Recipient<RecordTo>>,
    #[cfg(feature = "record")]
    end_record: Option<Recipient<EndRecord>>,
}

#[cfg(feature = "record")]
impl NodeEnds {
    /// Begins the record that was asked for, and sees to it that clients can have theirs.
    async fn record(&self, options: &Options) -> Result<(), RunError> {
        let folder = options.record.folder.as_deref();
        folder.map(recorder::look_into).transpose()?;
        if let (Some(file), Some(recorder)) = (&options.record.file, &self.record) {
            // The recorder lives as long as the registry: it can't be gone.
            if let Ok(begun) = recorder.send(RecordTo(file.clone())).await {
                begun?;
            }
        }
        Ok(())
    }

    /// Ends the record, if there is one, for a bounded time.
    async fn finish_record(&self) {
        if let Some(recorder) = &self.end_record {
            let _ = timeout_at(Instant::now() + RECORD_TIME, recorder.send(EndRecord)).await;
        }
    }
}

/// The arm and the nodes that know its number of links.
fn start_nodes<const N: usize>(
    options: &Options,
    seed: u64,
    registry: &Addr<Registry>,
    gauges: &Arc<Gauges>,
    arm_thread: &Arbiter,
    workers: &WorkerPool,
    nodes: &mut Nodes,
) -> NodeEnds
where
    Gains<N>: Default,
{
    let publish = registry.clone().recipient();
    let gauges = Arc::clone(gauges);
    let arm = ArmSim::<N>::start_in_arbiter(&arm_thread.handle(), move |_| {
        ArmSim::new(Arm::default(), Gains::default(), publish, gauges)
    });
    ArmSim::attach(&arm, nodes);
    let parameters = ArmParameters::of(&arm);
    Parameters::attach(&Parameters::new(parameters.clone()).start(), nodes);
    let rosapi = RosapiNode::new(registry.clone().recipient(), parameters).start();
    RosapiNode::attach(&rosapi, nodes);
    let rosout = Rosout::new(arm.clone().recipient(), registry.clone().recipient());
    Rosout::attach(&rosout.start(), nodes);

    let frames = TfRepublisher::new(arm.clone().recipient(), registry.clone().recipient());
    let frames = frames.start();
    TfRepublisher::attach(&frames, nodes);

    let study = Study::<N>::new(arm.clone().recipient(), workers.clone()).start();
    Study::attach(&study, nodes);
    arm.do_send(Consult(study.recipient()));

    let publish = registry.clone().recipient();
    let ik = Ik::<N>::new(arm.clone().recipient()).start();
    Ik::attach(&ik, nodes);
    let follower = PathFollower::new(PathArm::of(&arm)).start();
    PathFollower::attach(&follower, nodes);
    let tracker = GoalTracker::of(&arm);
    let action = IkAction::<N>::new(ik.recipient(), tracker, publish.clone()).start();
    IkAction::attach(&action, nodes);
    let busy = vec![
        arm.clone().recipient(),
        action.clone().recipient(),
        follower.recipient(),
        frames.recipient(),
    ];
    let goals = GoalClient {
        send: action.clone().recipient(),
        cancel: action.clone().recipient(),
        barrier: action.recipient(),
    };
    let rng = fastrand::Rng::with_seed(seed);
    let trial = IkTrial::<N>::new(arm.clone().recipient(), goals, publish, rng).start();
    IkTrial::attach(&trial, nodes);
    #[cfg(feature = "record")]
    let recorder = {
        let folder = options.record.folder.clone();
        let (arm, registry) = (arm.clone().recipient(), registry.clone().recipient());
        Recorder::<N>::new(arm, registry, folder, seed).start()
    };
    #[cfg(feature = "record")]
    Recorder::attach(&recorder, nodes);
    #[cfg(not(feature = "record"))]
    let _ = options;
    NodeEnds {
        busy,
        #[cfg(feature = "record")]
        record: Some(recorder.clone().recipient()),
        #[cfg(feature = "record")]
        end_record: Some(recorder.recipient()),
    }
}

/// Starts the player of the record that is to be replayed, if there is one.
#[cfg(feature = "record")]
fn start_replay(
    options: &Options,
    registry: &Addr<Registry>,
    thread: &Arbiter,
    nodes: &mut Nodes,
) -> Result<bool, RunError> {
    let Some(file) = &options.record.replay else {
        return Ok(false);
    };
    player::start(file, registry, &thread.handle(), nodes)?;
    Ok(true)
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

/// Says at which address a browser finds the page. The token is not for the log.
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

/// Refuses what waits, lets every connection send what it owes, for a bounded time.
async fn shut_down(
    registry: &Addr<Registry>,
    busy: &[Recipient<ShutDown>],
    workers: &WorkerPool,
    gauges: &Gauges,
) {
    let _ = registry.send(RefuseCalls(SHUTTING_DOWN)).await;
    workers.close(SHUTTING_DOWN);
    let answered = Instant::now() + ANSWER_TIME;
    for node in busy {
        let _ = timeout_at(answered, node.send(ShutDown(SHUTTING_DOWN))).await;
    }
    until(answered, || workers.is_idle()).await;
    let _ = registry.send(FinishAll).await;
    let flushed = Instant::now() + FLUSH_TIME;
    until(flushed, || gauges.connections() == 0).await;
}

/// Waits for `done`, but not beyond the deadline.
async fn until(deadline: Instant, done: impl Fn() -> bool) {
    while !done() && Instant::now() < deadline {
        sleep(Duration::from_millis(2)).await;
    }
}
