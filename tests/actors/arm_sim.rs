//! The arm's actor in virtual time: exact step counts, what it says and when, and that it is the offline simulation.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use crate::system::in_virtual_time;
use actix::prelude::*;
use bytes::Bytes;
use pendularm::actors::ConnectionId;
use pendularm::actors::arm::sim::{
    ArmSim, Enable, Pause, Reset, SetGains, SetIntegrator, SetParams, SetSetpoint, TakeSnapshot,
    WAKE_UP_BUDGET,
};
use pendularm::actors::node::{Ask, Call, Interest, Publish, Respond, ask};
use pendularm::actors::resources::gauges::Gauges;
use pendularm::actors::resources::work_clock;
use pendularm::actors::wire::{Caller, Nodes, ServiceCall, TopicMessage};
use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::Simulation;
use pendularm::protocol::catalog::{Service, Topic};
use pendularm::protocol::op::Arguments;
use serde_json::value::to_raw_value;
use serde_json::{Value, json};
use tokio::sync::oneshot;
use tokio::time::{Instant, advance, sleep};

/// Everything that the arm has said, in order.
#[derive(Clone, Default)]
struct Heard(Rc<RefCell<Vec<Said>>>);

#[derive(Clone, Debug, PartialEq)]
enum Said {
    Published(Topic, Value),
    Responded(ConnectionId, Value),
}

impl Heard {
    fn take(&self) -> Vec<Said> {
        std::mem::take(&mut self.0.borrow_mut())
    }

    /// The messages on `topic` since the last look at anything.
    fn messages(&self, topic: Topic) -> Vec<Value> {
        let said = self.take().into_iter();
        said.filter_map(|one| match one {
            Said::Published(of, frame) if of == topic => Some(frame["msg"].clone()),
            _ => None,
        })
        .collect()
    }
}

/// Stands in for the registry.
struct Probe(Heard);

impl Actor for Probe {
    type Context = Context<Self>;
}

impl Handler<Publish> for Probe {
    type Result = ();

    fn handle(&mut self, publish: Publish, _: &mut Context<Self>) {
        let frame: Value = serde_json::from_slice(&publish.frame.write()).expect("valid JSON");
        self.0
            .0
            .borrow_mut()
            .push(Said::Published(publish.topic, frame));
    }
}

impl Handler<Respond> for Probe {
    type Result = ();

    fn handle(&mut self, respond: Respond, _: &mut Context<Self>) {
        let frame = serde_json::from_slice(&respond.frame.write()).expect("valid JSON");
        self.0
            .0
            .borrow_mut()
            .push(Said::Responded(respond.connection, frame));
    }
}

/// An arm, and somebody who hears all that it says.
struct Bench<const N: usize> {
    arm: Addr<ArmSim<N>>,
    /// The ways by which clients' calls and messages come to it.
    routes: Nodes,
    probe: Addr<Probe>,
    heard: Heard,
}

const CALLER: ConnectionId = ConnectionId(7);

