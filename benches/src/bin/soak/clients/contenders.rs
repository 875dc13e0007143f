//! Providers that take one name from each other, over and over, and a client that calls them.
//!
//! **Invariant:** every call has an answer, whoever has the name meanwhile, and it is the answer to that call.

use std::cell::Cell;
use std::rc::Rc;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::providers::{advertise, same};
use crate::ledger::succeeded;
use crate::wire::{Came, Client, Door};
use crate::world::{Fault, World};

/// Two providers of one name, of which the newest has it, while a caller goes on calling.
pub async fn take_over(world: Rc<World>, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let service = format!("/soak/contended/{}", world.number());
    let first = advertise(&world, &service, &mut rng).await?;
    let second = Client::connect(&world, "provider that takes over", Door::any(&mut rng)).await?;
    let done = Cell::new(false);
    let calling = async {
        let called = call_on(&world, &service, rng.fork()).await;
        done.set(true);
        called
    };
    let answering = async {
        tokio::try_join!(
            contend(first, &service, &done),
            contend(second, &service, &done)
        )
    };
    let (answered, called) = tokio::join!(answering, calling);
    answered.map(|_| ()).and(called)
}

async fn call_on(world: &Rc<World>, service: &str, mut rng: fastrand::Rng) -> Result<(), Fault> {
    let mut client = Client::connect(world, "caller of contenders", Door::any(&mut rng)).await?;
    for _ in 0..rng.usize(3..20) {
        for _ in 0..rng.usize(1..10) {
            let n = world.number();
            let check = move |response: &Value| {
                succeeded(response)?;
                same(&response["values"], &json!({"n": n}))
            };
            client.push_call(service, json!({"n": n}), json!({}), false, Box::new(check));
            world.count("calls forwarded", 1);
        }
        client.settle(|_| Ok(())).await?;
        tokio::time::sleep(Duration::from_millis(rng.u64(..30))).await;
    }
    Ok(())
}

/// Takes the name over and over again, and answers what comes.
async fn contend(mut provider: Client, service: &str, done: &Cell<bool>) -> Result<(), Fault> {
    while !done.get() {
        provider.push(&json!({"op": "advertise_service", "service": service}));
        provider.flush().await?;
        provider.world.count("services provided", 1);
        let until = Instant::now() + Duration::from_millis(30);
        while Instant::now() < until {
            match provider.next(Duration::from_millis(10)).await? {
                Came::Other(frame) if frame["op"] == "call_service" => {
                    let values = json!({"n": frame["args"]["n"]});
                    provider.push(
                        &json!({"op": "service_response", "service": service, "id": frame["id"],
                        "values": values, "result": true}),
                    );
                    provider.flush().await?;
                }
                Came::Other(frame) if frame["level"] == "error" => {
                    return Err(provider.fault(format!("refused: {frame}")));
                }
                Came::End => return Err(provider.fault("the stream ended")),
                _ => {}
            }
        }
    }
    Ok(())
}
