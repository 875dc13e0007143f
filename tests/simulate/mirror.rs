//! The arm's double: the offline stepper under the same inputs at the same steps, beside the live arm.
//!
//! A tap stands before the arm and sees every input on its way. Around each it asks the arm for its whole state and has the double take
//! as many steps: the two must be equal to the bit, and so must what the arm answers. That the arm has taken as many steps as time
//! allows is checked against virtual time.

use std::rc::Rc;

use actix::prelude::*;
use pendularm::actors::arm::sim::{
    ArmSim, CommandGoal, STEPS_IN_A_ROW, SetGains, SetIntegrator, SetParams, SimulationTime,
    Snapshot, TakeSnapshot, joint_names,
};
use pendularm::actors::node::Call;
use pendularm::actors::wire::{Nodes, ServiceCall, TopicMessage};
use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::Simulation;
use pendularm::protocol::catalog::{Service, Topic};
use pendularm::protocol::messages::trajectory::joint_trajectory;
use pendularm::protocol::op::Arguments;
use serde_json::{Value, json};
use tokio::time::Instant;

use crate::court::Court;
use crate::json::Json;

/// Most steps of one `/arm_sim/step`.
const MOST_STEPS: f64 = 10_000.0;
/// Timesteps at which the arm keeps up with time whatever happens \[s\].
const KEEPS_UP: std::ops::RangeInclusive<f64> = 4e-4..=1.0;
/// How late a wake-up may be that makes up for what one before it left owed \[s\].
const LATE: f64 = 0.002;

/// Stands before the arm.
pub struct Tap<const N: usize> {
    arm: Addr<ArmSim<N>>,
    /// The ways to it.
    routes: Nodes,
    mirror: Mirror<N>,
}

/// Compares arm and double now; answers once that has been done.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Compare;

impl<const N: usize> Tap<N> {
    pub fn new(arm: Addr<ArmSim<N>>, gains: Gains<N>, court: Rc<Court>) -> Self {
        let mut routes = Nodes::default();
        ArmSim::attach(&arm, &mut routes);
        Self {
            arm,
            routes,
            mirror: Mirror {
                simulation: Simulation::new(Arm::default(), gains),
                paused: false,
                asked_steps: 0,
                has_goals: false,
                is_done: true,
                anchor: None,
                jumps: 0,
                court,
            },
        }
    }

    fn snapshot(&self) -> impl Future<Output = Option<Simulation<N>>> + use<N> {
        let asked = self.arm.send(TakeSnapshot);
        async move { asked.await.ok().map(|Snapshot(simulation)| *simulation) }
    }
}

impl<const N: usize> Actor for Tap<N> {
    type Context = Context<Self>;
}

impl<const N: usize> Handler<Compare> for Tap<N> {
    type Result = AtomicResponse<Self, ()>;

    fn handle(&mut self, _: Compare, _: &mut Context<Self>) -> Self::Result {
        let now = self.snapshot().into_actor(self);
        AtomicResponse::new(Box::pin(
            now.map(|arm, tap, _| tap.mirror.observe(arm.as_ref())),
        ))
    }
}

impl<const N: usize> Handler<SimulationTime> for Tap<N> {
    type Result = ResponseFuture<f64>;

    fn handle(&mut self, question: SimulationTime, _: &mut Context<Self>) -> Self::Result {
        let asked = self.arm.send(question);
        Box::pin(async move { asked.await.unwrap_or_default() })
    }
}

/// A client's call, unread.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Called(pub ServiceCall);

impl<const N: usize> Handler<Called> for Tap<N> {
    type Result = ();

    fn handle(&mut self, Called(call): Called, ctx: &mut Context<Self>) {
        let named = Named::read(call.service, &call.arguments);
        let id = call.caller.id().map(|id| id.get().to_owned());
        let steps = id.clone().filter(|_| call.service == Service::Step);
        let Some(route) = self.routes.services.get(&call.service) else {
            return;
        };
        // One behind the other in the arm's mailbox: nothing comes between them, not even steps by hand.
        let before = self.snapshot().into_actor(self);
        route(call);
        let after = self.snapshot().into_actor(self);
        let input = before.map(move |arm, tap: &mut Self, _: &mut Context<Self>| {
            tap.mirror.observe(arm.as_ref());
            let answer = tap.mirror.apply(&named);
            if let (Some(values), Some(id)) = (answer, id) {
                let answer = (values, tap.mirror.is_done);
                tap.mirror.court.expected.borrow_mut().insert(id, answer);
            }
        });
        ctx.wait(input.then(|(), _, _| {
            after.map(move |arm, tap: &mut Self, _: &mut Context<Self>| {
                tap.mirror.observe(arm.as_ref());
                if let Some(id) = steps {
                    tap.mirror.look_after_steps(&id);
                }
            })
        }));
    }
}

