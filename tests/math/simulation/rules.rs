//! Inputs in any order: the efforts, the controller and the time follow the rules below, and nothing else changes.

use pendularm::math::arm::{Arm, State};
use pendularm::math::limits::{AntiWindup, Limits};
use pendularm::math::pid::{Gains, Pid, Setpoint};
use pendularm::math::sensors::{Sensors, VelocitySource};
use pendularm::math::simulation::{ArmInput, ControlPeriod, Simulation};
use proptest::array::uniform2;
use proptest::prelude::*;

/// The rules, written slowly. The states come from the simulation.
#[derive(Clone)]
struct Rules {
    law: Pid<2>,
    timestep: f64,
    period: ControlPeriod,
    /// Steps since the law ran; none if a period begins with the next step.
    held_for: Option<u64>,
    held: [f64; 2],
    /// With a delay, the latest result, and those before it that wait.
    computed: [f64; 2],
    waiting: Vec<[f64; 2]>,
    sensors: Sensors<2>,
    /// The latest measurement.
    measured: Option<State<2>>,
    command: [f64; 2],
    driven: Option<[f64; 2]>,
    limits: Limits<2>,
    /// A disturbance and its end.
    push: Option<([f64; 2], f64)>,
    /// The effort of the latest step.
    effort: [f64; 2],
    /// The time at which this timestep began, and the steps since.
    base: f64,
    since_base: u64,
    steps: u64,
}

fn limits() -> impl Strategy<Value = Limits<2>> {
    let effort = proptest::option::of(uniform2(0.0..20.0_f64));
    let anti_windup = prop::sample::select(AntiWindup::ALL.to_vec());
    (effort, anti_windup, 1e-3..1.0).prop_map(|(effort, anti_windup, tracking_time)| Limits {
        effort,
        anti_windup,
        tracking_time,
    })
}

fn sensors() -> impl Strategy<Value = Sensors<2>> {
    let encoder_step = prop_oneof![Just([0.0; 2]), uniform2(0.0..0.01_f64)];
    let velocity = prop::sample::select(VelocitySource::ALL.to_vec());
    (encoder_step, velocity).prop_map(|(encoder_step, velocity)| Sensors {
        encoder_step,
        velocity,
    })
}

fn input() -> impl Strategy<Value = ArmInput<2>> {
    let effort = || uniform2(-20.0..20.0_f64);
    let period = (
        prop_oneof![Just(0.01), 0.0..0.02],
        prop_oneof![0..4_u8, 0..17_u8],
    );
    let timestep = prop_oneof![Just(1e-3), Just(2e-3), 1e-4..3e-3];
    let gains = |part: f64| {
        let usual = Gains::<2>::default();
        let kp = usual.kp.map(|kp| part * kp);
        ArmInput::Gains(Gains { kp, ..usual })
    };
    prop_oneof![
        1 => Just(ArmInput::Reset),
        1 => uniform2(-1.0..1.0).prop_map(|position| ArmInput::State(State::at_rest(position))),
        3 => any::<bool>().prop_map(ArmInput::Enabled),
        1 => timestep.prop_map(ArmInput::Timestep),
        1 => period.prop_map(|(period, delay)| ArmInput::Period(ControlPeriod { period, delay })),
        1 => proptest::option::of(effort()).prop_map(ArmInput::Drive),
        1 => (0.5..2.0).prop_map(gains),
        1 => uniform2(-1.0..1.0).prop_map(|position| ArmInput::Setpoint(Setpoint::at(position))),
        2 => effort().prop_map(ArmInput::Command),
        1 => limits().prop_map(ArmInput::Limits),
        1 => sensors().prop_map(ArmInput::Sensors),
        1 => (effort(), 1e-4..0.05)
            .prop_map(|(effort, duration)| ArmInput::Disturbance { effort, duration }),
    ]
}

impl Rules {
    fn of(simulation: &Simulation<2>) -> Self {
        Self {
            law: simulation.pid().clone(),
            timestep: simulation.timestep(),
            period: ControlPeriod::default(),
            held_for: None,
            held: [0.0; 2],
            computed: [0.0; 2],
            waiting: vec![],
            sensors: Sensors::default(),
            measured: None,
            command: [0.0; 2],
            driven: None,
            limits: Limits::default(),
            push: None,
            effort: [0.0; 2],
            base: 0.0,
            since_base: 0,
            steps: 0,
        }
    }

    fn time(&self) -> f64 {
        self.base + self.since_base as f64 * self.timestep
    }

    /// Every effort of the controller and of clients ends.
    fn forget(&mut self) {
        [self.held, self.computed, self.command] = [[0.0; 2]; 3];
        (self.driven, self.held_for) = (None, None);
        self.waiting.fill([0.0; 2]);
        self.measured = None;
    }

    /// What the law measures now.
    fn measure(&self, state: &State<2>, period: f64) -> State<2> {
        let counted = |i: usize| match self.sensors.encoder_step[i] {
            0.0 => state.position[i],
            step => (state.position[i] / step).round() * step,
        };
        let position = [0, 1].map(counted);
        let velocity = match (self.sensors.velocity, self.measured) {
            (VelocitySource::Exact, _) => state.velocity,
            (VelocitySource::Difference, None) => [0.0; 2],
            (VelocitySource::Difference, Some(before)) => {
                [0, 1].map(|i| (position[i] - before.position[i]) / period)
            }
        };
        State { position, velocity }
    }