impl<const N: usize> Bench<N>
where
    Gains<N>: Default,
{
    fn new(arm: Arm<N>) -> Self {
        let heard = Heard::default();
        let probe = Probe(heard.clone()).start();
        let publish = probe.clone().recipient();
        let gauges = Arc::new(Gauges::default());
        let arm = ArmSim::new(arm, Gains::default(), publish, gauges).start();
        let mut routes = Nodes::default();
        ArmSim::attach(&arm, &mut routes);
        Self {
            arm,
            routes,
            probe,
            heard,
        }
    }

    /// An arm that nothing moves, whatever the timestep.
    fn weightless() -> Self {
        Self::new(Arm::new([1.0; N], [1.0; N], 0.0).unwrap())
    }

    /// Calls a service as a client does and gives the whole response; no virtual time passes.
    async fn call(&self, service: Service, args: Value) -> Value {
        let (caller, ended) = Caller::new(
            self.probe.clone().recipient(),
            CALLER,
            service,
            service.name().into(),
            None,
            Arc::default(),
        );
        let raw = to_raw_value(&args).unwrap();
        let arguments = if args.is_array() {
            Arguments::Positional(raw.into())
        } else {
            Arguments::Object(raw.into())
        };
        self.routes.services[&service](ServiceCall {
            service,
            arguments,
            caller,
        });
        let _ = ended.await;
        self.heard_all().await;
        let said = self.heard.0.borrow();
        match said
            .iter()
            .rev()
            .find(|one| matches!(one, Said::Responded(..)))
        {
            Some(Said::Responded(_, frame)) => frame.clone(),
            _ => panic!("no response"),
        }
    }

    /// Asks as another node does; no virtual time passes.
    async fn ask<A: Ask>(&self, question: A) -> A::Answer
    where
        ArmSim<N>: Actor<Context = Context<ArmSim<N>>> + Handler<Call<A>>,
    {
        let answer = ask(&self.arm.clone().recipient(), question).await;
        self.heard_all().await;
        answer.expect("an answer")
    }

    /// Has the controller hold this from the next step on.
    async fn hold(&self, position: [f64; N], velocity: [f64; N]) {
        let (setpoint, done) = (Setpoint { position, velocity }, None);
        let held = SetSetpoint { setpoint, done };
        self.arm.send(held).await.unwrap();
    }

    /// Waits until the probe has heard what was said so far.
    async fn heard_all(&self) {
        tokio::task::yield_now().await;
        self.probe
            .send(Respond {
                connection: ConnectionId(0),
                frame: Bytes::from_static(b"null").into(),
                service: None,
                status: None,
                done: None,
            })
            .await
            .unwrap();
        self.heard.0.borrow_mut().pop();
    }

    /// Publishes on `/joint_trajectory` as a client does.
    async fn trajectory(&self, msg: Value, id: Option<Value>) {
        let (done, ended) = oneshot::channel();
        self.routes.listeners[&Topic::JointTrajectory](TopicMessage {
            msg: to_raw_value(&msg).unwrap().into(),
            respond: self.probe.clone().recipient(),
            connection: CALLER,
            id: id.map(|id| to_raw_value(&id).unwrap().into()),
            done,
        });
        assert!(
            ended.await.is_err(),
            "dropped when the message has taken effect"
        );
        self.heard_all().await;
    }

    async fn want(&self, topic: Topic, wanted: bool) {
        self.arm.send(Interest { topic, wanted }).await.unwrap();
    }

    /// The simulation once it has taken what is due: a slow machine may need several wake-ups at one virtual instant.
    async fn snapshot(&self) -> Simulation<N> {
        let mut before = None;
        loop {
            let simulation = *self.arm.send(TakeSnapshot).await.unwrap().0;
            if before == Some(simulation.steps()) {
                return simulation;
            }
            before = Some(simulation.steps());
        }
    }

    async fn steps(&self) -> u64 {
        self.snapshot().await.steps()
    }
}

/// Runs `test` in a system of its own whose clock stands, except that it jumps to the next timer when all wait.
fn of_timestep(timestep: f64) -> SetIntegrator {
    SetIntegrator {
        timestep: Some(timestep),
        ..SetIntegrator::default()
    }
}

fn method(method: Method) -> SetIntegrator {
    SetIntegrator {
        method: Some(method),
        ..SetIntegrator::default()
    }
}

fn pause(paused: bool) -> Pause {
    Pause {
        paused: Some(paused),
        ..Pause::default()
    }
}

fn enable(enabled: bool) -> Enable {
    Enable {
        enabled: Some(enabled),
        ..Enable::default()
    }
}

fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

#[test]
fn the_steps_after_a_time_are_the_whole_timesteps_in_it() {
    in_virtual_time(async {
        // Looks at the clock cost the same however busy the machine is, and no wake-up's budget runs out.
        work_clock::count(Duration::from_micros(1));
        // Each timestep as a fraction of a second, so that the expected count is exact.
        for (numerator, denominator) in [
            (1, 1000),
            (2, 1000),
            (3, 1000),
            (1, 10_000),
            (7, 1000),
            (1, 60),
            (1, 3),
            (1, 10),
            (3, 10),
            (37, 100),
            (1, 1),
            (2, 1),
            (7, 2),
        ] {
            let timestep = numerator as f64 / denominator as f64;
            let bench = Bench::<2>::weightless();
            bench
                .ask(SetIntegrator {
                    timestep: Some(timestep),
                    ..method(Method::Euler)
                })
                .await;
            bench.ask(Reset::default()).await;
            let began = Instant::now();
            for pause in [300, 700, 1, 999, 50, 2950, 5000] {
                sleep(ms(pause)).await;
                let elapsed = began.elapsed();
                let expected = elapsed.as_nanos() * denominator / (numerator * 1_000_000_000);
                let simulation = bench.snapshot().await;
                assert_eq!(
                    u128::from(simulation.steps()),
                    expected,
                    "{timestep} s after {elapsed:?}"
                );
                assert_eq!(simulation.time(), simulation.steps() as f64 * timestep);
            }
        }
    });
}