/// A client's message on `/joint_trajectory`, unread.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Sent(pub TopicMessage);

impl<const N: usize> Handler<Sent> for Tap<N> {
    type Result = ();

    fn handle(&mut self, Sent(message): Sent, ctx: &mut Context<Self>) {
        let msg = message.msg.clone();
        let Some(route) = self.routes.listeners.get(&Topic::JointTrajectory) else {
            return;
        };
        let before = self.snapshot().into_actor(self);
        route(message);
        let after = self.snapshot().into_actor(self);
        let input = before.map(move |arm, tap: &mut Self, _: &mut Context<Self>| {
            tap.mirror.observe(arm.as_ref());
            tap.mirror.point(msg.raw());
        });
        ctx.wait(input.then(|(), _, _| {
            after.map(|arm, tap: &mut Self, _: &mut Context<Self>| tap.mirror.observe(arm.as_ref()))
        }));
    }
}

impl<const N: usize> Tap<N> {
    /// An input of another node's: goes to the arm, and has the same effect on the double.
    fn pass(
        &mut self,
        ctx: &mut Context<Self>,
        send: impl FnOnce(&Addr<ArmSim<N>>),
        apply: impl FnOnce(&mut Mirror<N>) + 'static,
    ) {
        let before = self.snapshot().into_actor(self);
        send(&self.arm);
        let after = self.snapshot().into_actor(self);
        let input = before.map(|arm, tap: &mut Self, _: &mut Context<Self>| {
            tap.mirror.observe(arm.as_ref());
            apply(&mut tap.mirror);
        });
        ctx.wait(input.then(|(), _, _| {
            after.map(|arm, tap: &mut Self, _: &mut Context<Self>| tap.mirror.observe(arm.as_ref()))
        }));
    }
}

impl<const N: usize> Handler<Call<SetParams<N>>> for Tap<N> {
    type Result = ();

    fn handle(&mut self, call: Call<SetParams<N>>, ctx: &mut Context<Self>) {
        let ask = call.ask.clone();
        let apply = move |mirror: &mut Mirror<N>| {
            let present = *mirror.simulation.arm();
            let changed = ask.applied_to(&present).unwrap_or(present);
            mirror.simulation.set_arm(changed);
        };
        self.pass(ctx, |arm| arm.do_send(call), apply);
    }
}

impl<const N: usize> Handler<Call<SetGains<N>>> for Tap<N> {
    type Result = ();

    fn handle(&mut self, call: Call<SetGains<N>>, ctx: &mut Context<Self>) {
        let ask = call.ask.clone();
        let apply = move |mirror: &mut Mirror<N>| {
            let gains = ask.applied_to(mirror.simulation.pid().gains());
            mirror.simulation.set_gains(gains);
        };
        self.pass(ctx, |arm| arm.do_send(call), apply);
    }
}

impl<const N: usize> Handler<Call<SetIntegrator>> for Tap<N> {
    type Result = ();

    fn handle(&mut self, call: Call<SetIntegrator>, ctx: &mut Context<Self>) {
        let ask = call.ask.clone();
        let apply = move |mirror: &mut Mirror<N>| {
            if let Some(method) = ask.method {
                mirror.simulation.set_method(method);
            }
            if let Some(step) = ask.timestep
                && step.to_bits() != mirror.simulation.timestep().to_bits()
            {
                mirror.simulation.set_timestep(step);
                mirror.anchor = None;
            }
        };
        self.pass(ctx, |arm| arm.do_send(call), apply);
    }
}

impl<const N: usize> Handler<CommandGoal<N>> for Tap<N> {
    type Result = ();

    fn handle(&mut self, command: CommandGoal<N>, ctx: &mut Context<Self>) {
        self.mirror.has_goals = true;
        let before = self.snapshot().into_actor(self);
        self.arm.do_send(command);
        let after = self.snapshot().into_actor(self);
        let input = before.map(move |arm, tap: &mut Self, _: &mut Context<Self>| {
            tap.mirror.observe(arm.as_ref());
            // It may have been overtaken by a reset: then the arm leaves it aside.
            let held = *tap.mirror.simulation.pid().setpoint();
            tap.mirror.simulation.set_setpoint(Setpoint {
                position: command.positions,
                velocity: [0.0; N],
            });
            held
        });
        ctx.wait(input.then(|held, _, _| {
            after.map(move |arm, tap: &mut Self, _: &mut Context<Self>| {
                if let Some(arm) = &arm
                    && *arm.pid().setpoint() == held
                {
                    tap.mirror.simulation.set_setpoint(held);
                }
                tap.mirror.observe(arm.as_ref());
            })
        }));
    }
}

