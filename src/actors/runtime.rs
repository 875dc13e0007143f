//! Starts every node in order, chooses their threads, and ends everything within a second.
//!
//! Threads: this one for the gateway (listeners, connections, registry) and the small nodes, one for the arm, a few
//! workers for long requests, and one that waits for signals. The gateway starts a few more for its long work. The log
//! and a record have one each. Only this file chooses the thread of a node.
//!
//! **Invariant:** no client is accepted before every node is attached.

use std::io::Write;
use std::net::{IpAddr, Ipv6Addr, SocketAddr};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use actix::prelude::*;
use tokio::net::TcpListener;
use tokio::runtime::{Builder, Runtime};
use tokio::time::{Instant, sleep, timeout_at};

use crate::actors::arm::sim::ArmSim;
use crate::actors::compute::workers::WorkerPool;
use crate::actors::gateway::connection::admission::Admission;
use crate::actors::gateway::listener::accept;
use crate::actors::gateway::registry::{Attach, FinishAll, RefuseCalls, Registry};
use crate::actors::node::{Nodes, ShutDown};
use crate::actors::panics::contain;
#[cfg(feature = "record")]
use crate::actors::recorder::{self, NotRecorded, RecordTo, Recorder};
use crate::actors::resources::gauges::Gauges;
use crate::actors::resources::listening;
use crate::actors::resources::long_work::THREADS;
use crate::actors::resources::open_files::{Capacity, make_capacity};
use crate::actors::resources::places::{MAX_NEWCOMERS, Slots};
use crate::actors::resources::priority::{lower_priority, name_thread};
use crate::actors::ros::rosout::Rosout;
use crate::actors::start;
#[cfg(feature = "web")]
use crate::address::Host;
use crate::math::arm::Arm;
use crate::math::pid::Gains;
use crate::options::{DEFAULT_BIND, Links, Options};
use crate::signals::Signals;
#[cfg(feature = "web")]
use crate::web::{Site, report};

/// A time longer than any run of the program.
const FOR_EVER: Duration = Duration::from_secs(100 * 365 * 24 * 60 * 60);
/// The reason for waiting calls when the runtime ends.
const SHUTTING_DOWN: &str = "shutting down";
/// Time for refused computations to answer, and for outboxes to empty, when the runtime ends: together well below
/// the second after a signal.
const ANSWER_TIME: Duration = Duration::from_millis(250);
const FLUSH_TIME: Duration = Duration::from_millis(400);
/// Further threads, for the files of the report. A disk that hangs occupies all of them.
const FILES: usize = {
    #[cfg(feature = "web")]
    let files = report::FILES;
    #[cfg(not(feature = "web"))]
    let files = 0;
    files
};
/// Longest time for the end of a record when the runtime ends.
#[cfg(feature = "record")]
const RECORD_TIME: Duration = Duration::from_millis(250);