#[test]
fn a_microsecond_is_followed_step_by_step() {
    in_virtual_time(async {
        // Ten thousand steps are within a wake-up's budget, however busy the machine is.
        work_clock::count(Duration::from_micros(1));
        let bench = Bench::<3>::weightless();
        bench
            .ask(SetIntegrator {
                timestep: Some(1e-6),
                ..method(Method::Rk4)
            })
            .await;
        bench.ask(Reset::default()).await;
        let began = Instant::now();
        for _ in 0..20 {
            sleep(ms(10)).await;
            let steps = u128::from(bench.steps().await);
            assert_eq!(steps, began.elapsed().as_micros());
        }
    });
}

/// With a timestep that no machine can follow every wake-up works for its 5 ms of real time. The 12 ticks of 0.2 s
/// would make that 0.06 s in all; a wake-up after every breather of a millisecond (two, by the timer's grain) 0.5 s or more.
#[test]
fn what_one_wake_up_leaves_owed_is_taken_up_before_the_next_tick() {
    in_virtual_time(async {
        let bench = Bench::<3>::weightless();
        bench.ask(of_timestep(1e-12)).await;
        let began = std::time::Instant::now();
        sleep(ms(200)).await;
        let worked = began.elapsed();
        let ticks_alone = 12 * WAKE_UP_BUDGET;
        assert!(worked > 4 * ticks_alone, "{worked:?}");
    });
}

#[test]
fn a_new_timestep_a_resume_and_a_reset_discard_the_unfinished_step() {
    in_virtual_time(async {
        for change in 0..3 {
            let bench = Bench::<2>::weightless();

            bench.ask(of_timestep(1.0)).await;
            sleep(ms(1600)).await;
            let before = bench.steps().await;
            assert_eq!(before, 1);
            match change {
                0 => drop(bench.ask(of_timestep(0.9)).await),
                1 => {
                    bench.ask(pause(true)).await;
                    bench.ask(pause(false)).await;
                }
                _ => drop(bench.ask(Reset::default()).await),
            }
            let before = bench.steps().await;
            sleep(ms(800)).await;
            assert_eq!(
                bench.steps().await,
                before,
                "change {change}: 0.6 s before it are gone"
            );
            sleep(ms(210)).await;
            assert_eq!(bench.steps().await, before + 1, "change {change}");
        }
    });
}

#[test]
fn requests_that_change_nothing_keep_the_unfinished_step() {
    in_virtual_time(async {
        let bench = Bench::<2>::weightless();
        bench.ask(of_timestep(1.0)).await;
        let before = bench.steps().await;
        let began = Instant::now();
        let requests = [
            (Service::SetIntegrator, json!({})),
            (Service::SetIntegrator, json!({"timestep": 1.0})),
            (
                Service::SetIntegrator,
                json!({"timestep": 1, "method": "rk4"}),
            ),
            (Service::SetIntegrator, json!({"timestep": -1})),
            (Service::SetIntegrator, json!({"method": "euler"})),
            (Service::SetIntegrator, json!([1, 2, 3])),
            (Service::SetParams, json!({})),
            (
                Service::SetParams,
                json!({"gravity": 0, "masses": [1, 1], "lengths": [1, 1]}),
            ),
            (Service::Pause, json!({})),
            (Service::Pause, json!({"data": false})),
            (Service::Pause, json!({"data": 1})),
            (Service::Reset, json!([1])),
            (Service::Enable, json!({"data": false})),
            (Service::SetGains, json!({"kp": [1, 1]})),
        ];
        for (service, args) in requests {
            sleep(ms(70)).await;
            bench.call(service, args).await;
        }
        bench.hold([1.0; 2], [0.0; 2]).await;
        assert!(began.elapsed() < ms(990));
        assert_eq!(bench.steps().await, before);
        sleep(ms(1000) - began.elapsed()).await;
        assert_eq!(bench.steps().await, before + 1);
    });
}

#[test]
fn a_paused_arm_takes_no_step_and_owes_none() {
    in_virtual_time(async {
        let bench = Bench::<2>::new(Arm::default());
        sleep(ms(500)).await;
        bench.ask(enable(true)).await;
        sleep(ms(500)).await;
        bench.ask(pause(true)).await;
        let frozen = bench.snapshot().await;
        sleep(ms(5000)).await;
        assert_eq!(
            bench.snapshot().await,
            frozen,
            "state, integral, effort and clock"
        );
        bench.ask(pause(false)).await;
        assert_eq!(bench.snapshot().await, frozen);
        sleep(ms(100)).await;
        assert_eq!(bench.steps().await, frozen.steps() + 100);
    });
}

