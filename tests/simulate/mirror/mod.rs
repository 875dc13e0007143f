//! The arm's double: the offline stepper under the same inputs at the same steps, beside the live arm.
//!
//! A tap stands before the arm and sees every input on its way. Around each it asks the arm for its whole state and has
//! the double take as many steps: the two must be equal to the bit, and so must what the arm answers. That the arm has
//! taken as many steps as time allows is checked against virtual time.

mod double;
mod named;

use std::rc::Rc;

use actix::prelude::*;
use pendularm::actors::arm::sim::{
    ArmSim, CommandGoal, SetGains, SetIntegrator, SetParams, SimulationTime, Snapshot, TakeSnapshot,
};
use pendularm::actors::node::Call;
use pendularm::actors::wire::{Nodes, ServiceCall, TopicMessage};
use pendularm::math::arm::Arm;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::Simulation;
use pendularm::protocol::catalog::{Service, Topic};

use self::double::Mirror;
use self::named::Named;
use crate::court::Court;

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
        let tap = Self {
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
        };
        // It begins with its controller off.
        tap.mirror.note_obstacle();
        tap
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
        let apply = move |mirror: &mut Mirror<N>| {
            let answer = mirror.apply(&named);
            if let (Some(values), Some(id)) = (answer, id) {
                let answer = (values, mirror.is_done);
                mirror.court.expected.borrow_mut().insert(id, answer);
            }
        };
        let send = |tap: &Self| {
            let route = tap.routes.services.get(&call.service);
            route.expect("a service of the arm")(call);
        };
        self.pass(ctx, send, apply, |mirror, (), arm| {
            mirror.observe(arm);
            if let Some(id) = steps {
                mirror.look_after_steps(&id);
            }
        });
    }
}

/// A client's message on `/joint_trajectory`, unread.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Sent(pub TopicMessage);

impl<const N: usize> Handler<Sent> for Tap<N> {
    type Result = ();

    fn handle(&mut self, Sent(message): Sent, ctx: &mut Context<Self>) {
        let heard = message.heard.clone();
        let send = |tap: &Self| {
            let route = tap.routes.listeners.get(&Topic::JointTrajectory);
            route.expect("the arm listens")(message);
        };
        self.pass(ctx, send, move |mirror| mirror.point(&heard), observe);
    }
}

fn observe<const N: usize>(mirror: &mut Mirror<N>, (): (), arm: Option<&Simulation<N>>) {
    mirror.observe(arm);
}

impl<const N: usize> Tap<N> {
    /// An input goes to the arm, and has the same effect on the double; `end` compares them behind it. All are one behind the
    /// other in the arm's mailbox: nothing comes between them, not even steps by hand.
    fn pass<T: 'static>(
        &mut self,
        ctx: &mut Context<Self>,
        send: impl FnOnce(&Self),
        apply: impl FnOnce(&mut Mirror<N>) -> T + 'static,
        end: impl FnOnce(&mut Mirror<N>, T, Option<&Simulation<N>>) + 'static,
    ) {
        let before = self.snapshot().into_actor(self);
        send(self);
        let after = self.snapshot().into_actor(self);
        let input = before.map(|arm, tap: &mut Self, _: &mut Context<Self>| {
            tap.mirror.observe(arm.as_ref());
            apply(&mut tap.mirror)
        });
        ctx.wait(input.then(|applied, _, _| {
            after.map(|arm, tap: &mut Self, _: &mut Context<Self>| {
                end(&mut tap.mirror, applied, arm.as_ref());
            })
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
        self.pass(ctx, |tap| tap.arm.do_send(call), apply, observe);
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
        self.pass(ctx, |tap| tap.arm.do_send(call), apply, observe);
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
        self.pass(ctx, |tap| tap.arm.do_send(call), apply, observe);
    }
}

impl<const N: usize> Handler<CommandGoal<N>> for Tap<N> {
    type Result = ();

    fn handle(&mut self, command: CommandGoal<N>, ctx: &mut Context<Self>) {
        self.mirror.has_goals = true;
        let position = command.positions;
        let apply = move |mirror: &mut Mirror<N>| {
            let held = *mirror.simulation.pid().setpoint();
            mirror.simulation.set_setpoint(Setpoint {
                position,
                velocity: [0.0; N],
            });
            held
        };
        let send = |tap: &Self| tap.arm.do_send(command);
        self.pass(ctx, send, apply, |mirror, held, arm| {
            // It may have been overtaken by a reset: then the arm leaves it aside.
            if arm.is_some_and(|arm| *arm.pid().setpoint() == held) {
                mirror.simulation.set_setpoint(held);
            }
            mirror.observe(arm);
        });
    }
}
