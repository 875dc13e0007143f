//! One client's view of the runtime: frames in, frames out.
//!
//! **Invariant:** the arm advances to the present time before a frame takes effect, and all news of goals are
//! sent before the answer.

mod calls;
mod computing;
mod goals;
mod repeated;
mod surroundings;
mod trials;

use std::collections::VecDeque;
use std::time::Duration;

use pendularm::live::{GoalReport, IkGoals, IkTrials, LiveArm};
use pendularm::math::arm::Arm;
use pendularm::math::pid::Gains;
use pendularm::math::simulation::Simulation;
use pendularm::protocol::catalog::{Direction, Topic};
use pendularm::protocol::messages::{self, ErrorForm, Level};
use pendularm::protocol::op::{self, Op, OpError, Verbosity};
use pendularm::protocol::wire::json::Payload;
use pendularm::services::arm::read_effort;
use pendularm::services::trajectory::read_setpoint;
use pendularm::study::clocks::clock_limits;

use self::computing::Computation;
use self::surroundings::Surroundings;

/// The allowed numbers of links.
pub const LINKS: [usize; 2] = [2, 3];

/// The sender of a goal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum GoalOwner {
    #[default]
    Client,
    Trial,
}

/// The time since a fixed moment.
pub type Clock = fn() -> Duration;

/// The arm of `N` links, its services and its topics, for one client.
pub struct Kernel<const N: usize> {
    arm: LiveArm<N, Surroundings<N>>,
    /// The client's level of statuses.
    verbosity: Verbosity,
    error_form: ErrorForm,
    goals: IkGoals<N, GoalOwner>,
    trial: IkTrials<N>,
    /// News of goals that the trial has not handled.
    news: VecDeque<GoalReport<N>>,
    /// The time of the trial's last published status.
    trial_shown: Duration,
    computations: VecDeque<Box<dyn Computation>>,
}

impl<const N: usize> Kernel<N>
where
    Arm<N>: Default,
{
    /// An arm in the runtime's initial state. The targets of trials depend on `seed`.
    #[must_use]
    pub fn new(clock: Clock, seed: u64) -> Self {
        let world = Surroundings::new(clock);
        let mut rng = fastrand::Rng::with_seed(seed);
        Self {
            arm: LiveArm::new(Arm::default(), Gains::default(), world),
            // The default level over WebSocket.
            verbosity: Verbosity::NONE,
            error_form: ErrorForm::Text,
            goals: IkGoals::default(),
            trial: IkTrials::new(move || rng.f64()),
            news: VecDeque::new(),
            trial_shown: Duration::ZERO,
            computations: VecDeque::new(),
        }
    }
}

impl<const N: usize> Kernel<N> {
    /// The present simulation.
    #[must_use]
    pub fn simulation(&self) -> &Simulation<N> {
        self.arm.simulation()
    }

    /// Takes one frame of the client.
    pub fn receive(&mut self, frame: &str) {
        let incoming = op::read(frame);
        let id = incoming.id;
        match incoming.op {
            Ok(Op::CallService(call)) => self.call(call, id),
            Ok(Op::Publish { topic, msg }) => self.take_message(&topic, &msg, id.as_ref()),
            Ok(Op::Subscribe(subscribe)) => {
                if let Some(topic) = Topic::from_name(&subscribe.topic) {
                    let world = self.arm.world();
                    world.subscribe(topic, &subscribe.topic, subscribe.throttle);
                    self.arm.set_wanted(topic, true);
                }
            }
            Ok(Op::Unsubscribe { topic }) => {
                if let Some(topic) = Topic::from_name(&topic) {
                    self.arm.world().unsubscribe(topic);
                    self.arm.set_wanted(topic, false);
                }
            }
            Ok(Op::SetLevel { verbosity, errors }) => {
                self.verbosity = verbosity;
                self.error_form = errors.unwrap_or(self.error_form);
            }
            Ok(_) => self.send_error("this operation needs a server", id.as_ref()),
            Err(OpError::Call { service, problem }) => {
                let why = problem.to_string();
                let form = self.error_form;
                self.send(messages::failure(&service, id.as_ref(), &why, form));
            }
            Err(why) => self.send_error(&why.to_string(), id.as_ref()),
        }
        self.settle();
    }

    /// Publishes due messages, 60 times a second.
    pub fn tick(&mut self) {
        self.take_due_steps();
        if let Some(control) = self.arm.limit_to_predict() {
            self.arm.keep_limit(control, Some(clock_limits(&control)));
        }
        self.arm.tick();
        self.show_trial();
        self.settle();
    }

    /// Computes for at most that time, if a computation waits. Returns whether one still waits.
    pub fn compute(&mut self, budget: Duration) -> bool {
        let clock = self.arm.world().clock();
        let began = clock();
        while let Some(mut next) = self.computations.pop_front() {
            match next.advance(clock) {
                Some(frame) => self.send(frame),
                None => self.computations.push_back(next),
            }
            if clock().saturating_sub(began) >= budget {
                break;
            }
        }
        !self.computations.is_empty()
    }

    /// Takes the frames for the client, each with its newline.
    #[must_use]
    pub fn take_frames(&mut self) -> Vec<u8> {
        self.arm.world().take_frames()
    }

    /// Takes the due steps.
    fn take_due_steps(&mut self) {
        self.arm.catch_up();
        self.settle();
    }

    /// Sends all news of goals, and executes the trial's commands.
    fn settle(&mut self) {
        while let Some(progress) = self.arm.world().next_progress() {
            self.judge(progress);
        }
        self.advance_trial();
    }

    fn send(&self, frame: impl AsRef<[u8]>) {
        self.arm.world().send(frame.as_ref());
    }

    fn send_error(&self, why: &str, id: Option<&Payload>) {
        self.tell(Level::Error, why, id);
    }

    /// Sends a status, if the client's level includes it.
    fn tell(&self, level: Level, why: &str, id: Option<&Payload>) {
        if self.verbosity.wants(level) {
            self.send(messages::status(level, why, id));
        }
    }

    /// Delivers a message that the client publishes to its subscribers and to the arm.
    fn take_message(&mut self, name: &str, msg: &Payload, id: Option<&Payload>) {
        let topic = Topic::from_name(name);
        let Some(topic) = topic.filter(|topic| topic.direction() == Direction::Subscribed) else {
            return self.send_error(&format!("topic: nobody listens to {name} here"), id);
        };
        self.take_due_steps();
        self.arm.world().pass_on(topic, msg);
        let refused = match topic {
            Topic::JointTrajectory => read_setpoint(msg)
                .map(|setpoint| self.arm.hold(setpoint))
                .err()
                .map(|why| why.to_string()),
            Topic::EffortCommands => read_effort(msg)
                .map_err(|why| why.to_string())
                .and_then(|effort| self.arm.command(effort).map_err(|why| why.to_string()))
                .err(),
            _ => None,
        };
        if let Some(why) = refused {
            self.send_error(&format!("{}: {why}", topic.name()), id);
        }
    }
}