/// The double.
struct Mirror<const N: usize> {
    simulation: Simulation<N>,
    paused: bool,
    /// Steps that were asked for by hand and may still be taken: a resume and a pause at once do not end them.
    asked_steps: u64,
    /// Whether there has been a goal: steps by hand end at its progress then, and go on between what others ask.
    has_goals: bool,
    /// Whether the last input, if its fields were good, has been followed as a whole.
    is_done: bool,
    /// A moment, and the simulation's time then.
    anchor: Option<(Instant, f64)>,
    /// Jumps of the clock that the anchor knows of.
    jumps: u64,
    court: Rc<Court>,
}

impl<const N: usize> Mirror<N> {
    /// The arm is in this state now.
    fn observe(&mut self, arm: Option<&Simulation<N>>) {
        let Some(arm) = arm else {
            return self.court.wrong("the arm does not answer".to_owned());
        };
        let Some(taken) = arm.steps().checked_sub(self.simulation.steps()) else {
            let words = "the arm has taken fewer steps than before without a reset";
            return self.court.wrong(words.to_owned());
        };
        if self.paused && taken > self.asked_steps {
            return self
                .court
                .wrong(format!("a paused arm has taken {taken} steps"));
        }
        self.asked_steps -= taken.min(self.asked_steps);
        self.simulation.advance(taken);
        if arm.divergence().is_some() && self.simulation.divergence().is_none() {
            self.simulation.advance(1);
        }
        let bits = |one: &Simulation<N>| {
            let state = one.state();
            [state.position, state.velocity, *one.effort()].map(|row| row.map(f64::to_bits))
        };
        if *arm != self.simulation || bits(arm) != bits(&self.simulation) {
            self.court.wrong(format!(
                "the arm is not the offline stepper after {taken} steps: {arm:?} instead of {:?}",
                self.simulation
            ));
        }
        self.keep_time();
    }

    /// Running, the arm has taken as many steps as fit into the time since the anchor.
    fn keep_time(&mut self) {
        let (now, time, step) = (
            Instant::now(),
            self.simulation.time(),
            self.simulation.timestep(),
        );
        let keeps_up =
            KEEPS_UP.contains(&step) && !self.paused && self.simulation.divergence().is_none();
        let has_jumped = self.court.jumps.get() != self.jumps;
        self.jumps = self.court.jumps.get();
        match self.anchor.filter(|_| keeps_up && !has_jumped) {
            None => self.anchor = keeps_up.then_some((now, time)),
            Some((since, start)) => {
                let late = (now - since).as_secs_f64() - (time - start);
                if late > step + LATE || late < -step - 1e-9 {
                    self.court.wrong(format!(
                        "the arm is {late} s behind time, its timestep {step} s"
                    ));
                }
            }
        }
    }

    /// A trajectory: its last point is the setpoint.
    fn point(&mut self, msg: &serde_json::value::RawValue) {
        if let Ok(request) = joint_trajectory(msg, &joint_names::<N>())
            && let (Ok(position), Ok(velocity)) =
                (request.position.try_into(), request.velocity.try_into())
        {
            self.simulation
                .set_setpoint(Setpoint { position, velocity });
        }
    }

    /// A call takes effect; gives the `values` of its answer, where the model knows them.
    fn apply(&mut self, named: &Named) -> Option<Value> {
        self.is_done = true;
        let simulation = &mut self.simulation;
        match named.service {
            Service::SetIntegrator => {
                if let Some(method) = named.text("method").and_then(|name| method(&name)) {
                    simulation.set_method(method);
                }
                if let Some(step) = named.number("timestep", |step| step > 0.0)
                    && step.to_bits() != simulation.timestep().to_bits()
                {
                    simulation.set_timestep(step);
                    self.anchor = None;
                }
                Some(
                    json!({"method": simulation.method().name(), "timestep": simulation.timestep()}),
                )
            }
            Service::SetParams => {
                let present = *simulation.arm();
                let gravity = named.number("gravity", |gravity| gravity >= 0.0);
                let lengths = named.joints("lengths", |length| length > 0.0);
                let masses = named.joints("masses", |mass| mass > 0.0);
                let changed = Arm::new(
                    lengths.unwrap_or(*present.lengths()),
                    masses.unwrap_or(*present.masses()),
                    gravity.unwrap_or(present.gravity()),
                );
                simulation.set_arm(changed.unwrap_or(present));
                let arm = simulation.arm();
                let (masses, lengths) = (arm.masses().to_vec(), arm.lengths().to_vec());
                Some(json!({"gravity": arm.gravity(), "masses": masses, "lengths": lengths}))
            }
            Service::Pause => {
                if let Some(paused) = named.boolean("data")
                    && paused != self.paused
                {
                    self.paused = paused;
                    self.anchor = None;
                }
                Some(json!({"data": self.paused}))
            }
            Service::Reset => {
                if !named.is_whole {
                    return None;
                }
                simulation.reset();
                self.anchor = None;
                let state = simulation.state();
                Some(
                    json!({"position": state.position.to_vec(), "velocity": state.velocity.to_vec()}),
                )
            }
            Service::Step => self.step(named),
            Service::Disturb => {
                let effort = named.joints("effort", |_| true);
                let duration = named.number("duration", |duration| duration > 0.0);
                let (Some(effort), Some(duration), None) =
                    (effort, duration, simulation.divergence())
                else {
                    self.is_done = false;
                    return Some(json!({}));
                };
                simulation.disturb(effort, duration);
                Some(json!({"effort": effort.to_vec(), "duration": duration}))
            }
            Service::Enable => {
                if let Some(on) = named.boolean("data")
                    && on != simulation.pid().is_enabled()
                {
                    simulation.enable(on);
                }
                Some(json!({"data": simulation.pid().is_enabled()}))
            }
            Service::SetGains => {
                let mut gains = *simulation.pid().gains();
                let good = |gain| gain >= 0.0;
                gains.kp = named.joints("kp", good).unwrap_or(gains.kp);
                gains.ki = named.joints("ki", good).unwrap_or(gains.ki);
                gains.kd = named.joints("kd", good).unwrap_or(gains.kd);
                simulation.set_gains(gains);
                Some(
                    json!({"kp": gains.kp.to_vec(), "ki": gains.ki.to_vec(), "kd": gains.kd.to_vec()}),
                )
            }
            _ => None,
        }
    }

