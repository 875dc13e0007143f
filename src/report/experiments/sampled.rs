//! A control loop whose period holds several steps, and whose efforts may act a period late.
//!
//! **Invariant:** with one step per period and no delay it is the live loop, but for the carried rounding.

use crate::math::arm::State;
use crate::math::dynamics::gravity_load;
use crate::math::pid::Pid;
use crate::math::simulation::state_after;
use crate::study::control_loop::ControlLoop;
use crate::study::linear::Equilibrium;

/// The loop on its way; the timestep of `control` is its control period.
#[derive(Debug, Clone)]
pub(super) struct SampledLoop<const N: usize> {
    control: ControlLoop<N>,
    substeps: u32,
    pid: Pid<N>,
    /// The effort that acts next, where efforts act one period late.
    late: Option<[f64; N]>,
    pub(super) state: State<N>,
}

impl<const N: usize> SampledLoop<N> {
    /// The loop in `state`, with the integral that it rests with.
    pub(super) fn new(
        control: &ControlLoop<N>,
        substeps: u32,
        rest: &Equilibrium<N>,
        state: State<N>,
    ) -> Self {
        let mut pid = Pid::new(control.gains);
        pid.set_setpoint(control.setpoint);
        pid.enable(true);
        pid.commit(rest.integral);
        Self {
            control: *control,
            substeps: substeps.max(1),
            pid,
            late: None,
            state,
        }
    }

    /// The same loop, but every effort acts one period late; the first one balances gravity at `rest`.
    pub(super) fn delayed(self, rest: &Equilibrium<N>) -> Self {
        Self {
            late: Some(gravity_load(&self.control.arm, &rest.position)),
            ..self
        }
    }

    /// One control period.
    pub(super) fn advance(&mut self) {
        let period = self.control.timestep;
        let asked = self.pid.control(&self.state, period);
        self.pid.commit(asked.integral);
        let acting = self
            .late
            .as_mut()
            .map_or(asked.effort, |late| std::mem::replace(late, asked.effort));
        let ControlLoop { arm, method, .. } = &self.control;
        let h = period / f64::from(self.substeps);
        for _ in 0..self.substeps {
            self.state = state_after(arm, *method, &self.state, &acting, h);
        }
    }

    /// Integral of the position error \[rad s\].
    pub(super) fn integral(&self) -> &[f64; N] {
        self.pid.integral()
    }

    /// Puts the loop into another state, integral included.
    pub(super) fn set(&mut self, state: State<N>, integral: [f64; N]) {
        self.state = state;
        self.pid.commit(integral);
    }
}
