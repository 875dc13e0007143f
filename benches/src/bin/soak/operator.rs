//! The operator, who has the arm: settings, setpoints, goals, trials, pauses and resets, all the time; and who reads
//! `/diagnostics` meanwhile.
//!
//! The settings keep the loop stable in every pose. Masses and lengths are at least nine tenths of the default ones,
//! and gains two thirds. Timesteps stay at or below 2 ms, where the default arm holds until 4 ms.
//!
//! **Invariant:** the only client that moves the arm, so that what it set is what it finds.

use std::cell::Cell;
use std::collections::BTreeSet;
use std::rc::Rc;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::ledger::{Check, anything, succeeded};
use crate::wire::{Came, Client, Door};
use crate::world::{Fault, World};

/// How long the arm's clock is left alone, so that its rate can be measured.
const UNDISTURBED: Duration = Duration::from_secs(12);
const METHODS: [&str; 4] = ["euler", "midpoint", "verlet", "rk4"];

struct Operator {
    client: Client,
    rng: fastrand::Rng,
    gains: Value,
    /// Goals that were accepted and have no result yet.
    pursued: BTreeSet<String>,
    /// Goals with a result, so that a second one shows.
    concluded: BTreeSet<String>,
}

/// Operates the arm until `stop`.
pub async fn operate(
    world: Rc<World>,
    rng: fastrand::Rng,
    stop: Rc<Cell<bool>>,
) -> Result<(), Fault> {
    let mut client = Client::connect(&world, "operator", Door::Tcp).await?;
    client.subscribe("/ik_action/result", json!({})).await?;
    let gains = Value::Null;
    let (pursued, concluded) = (BTreeSet::new(), BTreeSet::new());
    let mut operator = Operator {
        client,
        rng,
        gains,
        pursued,
        concluded,
    };
    operator.gains = operator.ask("/pid_controller/set_gains", json!({})).await?;
    operator
        .ask("/pid_controller/enable", json!({"data": true}))
        .await?;
    let mut touched = Instant::now();
    while !stop.get() {
        operator.act().await?;
        if touched.elapsed() > UNDISTURBED && !stop.get() {
            operator.touch_clock().await?;
            touched = Instant::now();
        }
    }
    // Every goal ends with a reset at the latest.
    operator.reset().await?;
    if let Some(goal) = operator.pursued.first() {
        return Err(operator.client.fault(format!("goal {goal} has no result")));
    }
    Ok(())
}

impl Operator {
    /// Calls a service that must succeed; its values.
    async fn ask(&mut self, service: &str, args: Value) -> Result<Value, Fault> {
        self.ask_checked(service, args, Box::new(succeeded)).await
    }

    async fn ask_checked(
        &mut self,
        service: &str,
        args: Value,
        check: Check,
    ) -> Result<Value, Fault> {
        self.client.push_call(service, args, json!({}), true, check);
        self.client.flush().await?;
        loop {
            match self.client.next(crate::world::PATIENCE).await? {
                Came::Answer(response) => return Ok(response["values"].clone()),
                Came::Other(frame) => self.hear(&frame)?,
                Came::Binary => {}
                Came::End | Came::Nothing => {
                    return Err(self.client.fault(format!("{service}: no answer")));
                }
            }
        }
    }

    /// Sets something, and finds it set.
    async fn set(&mut self, service: &str, args: Value) -> Result<(), Fault> {
        self.client.world.count("settings changed", 1);
        let values = self.ask(service, args.clone()).await?;
        for (key, value) in args.as_object().into_iter().flatten() {
            if values[key] != *value {
                return Err(self.client.fault(format!(
                    "{service}: set {key} to {value}, is {}",
                    values[key]
                )));
            }
        }
        Ok(())
    }

    /// A result of a goal: of ours, each has one.
    fn hear(&mut self, frame: &Value) -> Result<(), Fault> {
        if frame["topic"] != "/ik_action/result" {
            return Ok(());
        }
        let goal = frame["msg"]["goal_id"]
            .as_str()
            .unwrap_or_default()
            .to_owned();
        self.pursued.remove(&goal);
        self.client.world.count("goals concluded", 1);
        if self.concluded.insert(goal) {
            return Ok(());
        }
        Err(self.client.fault(format!("a second result: {frame}")))
    }

    /// Reads what comes, for so long.
    async fn wait(&mut self, time: Duration) -> Result<(), Fault> {
        let until = Instant::now() + time;
        loop {
            match self
                .client
                .next(until.saturating_duration_since(Instant::now()))
                .await?
            {
                Came::Other(frame) => self.hear(&frame)?,
                Came::Nothing => return Ok(()),
                Came::End => return Err(self.client.fault("the stream ended")),
                Came::Answer(_) | Came::Binary => {}
            }
        }
    }

