//! Every kind of client that comes and goes, and how often.
//!
//! **Invariant:** each ends by itself, within [`PATIENCE`](crate::world::PATIENCE) of the end of its tide.

mod computing;
mod contenders;
mod floods;
mod garbage;
mod giants;
mod halves;
mod hostile;
mod pieces;
mod providers;
mod readers;
mod storms;
mod visitors;
mod web;

use std::pin::Pin;
use std::rc::Rc;

use crate::world::{Fault, World};

/// A client's life, from its beginning to its end.
pub type Life = Pin<Box<dyn Future<Output = Result<(), Fault>>>>;

/// A kind of client.
pub struct Kind {
    /// Its name in the report.
    pub name: &'static str,
    /// How often it comes, beside the others.
    pub weight: u32,
    /// How many of it there may be at once: the most expensive ones come one at a time.
    pub at_once: usize,
    /// Its actions.
    pub live: fn(Rc<World>, fastrand::Rng) -> Life,
}

macro_rules! kind {
    ($name:literal, $weight:literal, $at_once:literal, $live:path) => {
        Kind {
            name: $name,
            weight: $weight,
            at_once: $at_once,
            live: |world, rng| Box::pin($live(world, rng)),
        }
    };
}

/// All kinds.
pub const KINDS: &[Kind] = &[
    kind!("visitors", 30, 12, visitors::visit),
    kind!("crowds of forty", 1, 1, visitors::crowd),
    kind!("dribblers", 6, 4, visitors::dribble),
    kind!("floods of calls", 4, 2, floods::calls),
    kind!("floods of messages", 5, 2, floods::messages),
    kind!("slow readers", 5, 4, readers::slow),
    kind!("deaf clients", 5, 4, readers::deaf),
    kind!("clients that hoard 40 MB of answers", 1, 1, readers::hoard),
    kind!(
        "clients that stall with answers waiting",
        1,
        1,
        readers::stall
    ),
    kind!("half-open clients", 10, 6, halves::half),
    kind!("clients reset mid-frame", 10, 6, halves::reset),
    kind!("garbage", 8, 4, garbage::garbage),
    kind!("mutated frames", 5, 3, garbage::mutants),
    kind!("giant frames", 3, 1, giants::giant),
    kind!("deep nesting", 3, 2, giants::deep),
    kind!("subscription storms", 6, 3, storms::subscriptions),
    kind!("topic churns", 6, 3, storms::topics),
    kind!("providers", 14, 6, providers::provide),
    kind!("providers that take over", 4, 2, contenders::take_over),
    kind!(
        "clients that call themselves",
        3,
        2,
        providers::call_oneself
    ),
    kind!("computing clients", 6, 3, computing::compute),
    kind!("computing clients that vanish", 3, 2, computing::vanish),
    kind!("clients in pieces", 5, 3, pieces::pieces),
    kind!("HTTP requests", 8, 4, web::requests),
    kind!("broken WebSockets", 8, 4, web::broken),
    kind!("attacks", 2, 1, hostile::attack),
];
