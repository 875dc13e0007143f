//! Clients that provide services, in every manner, and those that call them.
//!
//! **Invariant:** every caller gets one response, its own: the provider's content where that answers, else a refusal
//! that says why; an answer too many reaches nobody.

use std::cell::Cell;
use std::collections::{BTreeSet, VecDeque};
use std::rc::Rc;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::ledger::{Check, succeeded};
use crate::wire::{Came, Client, Door};
use crate::world::{Fault, PATIENCE, World};

/// How a provider behaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Manner {
    /// Answers at once.
    Prompt,
    /// Answers `result: false` at once.
    Refusing,
    /// Answers, and then again with something else.
    Twice,
    /// Answers after the caller's time is up.
    Late,
    /// Never answers, to callers that set a time.
    Mute,
    /// Goes away, in one of three ways, when it has got some calls.
    Vanishing,
    /// Answers calls of others too, with something else.
    Forging,
}

const MANNERS: [Manner; 10] = [
    Manner::Prompt,
    Manner::Prompt,
    Manner::Prompt,
    Manner::Refusing,
    Manner::Twice,
    Manner::Late,
    Manner::Mute,
    Manner::Vanishing,
    Manner::Vanishing,
    Manner::Forging,
];

/// How long callers wait for providers that will not answer in time.
const SHORT: Duration = Duration::from_millis(300);

/// How long the last complaint may take once all else is over.
const COMPLAINED: Duration = Duration::from_secs(10);

/// One provider and its callers.
pub async fn provide(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let manner = MANNERS[rng.usize(..MANNERS.len())];
    let service = format!("/soak/provided/{}", world.number());
    let provider = advertise(&world, &service, &mut rng).await?;
    let by = world.number();
    let left = Cell::new(0);
    let taken: Rc<Cell<u64>> = Rc::default();
    let done = Cell::new(false);
    let (own, one, other) = (rng.fork(), rng.fork(), rng.fork());
    let providing = async {
        let (too_many, complaints) = serve(provider, manner, &service, by, &done, own).await?;
        // Answers to callers that have gone may be answers too many; late ones were not.
        let most = too_many + left.get();
        let least = match manner {
            Manner::Late => too_many.saturating_sub(left.get() + taken.get()),
            _ => too_many,
        };
        if complaints < least || complaints > most {
            let left = left.get();
            let what = format!(
                "{manner:?}: {too_many} answers too many, {complaints} complaints, {left} calls left behind"
            );
            return Err(Fault::of(&service, what));
        }
        world.count("answers too many, all refused", complaints);
        world.count(
            "answers taken after their time, on a machine that stood still",
            taken.get(),
        );
        Ok(())
    };
    let callers = async {
        let first = call(&world, manner, &service, by, (&left, &taken), one);
        let second = call(&world, manner, &service, by, (&left, &taken), other);
        let called = tokio::try_join!(first, second).map(|_| ());
        done.set(true);
        called
    };
    let (provided, called) = tokio::join!(providing, callers);
    provided.and(called)
}

pub(super) async fn advertise(
    world: &Rc<World>,
    service: &str,
    rng: &mut fastrand::Rng,
) -> Result<Client, Fault> {
    let mut provider = Client::connect(world, "provider", Door::any(rng)).await?;
    let id = json!({"of": service});
    provider.push(
        &json!({"op": "advertise_service", "service": service, "type": "soak/srv/S", "id": id}),
    );
    provider.flush().await?;
    let status = provider.status(&id).await?;
    if status["level"] != "info" {
        return Err(provider.fault(format!("not advertised: {status}")));
    }
    world.count("services provided", 1);
    Ok(provider)
}

/// The provider's answer to the call with this number.
fn content(n: u64, by: u64) -> Value {
    json!({"n": n, "by": by, "thrice": 3 * n})
}