#[test]
fn states_go_out_sixty_times_a_second() {
    in_virtual_time(async {
        let bench = Bench::<3>::new(Arm::default());
        bench.want(Topic::JointStates, true).await;
        bench.want(Topic::Clock, true).await;
        for paused in [false, true] {
            bench.ask(pause(paused)).await;
            bench.heard.take();
            sleep(ms(10_000)).await;
            let said = bench.heard.take();
            let count = |topic: Topic| {
                said.iter()
                    .filter(|one| matches!(one, Said::Published(of, _) if *of == topic))
                    .count()
            };
            // The tick at either end may fall on this side of it or that.
            assert!(
                (599..=601).contains(&count(Topic::JointStates)),
                "{}",
                count(Topic::JointStates)
            );
            assert_eq!(count(Topic::Clock), count(Topic::JointStates));
        }
    });
}

#[test]
fn missed_ticks_are_skipped_and_at_most_a_quarter_of_a_second_is_caught_up() {
    in_virtual_time(async {
        let bench = Bench::<2>::new(Arm::default());
        bench.want(Topic::JointStates, true).await;
        for stall in [3, 1000, 60_000] {
            sleep(ms(100)).await;
            let before = bench.steps().await;
            bench.heard.take();
            // Nobody runs while the clock jumps: a stalled process.
            advance(Duration::from_secs(stall)).await;
            sleep(ms(1)).await;
            let steps = bench.steps().await - before;
            // 250 ms, the step in progress, and the millisecond since.
            assert!(
                (250..=252).contains(&steps),
                "{steps} steps after {stall} s"
            );
            let messages = bench.heard.messages(Topic::JointStates).len();
            assert!(messages <= 1, "{messages} messages after {stall} s");
        }
    });
}

#[test]
fn a_short_stall_is_caught_up_in_full() {
    in_virtual_time(async {
        let bench = Bench::<2>::new(Arm::default());
        bench.ask(Reset::default()).await;
        let began = Instant::now();
        for _ in 0..20 {
            advance(ms(249)).await;
            sleep(ms(2)).await;
            assert_eq!(u128::from(bench.steps().await), began.elapsed().as_millis());
        }
    });
}

#[test]
fn nothing_is_said_on_a_topic_that_nobody_wants() {
    in_virtual_time(async {
        let bench = Bench::<2>::new(Arm::default());
        sleep(ms(3000)).await;
        bench.ask(pause(true)).await;
        bench.ask(pause(false)).await;
        assert_eq!(bench.heard.take(), []);
        for topic in [Topic::JointStates, Topic::Clock, Topic::Diagnostics] {
            bench.want(topic, true).await;
            bench.want(topic, true).await;
            sleep(ms(2500)).await;
            let said = bench.heard.take();
            assert!(!said.is_empty());
            assert!(
                said.iter()
                    .all(|one| matches!(one, Said::Published(of, _) if *of == topic)),
                "{topic:?}"
            );
            bench.want(topic, false).await;
            bench.heard.take();
            sleep(ms(2500)).await;
            assert_eq!(bench.heard.take(), []);
        }
    });
}