    /// The input. One that is active already changes nothing.
    fn apply(&mut self, input: ArmInput<2>) {
        let integral = *self.law.integral();
        match input {
            ArmInput::Reset => {
                self.law.reset();
                self.forget();
                (self.push, self.effort) = (None, [0.0; 2]);
                (self.base, self.since_base, self.steps) = (0.0, 0, 0);
            }
            ArmInput::Enabled(true) if self.law.is_enabled() => {}
            ArmInput::Enabled(on) => {
                self.law.enable(on);
                self.forget();
                self.effort = if on { self.effort } else { [0.0; 2] };
            }
            ArmInput::Timestep(timestep) if timestep != self.timestep => {
                (self.base, self.since_base) = (self.time(), 0);
                (self.timestep, self.held_for) = (timestep, None);
                self.measured = None;
            }
            ArmInput::Period(period) if period != self.period => {
                if period.delay != self.period.delay {
                    let count = usize::from(period.delay).saturating_sub(1);
                    self.waiting = vec![self.computed; count];
                }
                (self.period, self.held_for) = (period, None);
                self.measured = None;
            }
            ArmInput::Drive(effort) => {
                (self.driven, self.held_for) = (effort, None);
                self.measured = None;
            }
            ArmInput::Sensors(sensors) => (self.sensors, self.measured) = (sensors, None),
            ArmInput::State(_) => self.measured = None,
            ArmInput::Gains(gains) => {
                self.law.set_gains(gains);
                assert_eq!(*self.law.gains(), gains);
            }
            ArmInput::Setpoint(setpoint) => {
                self.law.set_setpoint(setpoint);
                assert_eq!(*self.law.setpoint(), setpoint);
            }
            ArmInput::Limits(limits) => self.limits = limits,
            ArmInput::Command(effort) => self.command = effort,
            ArmInput::Disturbance { effort, duration } => {
                self.push = Some((effort, self.time() + duration));
            }
            _ => {}
        }
        let keeps_integral = !matches!(input, ArmInput::Reset | ArmInput::Enabled(_));
        assert!(!keeps_integral || *self.law.integral() == integral);
    }

    /// The step that begins now: what is held, and its effort.
    fn step(&mut self, simulation: &Simulation<2>) {
        self.effort = if let Some(effort) = self.driven {
            effort
        } else if !self.law.is_enabled() {
            self.command
        } else {
            let length = self.period.steps(self.timestep);
            if self.held_for.is_none_or(|steps| steps == length) {
                let dt = self.period.effective(self.timestep);
                let measured = self.measure(simulation.state(), dt);
                self.measured = Some(measured);
                let control = self.limits.control(&self.law, &measured, dt);
                self.law.commit(control.integral);
                self.held = control.effort;
                if self.period.delay > 0 {
                    self.waiting.push(self.computed);
                    self.computed = self.held;
                    self.held = self.waiting.remove(0);
                }
                self.held_for = Some(0);
            }
            self.held_for = self.held_for.map(|steps| steps + 1);
            self.held
        };
        if let Some(limit) = self.limits.effort {
            self.effort =
                std::array::from_fn(|i| self.effort[i].max(-limit[i]).min(limit[i]) + 0.0);
        }
        if let Some((push, _)) = self.push.filter(|(_, ends)| self.time() < *ends) {
            self.effort = std::array::from_fn(|i| self.effort[i] + push[i]);
        }
        self.since_base += 1;
        self.steps += 1;
    }

    fn assert_hold_for(&self, simulation: &Simulation<2>) {
        assert_eq!(*simulation.effort(), self.effort);
        assert_eq!(*simulation.pid(), self.law);
        assert_eq!(*simulation.command(), self.command);
        assert_eq!(simulation.control_period(), self.period);
        assert_eq!(*simulation.limits(), self.limits);
        assert_eq!(*simulation.sensors(), self.sensors);
        assert_eq!(simulation.time(), self.time());
        assert_eq!(simulation.steps(), self.steps);
        let mut next = self.clone();
        next.step(simulation);
        assert_eq!(simulation.effort_of_next_step(), next.effort);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    /// The simulation also goes on from a checkpoint after each input.
    #[test]
    fn inputs_in_any_order_follow_the_rules(
        inputs in proptest::collection::vec((input(), 0..40_u64), 1..40),
    ) {
        let mut simulation = Simulation::new(Arm::default(), Gains::default());
        let mut rules = Rules::of(&simulation);
        for (input, steps) in inputs {
            // Clients command no effort while the controller is on.
            if matches!(input, ArmInput::Command(_)) && rules.law.is_enabled() {
                continue;
            }
            simulation.apply(input);
            rules.apply(input);
            rules.assert_hold_for(&simulation);
            let goes_on = Simulation::continued(&simulation.checkpoint());
            prop_assert_eq!(format!("{goes_on:?}"), format!("{simulation:?}"));
            simulation = goes_on;
            for _ in 0..steps {
                rules.step(&simulation);
                // With a long period the loop is unstable.
                if !simulation.step() {
                    return Ok(());
                }
                rules.assert_hold_for(&simulation);
            }
        }
    }
}
