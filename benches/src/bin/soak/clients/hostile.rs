//! The attacks of `make attack`, one at a time and briefly, among all the others.
//!
//! **Invariant:** only attacks that leave the arm alone and need no program of their own. The operator sees only its
//! own changes of the arm, and clients that come with the tide find a place.

use std::rc::Rc;
use std::time::{Duration, Instant};

use pendularm_benches::attack::stage::{Deeds, play};
use pendularm_benches::attack::{Attack, groups};

use crate::world::{Fault, World, is_wanted};

/// Clients of one attack: with as many others as there may be, a quarter of the places.
const MOST: usize = 250;

/// Plays an attack that is picked at random, for a second or two.
pub async fn attack(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let fits = |attack: &&Attack| {
        !attack.moves && !attack.fills && !attack.locked && attack.options.is_empty()
    };
    let groups = groups();
    let attacks: Vec<&Attack> = groups
        .iter()
        .flat_map(|(_, all)| all.iter())
        .filter(fits)
        .collect();
    let wanted: Vec<&Attack> = attacks
        .iter()
        .filter(|attack| is_wanted(attack.name))
        .copied()
        .collect();
    // A run with this kind of clients alone has any of the attacks.
    let attacks = if wanted.is_empty() { attacks } else { wanted };
    let attack = *attacks[rng.usize(..attacks.len())];
    let (address, time) = (world.address, Duration::from_millis(rng.u64(500..2000)));
    let playing = tokio::task::spawn_blocking(move || {
        let cast = (attack.cast)();
        // The deaf come first in an attack, those that flood last.
        let cast = &cast[cast.len().saturating_sub(MOST)..];
        let (deeds, ends) = (Deeds::default(), Instant::now() + time);
        play(cast, address, &deeds, || Instant::now() >= ends);
        deeds
    });
    let deeds = playing
        .await
        .map_err(|error| Fault::of(attack.name, error.to_string()))?;
    world.count(attack.name, 1);
    world.count("connections of attackers", deeds.connections.into_inner());
    world.count("bytes of attackers", deeds.sent.into_inner());
    Ok(())
}