/// The live arm, whatever is done to it, is at every moment what the offline simulation is after as many steps, in every bit
/// of state, rounding carry, integral, effort and time.
fn assert_live_is_offline<const N: usize>(seed: u64)
where
    Gains<N>: Default,
{
    in_virtual_time(async move {
        let bench = Bench::<N>::new(Arm::default());
        let mut offline = Simulation::<N>::new(Arm::default(), Gains::default());
        let mut random = fastrand::Rng::with_seed(seed);
        for event in 0..60 {
            sleep(ms(random.u64(1..120))).await;
            let live = bench.snapshot().await;
            offline.advance(live.steps() - offline.steps());
            assert_eq!(live, offline, "seed {seed}, event {event}");
            match random.u8(0..8) {
                0 => {
                    let on = random.bool();
                    bench.ask(enable(on)).await;
                    offline.enable(on);
                }
                1 | 2 => {
                    let position: [f64; N] = std::array::from_fn(|_| random.f64() * 2.0 - 1.0);
                    let velocity: [f64; N] = std::array::from_fn(|_| random.f64() - 0.5);
                    bench.hold(position, velocity).await;
                    offline.set_setpoint(Setpoint { position, velocity });
                }
                3 => {
                    let lengths: [f64; N] = std::array::from_fn(|_| 0.5 + random.f64());
                    let masses: [f64; N] = std::array::from_fn(|_| 0.5 + random.f64());
                    let gravity = 10.0 * random.f64();
                    bench
                        .ask(SetParams {
                            lengths: Some(lengths),
                            masses: Some(masses),
                            gravity: Some(gravity),
                            ..SetParams::default()
                        })
                        .await;
                    offline.set_arm(Arm::new(lengths, masses, gravity).unwrap());
                }
                4 => {
                    let method_now = Method::ALL[random.usize(0..Method::ALL.len())];
                    bench.ask(method(method_now)).await;
                    offline.set_method(method_now);
                }
                5 => {
                    let timestep = [0.0005, 0.001, 0.0013, 0.002][random.usize(0..4)];
                    bench.ask(of_timestep(timestep)).await;
                    if timestep != offline.timestep() {
                        offline.set_timestep(timestep);
                    }
                }
                6 => {
                    let mut gains = *offline.pid().gains();
                    gains.kp = gains.kp.map(|kp| kp * (0.9 + 0.2 * random.f64()));
                    bench
                        .ask(SetGains {
                            kp: Some(gains.kp),
                            ..SetGains::default()
                        })
                        .await;
                    offline.set_gains(gains);
                }
                _ => {
                    bench.ask(Reset::default()).await;
                    offline.reset();
                }
            }
        }
    });
}

#[test]
fn the_live_arm_is_the_offline_simulation_bit_for_bit() {
    for seed in 0..6 {
        assert_live_is_offline::<2>(seed);
        assert_live_is_offline::<3>(100 + seed);
    }
}

/// Nobody looks in between: what takes a request to its own step is the request itself, not the tick before it.
#[test]
fn a_request_takes_effect_at_the_step_that_is_due_when_it_comes() {
    in_virtual_time(async {
        let bench = Bench::<2>::new(Arm::default());
        let mut offline = Simulation::<2>::new(Arm::default(), Gains::default());
        bench.ask(Reset::default()).await;
        let began = Instant::now();
        let step_due = || u64::try_from(began.elapsed().as_millis()).unwrap();
        for (pause, angle) in [(7, 0.3), (30, -0.4), (1, 0.5), (11, 0.6)] {
            sleep(ms(pause)).await;
            bench.ask(enable(angle > 0.0)).await;
            offline.advance(step_due() - offline.steps());
            offline.enable(angle > 0.0);
            sleep(ms(pause)).await;
            let positions = [angle, -angle];
            bench.hold(positions, [0.0; 2]).await;
            offline.advance(step_due() - offline.steps());
            offline.set_setpoint(Setpoint {
                position: positions,
                velocity: [0.0; 2],
            });
        }
        sleep(ms(5)).await;
        bench.ask(pause(true)).await;
        offline.advance(step_due() - offline.steps());
        assert_eq!(bench.snapshot().await, offline);
    });
}

#[test]
fn a_bad_trajectory_is_answered_to_its_sender_alone_with_the_frames_id() {
    in_virtual_time(async {
        let bench = Bench::<2>::new(Arm::default());
        let held = *bench.snapshot().await.pid().setpoint();
        let id = json!({"my": [1, "id"]});
        bench
            .trajectory(json!({"points": []}), Some(id.clone()))
            .await;
        let [Said::Responded(CALLER, frame)] = &bench.heard.take()[..] else {
            panic!("one status")
        };
        assert_eq!(
            (&frame["op"], &frame["level"], &frame["id"]),
            (&json!("status"), &json!("error"), &id)
        );
        bench
            .trajectory(
                json!({"points": [{"positions": [1]}], "joint_names": ["joint2"]}),
                None,
            )
            .await;
        let [Said::Responded(CALLER, frame)] = &bench.heard.take()[..] else {
            panic!("one status")
        };
        assert!(
            frame.get("id").is_none() && frame["msg"].as_str().unwrap().contains("joint1"),
            "{frame}"
        );
        assert_eq!(*bench.snapshot().await.pid().setpoint(), held);
    });
}