    /// The end of steps that are not all taken at once is not foreseen where there are goals.
    fn look_after_steps(&self, id: &str) {
        let mut expected = self.court.expected.borrow_mut();
        if let Some((values, _)) = expected.get_mut(id)
            && self.has_goals
            && let Some(time) = values["time"].as_f64()
            && time.to_bits() != self.simulation.time().to_bits()
        {
            *values = Value::Null;
        }
    }

    fn step(&mut self, named: &Named) -> Option<Value> {
        let steps = named.number("steps", |steps| {
            steps.fract() == 0.0 && (1.0..=MOST_STEPS).contains(&steps)
        });
        let Some(steps) = steps.filter(|_| self.paused && self.simulation.divergence().is_none())
        else {
            self.is_done = false;
            return Some(json!({}));
        };
        let mut alone = self.simulation.clone();
        // A run that is longer than a row goes on between what others ask: its end is not foreseen.
        let steps = steps as u64;
        let taken = alone.advance(steps.min(STEPS_IN_A_ROW));
        self.asked_steps += steps;
        self.is_done = taken == steps;
        (steps <= STEPS_IN_A_ROW).then(|| json!({"steps": taken, "time": alone.time()}))
    }
}

fn method(name: &str) -> Option<Method> {
    Method::ALL.into_iter().find(|method| method.name() == name)
}

/// The fields of a request, read once more.
struct Named {
    service: Service,
    json: Option<Json>,
    /// Whether they were taken at all.
    is_whole: bool,
}

impl Named {
    fn read(service: Service, arguments: &Arguments) -> Self {
        let json = Json::read(arguments.payload().raw().get());
        let is_whole = match (&json, arguments) {
            (Some(Json::Array(entries)), Arguments::Positional(_)) => {
                entries.len() <= service.fields().len()
            }
            (Some(Json::Object(_)), Arguments::Object(_)) => true,
            _ => false,
        };
        Self {
            service,
            json,
            is_whole,
        }
    }

    fn get(&self, name: &str) -> Option<&Json> {
        match self.json.as_ref().filter(|_| self.is_whole)? {
            Json::Array(entries) => {
                let index = self
                    .service
                    .fields()
                    .iter()
                    .position(|field| field.name == name)?;
                entries.get(index)
            }
            object => object.get(name),
        }
    }

    fn number(&self, name: &str, is_good: impl Fn(f64) -> bool) -> Option<f64> {
        self.get(name)?
            .number()
            .filter(|value| value.is_finite() && is_good(*value))
    }

    fn text(&self, name: &str) -> Option<String> {
        self.get(name)?.text().map(str::to_owned)
    }

    fn boolean(&self, name: &str) -> Option<bool> {
        match self.get(name)? {
            Json::Boolean(value) => Some(*value),
            _ => None,
        }
    }

    fn joints<const N: usize>(
        &self,
        name: &str,
        is_good: impl Fn(f64) -> bool,
    ) -> Option<[f64; N]> {
        let Json::Array(entries) = self.get(name)? else {
            return None;
        };
        let numbers = entries.iter().map(Json::number);
        let numbers: Option<Vec<f64>> = numbers
            .map(|one| one.filter(|one| one.is_finite() && is_good(*one)))
            .collect();
        numbers?.try_into().ok()
    }
}
