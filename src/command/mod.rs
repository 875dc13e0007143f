//! Commands for a running pendularm, with the names of `ros2`: each connects, calls or subscribes, and prints.
//!
//! A command is an ordinary client over TCP. It shares only the protocol with the runtime.
//!
//! **Invariant:** no answer, closed pipe or signal makes a command panic. The exit status shows how it ended.

mod call;
mod output;
mod parameters;
mod session;
mod topic;
pub mod values;

use clap::{Args, Subcommand};
use tokio::runtime::Builder;

pub(crate) use self::call::UNQUOTED;
use self::call::{ActionVerb, GraphVerb, ServiceVerb};
pub use self::output::{CommandError, Outcome};
use self::parameters::ParamVerb;
use self::session::RuntimeOptions;
use self::topic::TopicVerb;

/// The subjects of the commands, each with its verbs.
#[derive(Debug, Clone, PartialEq, Subcommand)]
pub enum CommandSubject {
    /// Watch and publish topics of a running pendularm
    Topic(Subject<TopicVerb>),
    /// Call services of a running pendularm
    Service(Subject<ServiceVerb>),
    /// Send goals to actions of a running pendularm
    Action(Subject<ActionVerb>),
    /// List and describe the nodes of a running pendularm
    Node(Subject<GraphVerb>),
    /// Read and set parameters of a running pendularm
    Param(Subject<ParamVerb>),
    /// Show the state, warnings, energy, timestep and limits of a running pendularm
    #[command(after_help = "\
Example:
  pendularm diagnostics || echo 'a part is not OK'

The command waits for one message of /diagnostics. A running arm sends one every second. The exit status is 1 if a part
is not OK.")]
    Diagnostics(RuntimeOptions),
}

/// The verbs of a subject, and the address of the runtime.
#[derive(Debug, Clone, PartialEq, Args)]
#[command(after_help = "\
Exit status: 0 for success, 1 for a refusal (with its reason) or a failure, 2 for bad usage, 3 for no connection, a
connection that ended, or no answer within --timeout.")]
pub struct Subject<V: Subcommand> {
    #[command(flatten)]
    runtime: RuntimeOptions,
    #[command(subcommand)]
    verb: V,
}

/// Connects, runs a command and prints its result.
///
/// # Errors
/// [`CommandError`], which has the exit status.
pub fn run(subject: &CommandSubject) -> Outcome {
    let (CommandSubject::Topic(Subject { runtime, .. })
    | CommandSubject::Service(Subject { runtime, .. })
    | CommandSubject::Action(Subject { runtime, .. })
    | CommandSubject::Node(Subject { runtime, .. })
    | CommandSubject::Param(Subject { runtime, .. })
    | CommandSubject::Diagnostics(runtime)) = subject;
    let system = Builder::new_current_thread().enable_all().build();
    system.map_err(CommandError::system)?.block_on(async {
        let session = &mut runtime.open().await?;
        match subject {
            CommandSubject::Topic(topic) => topic::run(&topic.verb, session).await,
            CommandSubject::Service(service) => call::run_service(&service.verb, session).await,
            CommandSubject::Action(action) => call::run_action(&action.verb, session).await,
            CommandSubject::Node(node) => call::run_graph(&node.verb, "node", session).await,
            CommandSubject::Param(param) => parameters::run(&param.verb, session).await,
            CommandSubject::Diagnostics(_) => parameters::diagnostics(session).await,
        }
    })
}