/// Why the runtime could not start.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The runtime cannot listen on the address.
    #[error("cannot listen on {address}: {}", listening::remedy(source))]
    Bind {
        /// The address.
        address: SocketAddr,
        /// The operating system's reason.
        source: std::io::Error,
    },
    /// The run cannot be recorded.
    #[cfg(feature = "record")]
    #[error("cannot record: {0}")]
    Record(#[from] NotRecorded),
    /// The system refused a thread or a signal handler.
    #[error("cannot start: {0}")]
    Start(#[from] std::io::Error),
}

/// Serves clients until a signal ends it. If an orderly end takes too long, `force_exit` is called on another thread,
/// and should not return. It is boxed, because a generic runtime would be compiled again, with all its actors, in
/// every crate that runs one.
///
/// # Errors
/// If the port cannot be bound, or the operating system refuses a thread or a signal handler.
pub fn run(options: &Options, force_exit: Box<dyn FnOnce() + Send>) -> Result<(), RunError> {
    let mut signals = Signals::listen(force_exit)?;
    let tokio = Builder::new_current_thread()
        .enable_all()
        .thread_name("long-work")
        .on_thread_start(lower_priority)
        .max_blocking_threads(THREADS + FILES)
        .thread_keep_alive(FOR_EVER)
        .build()?;
    start_long_work_threads(&tokio)?;
    // Remaining answers are dropped here, as part of the end.
    System::with_tokio_rt(move || tokio).block_on(serve(options, &mut signals))
}

/// Starts all threads for long work of the gateway and for the report's files at once. None of them ends. If the system
/// refuses one, work uses the threads that exist.
fn start_long_work_threads(tokio: &Runtime) -> std::io::Result<()> {
    let all_are_busy = Arc::new(Mutex::new(()));
    let _until_all_are_there = all_are_busy.lock();
    for _ in 0..THREADS + FILES {
        let wait = Arc::clone(&all_are_busy);
        contain(|| drop(tokio.spawn_blocking(move || drop(wait.lock()))))
            .map_err(|panic| std::io::Error::other(panic.to_string()))?;
    }
    Ok(())
}

async fn serve(options: &Options, signals: &mut Signals) -> Result<(), RunError> {
    let sockets = bind(options)?;
    let address = sockets
        .first()
        .and_then(|socket| socket.local_addr().ok())
        .unwrap_or(options.bind);

    let wanted = Capacity {
        clients: options.clients,
        newcomers: MAX_NEWCOMERS,
    };
    let capacity = make_capacity(wanted, options.token.is_some());
    let gauges = Arc::<Gauges>::default();
    let registry = Registry::new(Arc::clone(&gauges))
        .serving_at_most(capacity.clients)
        .start();
    let workers = WorkerPool::start(WorkerPool::default_threads())?;
    // The arm has no sockets, so its thread sleeps on a lock instead of a poll, and wakes faster.
    let arm_thread = Arbiter::try_with_tokio_rt(|| {
        name_thread(c"arm_sim");
        Builder::new_current_thread().enable_time().build()
    })?;
    let mut nodes = Nodes::default();
    let seed = options.seed.unwrap_or_else(|| fastrand::u64(..));
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
    // The registry lives as long as this function.
    let _ = registry.send(Attach(nodes)).await;
    #[cfg(feature = "record")]
    ends.record(options).await?;

    let admission = Arc::new(admission(options, capacity.newcomers));
    let listen = |socket| {
        let (admission, gauges) = (Arc::clone(&admission), Arc::clone(&gauges));
        actix_rt::spawn(accept(socket, admission, registry.clone(), gauges))
    };
    let listeners: Vec<_> = sockets.into_iter().map(listen).collect();
    announce(address);
    #[cfg(feature = "web")]
    announce_page(address, options.token.is_some());
    let _ = (&mut signals.came).await;

    for listener in listeners {
        listener.abort();
    }
    shut_down(&registry, &ends.busy, &workers, &gauges).await;
    #[cfg(feature = "record")]
    ends.finish_record().await;
    arm_thread.stop();
    Ok(())
}

/// The conditions under which clients are admitted, by the options.
fn admission(options: &Options, newcomers: usize) -> Admission {
    Admission {
        token: options.token.clone(),
        #[cfg(feature = "web")]
        site: {
            let mut access = options.access.clone();
            access.token.clone_from(&options.token);
            Site::new(access, options.report.clone(), &options.allow_frame)
        },
        newcomers: Slots::new(newcomers),
    }
}

/// The channels that inform the nodes of an arm of the end.
struct NodeEnds {
    /// The nodes with running work for clients.
    busy: Vec<Recipient<ShutDown>>,
    #[cfg(feature = "record")]
    record: Recipient<RecordTo>,
}

#[cfg(feature = "record")]
impl NodeEnds {
    /// Starts the requested record, and the recorder for clients' records.
    async fn record(&self, options: &Options) -> Result<(), RunError> {
        let folder = options.record_dir.as_deref();
        folder.map(recorder::check_folder).transpose()?;
        if options.record.is_some()
            // The recorder lives as long as the registry.
            && let Ok(begun) = self.record.send(RecordTo(options.record.clone())).await
        {
            begun?;
        }
        Ok(())
    }

    /// Ends the record, if there is one, for a bounded time.
    async fn finish_record(&self) {
        let ended = self.record.send(RecordTo(None));
        let _ = timeout_at(Instant::now() + RECORD_TIME, ended).await;
    }
}

/// The arm on its thread, and all nodes.
fn start_nodes<const N: usize>(
    options: &Options,
    seed: u64,
    registry: &Addr<Registry>,
    gauges: &Arc<Gauges>,
    arm_thread: &Arbiter,
    workers: &WorkerPool,
    nodes: &mut Nodes,
) -> NodeEnds {
    let publish = registry.clone().recipient();
    let gauges = Arc::clone(gauges);
    let period = options.control_period;
    let arm = ArmSim::<N>::start_in_arbiter(&arm_thread.handle(), move |_| {
        ArmSim::new(Arm::default(), Gains::default(), publish, gauges).with_period(period)
    });
    let busy = start::start_nodes(&arm, registry, workers, seed, nodes);
    let rosout = Rosout::new(arm.clone().recipient(), registry.clone().recipient());
    Rosout::attach(&rosout.start(), nodes);
    #[cfg(feature = "record")]
    let recorder = {
        let folder = options.record_dir.clone();
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
        record: recorder.recipient(),
    }
}

/// The requested address. For the default one also its IPv6 counterpart, if it is available.
fn bind(options: &Options) -> Result<Vec<TcpListener>, RunError> {
    let address = options.bind;
    let first = listening::bind(address).map_err(|source| RunError::Bind { address, source })?;
    let mut sockets = vec![first];
    if address == DEFAULT_BIND {
        let twin = SocketAddr::new(IpAddr::V6(Ipv6Addr::LOCALHOST), address.port());
        match listening::bind(twin) {
            Ok(socket) => sockets.push(socket),
            Err(error) => listening::report_twin(twin, &error),
        }
    }
    Ok(sockets)
}

/// Prints the one line on standard output. A full pipe would block, so a separate thread prints it, and no
/// thread waits for that.
fn announce(address: SocketAddr) {
    let print = move || {
        let mut stdout = std::io::stdout();
        writeln!(stdout, "listening on {address}").and_then(|()| stdout.flush())
    };
    let warn = move |error| {
        tracing::warn!(%address, %error, "the address cannot be written to standard output");
    };
    let thread = thread::Builder::new().name("stdout".into());
    if let Err(error) = thread.spawn(move || print().unwrap_or_else(warn)) {
        warn(error);
    }
    tracing::info!(%address, "serving rosbridge clients");
}

/// Logs the address of the page for browsers, without the token.
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

/// Refuses waiting calls, and gives every connection a bounded time to send its queue.
async fn shut_down(
    registry: &Addr<Registry>,
    busy: &[Recipient<ShutDown>],
    workers: &WorkerPool,
    gauges: &Gauges,
) {
    let _ = registry.send(RefuseCalls(SHUTTING_DOWN)).await;
    workers.close(SHUTTING_DOWN);
    gauges.memory().close();
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
