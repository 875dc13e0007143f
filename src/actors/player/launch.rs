//! Starts what is there when a record is replayed: the player in the arm's place, and the nodes that tell of what there
//! is.
//!
//! **Invariant:** the record has been read once before any client is accepted.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use actix::prelude::*;

use super::{PlayedRecord, Player, list_only_what_is_served};
use crate::actors::gateway::registry::Registry;
use crate::actors::ros::parameters::Parameters;
use crate::actors::ros::rosapi::RosapiNode;
use crate::actors::wire::Nodes;
use crate::record::{ReadError, ReplayError, recorded_links};

/// Why a record can't be played.
#[derive(Debug, thiserror::Error)]
#[error("{file}: {why}")]
pub struct NotReplayed {
    file: String,
    why: Box<dyn std::error::Error + Send + Sync>,
}

/// Starts the player of `file` on `thread`, and the nodes beside it on this one.
///
/// # Errors
/// If it is no record of an arm, or damaged before its end.
pub fn start(
    file: &Path,
    registry: &Addr<Registry>,
    thread: &ArbiterHandle,
    nodes: &mut Nodes,
) -> Result<(), NotReplayed> {
    let refused = |why| NotReplayed {
        file: file.display().to_string(),
        why,
    };
    let open = || File::open(file).map_err(|why| refused(why.into()));
    let links = recorded_links(BufReader::new(open()?));
    let links = links.map_err(|why: ReplayError| refused(why.into()))?;
    let start = match links {
        2 => start_beside::<2>,
        _ => start_beside::<3>,
    };
    start(open()?, registry, thread, nodes).map_err(|why| refused(why.into()))
}

fn start_beside<const N: usize>(
    file: File,
    registry: &Addr<Registry>,
    thread: &ArbiterHandle,
    nodes: &mut Nodes,
) -> Result<(), ReadError> {
    let record = PlayedRecord::<N>::open(file)?;
    let publish = registry.clone().recipient();
    let player = Player::start_in_arbiter(thread, |_| Player::new(record, publish));
    Player::attach(&player, nodes);
    let parameters = Player::parameters(&player);
    Parameters::attach(&Parameters::new(parameters.clone()).start(), nodes);
    let rosapi = RosapiNode::new(registry.clone().recipient(), parameters).start();
    RosapiNode::attach(&rosapi, nodes);
    list_only_what_is_served(nodes);
    Ok(())
}