    /// One thing that leaves the clock alone, and a moment in which it shows.
    async fn act(&mut self) -> Result<(), Fault> {
        let mut between = |low: f64, high: f64| low + (high - low) * self.rng.f64();
        let pair = [between(-3.0, 3.0), between(-3.0, 3.0)];
        let (x, y) = (between(-1.3, 1.3), between(-1.3, 1.3));
        let masses = [between(0.9, 2.0), between(0.9, 2.0)];
        let lengths = [between(0.9, 1.2), between(0.9, 1.2)];
        let (gravity, share) = (between(0.0, 12.0), between(0.7, 1.0));
        match self.rng.u8(..12) {
            0 => {
                let args = json!({"gravity": gravity, "masses": masses, "lengths": lengths});
                self.set("/arm_sim/set_params", args).await?;
            }
            1 => {
                let scaled = |name: &str| -> Vec<f64> {
                    let all = self.gains[name].as_array().into_iter().flatten();
                    all.filter_map(Value::as_f64)
                        .map(|gain| gain * share)
                        .collect()
                };
                let args = json!({"kp": scaled("kp"), "ki": scaled("ki"), "kd": scaled("kd")});
                self.set("/pid_controller/set_gains", args).await?;
            }
            2 | 3 => {
                let point = json!({"positions": pair});
                self.client.push(&json!({"op": "publish", "topic": "/joint_trajectory", "msg": {"points": [point]}}));
                self.client.world.count("setpoints published", 1);
                self.client.flush().await?;
            }
            4..=6 => self.pursue(x, y).await?,
            7 => {
                // Nothing to cancel is a refusal.
                self.ask_checked("/ik_action/cancel_goal", json!({}), anything())
                    .await?;
            }
            8 => {
                self.set("/pid_controller/enable", json!({"data": false}))
                    .await?;
                self.wait(Duration::from_millis(700)).await?;
                self.set("/pid_controller/enable", json!({"data": true}))
                    .await?;
            }
            9 => {
                self.client.world.count("disturbances", 1);
                self.ask("/arm_sim/disturb", json!({"effort": pair, "duration": 0.2}))
                    .await?;
            }
            10 => {
                self.client.world.count("trials started", 1);
                self.ask("/ik_trial/start", json!({"duration": 3.0, "epsilon": 0.05}))
                    .await?;
            }
            _ => {
                // Nothing to skip is a refusal.
                self.ask_checked("/ik_trial/skip", json!({}), anything())
                    .await?;
                self.ask_checked("/ik_trial/stop", json!({}), anything())
                    .await?;
            }
        }
        let pause = Duration::from_millis(self.rng.u64(50..900));
        self.wait(pause).await
    }

    /// Sends a goal; one that is out of reach with the present lengths is refused.
    async fn pursue(&mut self, x: f64, y: f64) -> Result<(), Fault> {
        let args = json!({"x": x, "y": y, "epsilon": 0.03, "success_hold": 0.1});
        let values = self
            .ask_checked("/ik_action/send_goal", args, anything())
            .await?;
        if let Some(goal) = values["goal_id"].as_str() {
            self.client.world.count("goals accepted", 1);
            // Its result cannot have come before the answer that names it.
            self.pursued.insert(goal.to_owned());
        }
        Ok(())
    }

    /// A reset, or a pause; then another method or timestep.
    async fn touch_clock(&mut self) -> Result<(), Fault> {
        if self.rng.bool() {
            self.reset().await?;
        } else {
            let before = Instant::now();
            self.set("/arm_sim/pause", json!({"data": true})).await?;
            let time = Duration::from_millis(self.rng.u64(200..1000));
            self.wait(time).await?;
            self.set("/arm_sim/pause", json!({"data": false})).await?;
            self.client.world.count("pauses", 1);
            self.client
                .world
                .deeds
                .borrow_mut()
                .pauses
                .push((before, Instant::now()));
        }
        let method = METHODS[self.rng.usize(..METHODS.len())];
        let timestep = [0.0005, 0.001, 0.002][self.rng.usize(..3)];
        self.set(
            "/arm_sim/set_integrator",
            json!({"method": method, "timestep": timestep}),
        )
        .await
    }

    async fn reset(&mut self) -> Result<(), Fault> {
        let before = Instant::now();
        self.ask("/arm_sim/reset", json!({})).await?;
        self.client.world.count("resets", 1);
        self.client
            .world
            .deeds
            .borrow_mut()
            .resets
            .push((before, Instant::now()));
        Ok(())
    }
}

/// Reads `/diagnostics` until `stop`.
pub async fn diagnose(world: Rc<World>, stop: Rc<Cell<bool>>) -> Result<(), Fault> {
    let mut client = Client::connect(&world, "reader of /diagnostics", Door::Web).await?;
    client.subscribe("/diagnostics", json!({})).await?;
    while !stop.get() {
        match client.next(Duration::from_secs(1)).await? {
            Came::Other(frame) => note(&world, &frame["msg"]["status"]),
            Came::End => return Err(client.fault("the stream ended")),
            Came::Answer(_) | Came::Binary | Came::Nothing => {}
        }
    }
    Ok(())
}

fn note(world: &World, statuses: &Value) {
    let value = |name: &str, key: &str| -> Option<String> {
        let status = statuses
            .as_array()?
            .iter()
            .find(|status| status["name"] == name)?;
        let entry = status["values"]
            .as_array()?
            .iter()
            .find(|entry| entry["key"] == key)?;
        entry["value"].as_str().map(str::to_owned)
    };
    let number = |name: &str, key: &str| value(name, key)?.parse::<f64>().ok();
    let mut diagnosis = world.diagnosis.borrow_mut();
    diagnosis.messages += 1;
    diagnosis.connections = number("gateway", "connections").unwrap_or_default() as u64;
    diagnosis.dropped = number("gateway", "messages_dropped").unwrap_or_default() as u64;
    let step = number("arm_sim", "max_step_time").unwrap_or_default();
    diagnosis.longest_step = diagnosis.longest_step.max(step);
    let state = value("arm_sim", "state").unwrap_or_default();
    if state == "running" {
        let factor = number("arm_sim", "real_time_factor").filter(|factor| factor.is_finite());
        diagnosis.lowest_factor = [diagnosis.lowest_factor, factor]
            .into_iter()
            .flatten()
            .reduce(f64::min);
    } else if state != "paused" {
        let text = statuses[0]["message"].to_string();
        diagnosis.strange_states.push(text);
    }
}