#[test]
fn a_message_of_a_change_comes_before_the_response_and_shows_the_change() {
    in_virtual_time(async {
        let bench = Bench::<2>::new(Arm::default());
        bench.want(Topic::Diagnostics, true).await;
        sleep(ms(100)).await;
        bench.heard.take();
        bench.call(Service::Pause, json!({"data": true})).await;
        let said = bench.heard.take();
        let [
            Said::Published(Topic::Diagnostics, frame),
            Said::Responded(CALLER, response),
        ] = &said[..]
        else {
            panic!("{said:?}")
        };
        assert_eq!(frame["msg"]["status"][0]["message"], "paused");
        assert_eq!(response["values"], json!({"data": true}));
        bench.call(Service::Pause, json!({"data": true})).await;
        assert_eq!(
            bench.heard.take().len(),
            1,
            "the response; nothing has changed"
        );
    });
}

#[test]
fn a_divergence_is_told_at_once_and_holds_until_the_reset() {
    in_virtual_time(async {
        let bench = Bench::<2>::new(Arm::default());
        bench.want(Topic::Diagnostics, true).await;
        bench
            .ask(SetGains {
                kp: Some([1e6; 2]),
                kd: Some([1e5; 2]),
                ..SetGains::default()
            })
            .await;
        bench.ask(of_timestep(0.02)).await;
        bench.ask(enable(true)).await;
        bench.hold([1.0; 2], [0.0; 2]).await;
        bench.heard.take();
        // Where the offline simulation diverges, the live one does.
        let mut offline = bench.snapshot().await;
        offline.advance(u64::MAX);
        let divergence = offline.divergence().unwrap();
        sleep(ms(3000)).await;
        assert_eq!(bench.snapshot().await, offline);
        let told: Vec<Value> = bench
            .heard
            .messages(Topic::Diagnostics)
            .into_iter()
            .filter(|message| message["status"][0]["level"] == 2)
            .collect();
        let message = told[0]["status"][0]["message"].as_str().unwrap();
        assert!(message.starts_with("diverged: "), "{message}");
        assert!(
            message.contains(&format!("step {}", divergence.step)),
            "{message}"
        );
        assert!(
            message.contains(&format!("t = {} s", divergence.time)),
            "{message}"
        );
        bench.ask(pause(true)).await;
        bench.ask(pause(false)).await;
        sleep(ms(1000)).await;
        assert_eq!(bench.snapshot().await, offline);
        bench.ask(enable(false)).await;
        bench.ask(Reset::default()).await;
        sleep(ms(1000)).await;
        assert_eq!(bench.steps().await, 50);
    });
}

#[test]
fn diagnostics_come_once_a_second_with_rates_of_virtual_time() {
    in_virtual_time(async {
        let bench = Bench::<2>::new(Arm::default());
        bench.want(Topic::Diagnostics, true).await;
        sleep(ms(10_500)).await;
        let messages = bench.heard.messages(Topic::Diagnostics);
        assert_eq!(messages.len(), 10);
        for message in &messages[1..] {
            let value = |key: &str| -> f64 {
                let values = message["status"][0]["values"].as_array().unwrap();
                let entry = values.iter().find(|entry| entry["key"] == key).unwrap();
                entry["value"].as_str().unwrap().parse().unwrap()
            };
            // A window is a second to within the millisecond of the timer's grain at either end.
            assert!((value("real_time_factor") - 1.0).abs() < 0.003, "{message}");
            assert!(
                (value("steps_per_second") - 1000.0).abs() < 3.0,
                "{message}"
            );
        }
    });
}

#[test]
fn every_service_of_the_arm_answers_whatever_it_is_asked() {
    in_virtual_time(async {
        let bench = Bench::<3>::new(Arm::default());
        let services = [
            Service::SetIntegrator,
            Service::SetParams,
            Service::Pause,
            Service::Reset,
            Service::Enable,
            Service::SetGains,
        ];
        for service in services {
            let fields = service.response_fields();
            for args in [
                json!({}),
                json!([]),
                json!([null, null, null]),
                json!([0, 0, 0, 0, 0]),
                json!({"data": {}, "kp": 1, "method": [], "gravity": "x"}),
            ] {
                let response = bench.call(service, args.clone()).await;
                let status = response["status"].as_str().unwrap();
                assert_eq!(response["result"], status.is_empty(), "{response}");
                let values = response["values"].as_object().unwrap();
                assert_eq!(values.len(), fields.len(), "{args}: {response}");
                assert!(
                    fields.iter().all(|field| values.contains_key(field.name)),
                    "{response}"
                );
            }
        }
    });
}