/// Some calls in one go.
async fn call(
    world: &Rc<World>,
    manner: Manner,
    service: &str,
    by: u64,
    (left, taken): (&Cell<u64>, &Rc<Cell<u64>>),
    mut rng: fastrand::Rng,
) -> Result<(), Fault> {
    let mut client = Client::connect(world, "caller of a provider", Door::any(&mut rng)).await?;
    for _ in 0..rng.usize(1..20) {
        let n = world.number();
        let extra = match manner {
            Manner::Late | Manner::Mute => json!({"timeout": SHORT.as_secs_f64()}),
            _ if rng.bool() => json!({"timeout": 60}),
            _ => json!({}),
        };
        client.push_call(
            service,
            json!({"n": n}),
            extra,
            false,
            expect(manner, n, by, Rc::clone(taken)),
        );
        world.count("calls forwarded", 1);
    }
    if rng.u8(..10) == 0 {
        // Gone before the answers: the provider answers nobody.
        client.flush().await?;
        let waiting = client.ledger.waiting() as u64;
        left.set(left.get() + waiting);
        world.count("calls left behind", waiting);
        return Ok(());
    }
    client.settle(|_| Ok(())).await
}

fn expect(manner: Manner, n: u64, by: u64, taken: Rc<Cell<u64>>) -> Check {
    let asked = Instant::now();
    Box::new(move |response| {
        let (said, values) = (
            response["status"].as_str().unwrap_or_default(),
            &response["values"],
        );
        let refused = response["result"] == false && !said.is_empty();
        match manner {
            Manner::Prompt | Manner::Twice | Manner::Forging => {
                succeeded(response)?;
                same(values, &content(n, by))
            }
            Manner::Refusing => {
                if !refused || !said.contains("not today") {
                    return Err(format!("expected the provider's refusal, got {said:?}"));
                }
                same(values, &content(n, by))
            }
            // Where the machine stood still, an answer that comes after its time may be read before anybody has looked
            // at the clock.
            Manner::Late if !refused && asked.elapsed() > 2 * SHORT => {
                taken.set(taken.get() + 1);
                same(values, &content(n, by))
            }
            Manner::Late | Manner::Mute => {
                let waited = asked.elapsed();
                if !refused || waited < SHORT {
                    return Err(format!(
                        "expected a refusal after {SHORT:?}, got {said:?} after {waited:?}"
                    ));
                }
                no_answer(response)
            }
            // Some are answered before it goes.
            Manner::Vanishing if refused => no_answer(response),
            Manner::Vanishing => same(values, &content(n, by)),
        }
    })
}

/// The runtime's own refusal: nothing came of the call, or, over WebSocket, the refusal's text.
fn no_answer(response: &Value) -> Result<(), String> {
    let values = &response["values"];
    if values.is_string() {
        return same(values, &response["status"]);
    }
    same(values, &json!({}))
}

pub(super) fn same(values: &Value, expected: &Value) -> Result<(), String> {
    if values == expected {
        return Ok(());
    }
    Err(format!("another call's answer: {values}, not {expected}"))
}

/// Answers calls in its manner until its callers are done; how many answers were too many, and how many complaints
/// came.
async fn serve(
    mut provider: Client,
    manner: Manner,
    service: &str,
    by: u64,
    done: &Cell<bool>,
    mut rng: fastrand::Rng,
) -> Result<(u64, u64), Fault> {
    let mut late: VecDeque<(Instant, Value)> = VecDeque::new();
    let mut seen = BTreeSet::new();
    let (mut too_many, mut complaints) = (0, 0);
    let last_call = rng.usize(1..10);
    let mut waited_since = Instant::now();
    loop {
        while late.front().is_some_and(|(due, _)| *due <= Instant::now()) {
            if let Some((_, answer)) = late.pop_front() {
                provider.push(&answer);
                too_many += 1;
            }
        }
        provider.flush().await?;
        if !done.get() || !late.is_empty() {
            waited_since = Instant::now();
        }
        let finished = done.get()
            && late.is_empty()
            && (complaints >= too_many || waited_since.elapsed() > COMPLAINED);
        match provider.next(Duration::from_millis(20)).await? {
            Came::Other(frame) if frame["op"] == "call_service" => {
                let n = frame["args"]["n"].as_u64().unwrap_or_default();
                if frame["service"] != service || !seen.insert(frame["id"].to_string()) {
                    return Err(provider.fault(format!("not a fresh call of {service}: {frame}")));
                }
                let answer = json!({"op": "service_response", "service": service, "id": frame["id"],
                    "values": content(n, by), "result": manner != Manner::Refusing, "status":
                    if manner == Manner::Refusing { "not today" } else { "" }});
                match manner {
                    Manner::Mute => {}
                    Manner::Late => late.push_back((Instant::now() + 2 * SHORT, answer.clone())),
                    Manner::Vanishing if seen.len() >= last_call => {
                        return vanish(provider, rng).await.map(|()| (0, 0));
                    }
                    _ => provider.push(&answer),
                }
                if manner == Manner::Twice || manner == Manner::Forging {
                    for wrong in wrong_answers(manner, &answer, &seen) {
                        provider.push(&wrong);
                        too_many += 1;
                    }
                }
            }
            Came::Other(frame) if frame["level"] == "error" => complaints += 1,
            Came::Other(frame) => return Err(provider.fault(format!("unasked: {frame}"))),
            Came::Answer(_) | Came::Binary => {}
            Came::Nothing if finished => break,
            Came::Nothing => {}
            Came::End => return Err(provider.fault("the stream ended")),
        }
    }
    Ok((too_many, complaints))
}

/// Answers that must reach nobody: to the same call again, and to calls that went to others.
fn wrong_answers(manner: Manner, answer: &Value, seen: &BTreeSet<String>) -> Vec<Value> {
    let mut wrong = answer.clone();
    wrong["values"] = json!({"wrong": true});
    if manner == Manner::Twice {
        return vec![wrong];
    }
    // Calls are numbered in the order in which they are forwarded, and this provider's calls come in that order.
    // Lower numbers that it has not seen belong to others.
    let id = answer["id"].as_str().unwrap_or_default();
    let Some((prefix, number)) = id.rsplit_once(':') else {
        return Vec::new();
    };
    let number: u64 = number.parse().unwrap_or_default();
    let forged = (number.saturating_sub(8)..number).map(|other| json!(format!("{prefix}:{other}")));
    let forged = forged.filter(|id| !seen.contains(&id.to_string()));
    forged
        .map(|id| {
            let mut wrong = wrong.clone();
            wrong["id"] = id;
            wrong
        })
        .collect()
}

/// With an orderly end, with a reset, or half: it can answer no more then.
async fn vanish(mut provider: Client, mut rng: fastrand::Rng) -> Result<(), Fault> {
    provider.flush().await?;
    provider
        .world
        .count("providers that vanished during calls", 1);
    match rng.u8(..3) {
        0 => provider.reset(),
        1 => {
            provider.shut_down().await?;
            provider.swallow(PATIENCE).await?;
        }
        _ => {}
    }
    Ok(())
}

/// A client that is provider and caller in one.
pub async fn call_oneself(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let service = format!("/soak/own/{}", world.number());
    let mut client = advertise(&world, &service, &mut rng).await?;
    for _ in 0..rng.usize(1..20) {
        let n = world.number();
        let check = move |response: &Value| {
            succeeded(response)?;
            same(&response["values"], &content(n, 0))
        };
        client.push_call(&service, json!({"n": n}), json!({}), false, Box::new(check));
        world.count("calls forwarded", 1);
    }
    client.flush().await?;
    while client.ledger.waiting() > 0 {
        match client.next(PATIENCE).await? {
            Came::Other(frame) if frame["op"] == "call_service" => {
                let n = frame["args"]["n"].as_u64().unwrap_or_default();
                client.push(
                    &json!({"op": "service_response", "service": service, "id": frame["id"],
                    "values": content(n, 0), "result": true}),
                );
                client.flush().await?;
            }
            Came::Other(_) | Came::Answer(_) | Came::Binary => {}
            Came::End | Came::Nothing => {
                return Err(client.fault("a call to oneself is not answered"));
            }
        }
    }
    Ok(())
}
