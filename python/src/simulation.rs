//! One arm under control.
//!
//! **Invariant:** every step is the live arm's own, so the same calls give the same bits as the runtime.

use std::sync::{Mutex, PoisonError};

use numpy::PyArray1;
use pendularm::math::arm::{Arm as Rods, State};
use pendularm::math::dynamics::energy;
use pendularm::math::integrator::Method;
use pendularm::math::kinematics::forward;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::Simulation as Loop;
use pyo3::IntoPyObject;
use pyo3::prelude::{PyAnyMethods, PyDictMethods, PyResult, Python, pyclass, pymethods};
use pyo3::types::{PyBytes, PyDict};

use crate::arm::{Arm, Chain, Either, Given, for_either, or_default};
use crate::arrays::{joints, joints_or, property};
use crate::fields::{
    self, Bound, Flag, Held, Name, Object, Real, Whole, refused, renamed, required,
};
use crate::gains;
use crate::patience::{hold, until_done};
use crate::robot::{self, Robot};
use crate::state;

/// Steps between two checks of the clock: some hundred microseconds.
const STEPS_PER_LOOK: u64 = 1000;

type ArrayProperty<'py> = Held<'py, PyArray1<f64>>;

/// The step at which a simulation diverged.
#[pyclass(frozen, eq, get_all, module = "pendularm")]
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Divergence {
    /// Number of the step that was not taken, counted from 1 since the reset.
    step: u64,
    /// Simulation time at which that step began [s].
    time: f64,
}

#[pymethods]
impl Divergence {
    #[new]
    fn new(step: Whole, time: Real) -> PyResult<Self> {
        Ok(Self {
            step: step.read("step")?,
            time: fields::number("time", time, Bound::NotNegative)?,
        })
    }

    fn __hash__(&self, py: Python<'_>) -> PyResult<isize> {
        self.__getnewargs__().into_pyobject(py)?.hash()
    }

    fn __getnewargs__(&self) -> (u64, f64) {
        (self.step, self.time)
    }

    fn __repr__(&self) -> String {
        format!("Divergence(step={}, time={:?})", self.step, self.time)
    }
}

/// One arm under control, advanced in whole steps: the live arm of the runtime, without its clock.
///
/// It starts as in a fresh runtime: stretched along +x, at rest, with the controller off. `method` is `euler`,
/// `midpoint`, `verlet` or `rk4`. `gains` is `{"kp": [N m/rad], "ki": [N m/(rad s)], "kd": [N m s/rad]}`, (links,)
/// each. A missing gain has the value of a fresh runtime. The controller runs once per `control_period` [s],
/// rounded to a whole number of timesteps, at least 1. Its effort is held in between, and is applied `control_delay`
/// periods later, up to 16.
///
/// The motors apply at most `effort_limit` [N m], (links,): `inf` is no limit, the default, and 0 a joint without a
/// motor. `anti_windup` is what the integral does at a limit: `clamp`, `none`, `conditional`, or `back_calculation` with
/// `tracking_time` [s]. The controller measures positions in steps of `encoder_step` [rad], (links,), 0 for exact ones.
/// Its `velocity_source` is `exact`, or the `difference` of two measured positions.
///
/// Threads may share a simulation. A copied or unpickled one takes the same steps, bit for bit. A process that is forked
/// while another thread steps it must not use it.
#[pyclass(frozen, module = "pendularm")]
#[derive(Debug)]
pub(crate) struct Simulation {
    /// The number of links never changes. A lock protects the state, because threads may share a simulation.
    own: Either<Mutex<Loop<2>>, Mutex<Loop<3>>>,
}

/// A simulation of this arm.
fn begin<const N: usize>(
    arm: Rods<N>,
    method: Method,
    timestep: f64,
    gains: Option<&Object<'_>>,
    robot: Robot<'_>,
) -> PyResult<Mutex<Loop<N>>> {
    let (limits, sensors, period) = robot.read()?;
    let mut one = Loop::new(arm, gains::read(gains, Gains::default())?);
    one.set_method(method);
    one.set_timestep(timestep);
    one.set_control_period(period);
    one.set_limits(limits);
    one.set_sensors(sensors);
    Ok(Mutex::new(one))
}

/// Sets a field of what `$get` returns, by `$set`. The other fields do not change.
macro_rules! set_field {
    ($one:ident, $py:ident, $get:ident => $set:ident, $field:ident = $value:expr) => {
        for_either!(&$one.own, one => {
            let value = $value;
            let mut one = hold($py, one);
            let mut fields = one.$get().to_owned();
            fields.$field = value;
            one.$set(fields);
        })
    };
}

/// The default of an argument that is a name.
fn name(name: &str) -> Name {
    Name::Is(name.to_owned())
}

#[pymethods]
impl Simulation {
    #[new]
    #[pyo3(
        signature = (
            arm=None, *, method=name("rk4"), timestep=Real::Is(0.001), gains=None,
            control_period=Real::Is(0.0), control_delay=None, effort_limit=None,
            anti_windup=name("clamp"), tracking_time=Real::Is(0.2), encoder_step=None,
            velocity_source=name("exact")
        ),
        text_signature = "(arm=None, *, method=\"rk4\", timestep=0.001, gains=None, control_period=0.0, \
                          control_delay=0, effort_limit=None, anti_windup=\"clamp\", tracking_time=0.2, \
                          encoder_step=None, velocity_source=\"exact\")"
    )]
    #[expect(clippy::too_many_arguments, reason = "they are keywords")]
    fn new<'py>(
        arm: Option<Given<'py>>,
        method: Name,
        timestep: Real,
        gains: Option<&Object<'py>>,
        control_period: Real,
        control_delay: Option<Object<'py>>,
        effort_limit: Option<Object<'py>>,
        anti_windup: Name,
        tracking_time: Real,
        encoder_step: Option<Object<'py>>,
        velocity_source: Name,
    ) -> PyResult<Self> {
        let method = method.method("method")?;
        let timestep = fields::number("timestep", timestep, Bound::Positive)?;
        let robot = Robot {
            effort_limit,
            anti_windup,
            tracking_time,
            encoder_step,
            velocity_source,
            control_period,
            control_delay,
        };
        let own = match or_default(arm)? {
            Chain::Two(arm) => Either::Two(begin(arm, method, timestep, gains, robot)?),
            Chain::Three(arm) => Either::Three(begin(arm, method, timestep, gains, robot)?),
        };
        Ok(Self { own })
    }

    /// Takes up to `steps` steps and returns their number: all, unless the simulation diverges. The interpreter's lock
    /// is released meanwhile, and Ctrl-C ends the call between two steps. With an `effort` [N m], (links,), that effort
    /// is applied in these steps, within the limits of the motors, and the controller does not run.
    #[pyo3(signature = (steps=Whole::Is(1), effort=None), text_signature = "($self, steps=1, effort=None)")]
    fn step(&self, py: Python<'_>, steps: Whole, effort: Option<&Object<'_>>) -> PyResult<u64> {
        let steps = steps.read("steps")?;
        for_either!(&self.own, one => {
            let effort = effort.map(|effort| joints("effort", effort, Bound::Finite)).transpose()?;
            take(py, one, steps, effort)
        })
    }

    /// Returns to the starting pose at rest, at time 0. Setpoint and integral are reset, a disturbance and a
    /// divergence end, and a control period begins. Gains, arm, method, timestep, control period and the
    /// controller's on/off state do not change.
    fn reset(&self, py: Python<'_>) {
        for_either!(&self.own, one => hold(py, one).reset());
    }

    /// Turns the controller on or off. From off to on the integral starts at zero.
    #[pyo3(signature = (data=Flag::Is(true)), text_signature = "($self, data=True)")]
    fn enable(&self, py: Python<'_>, data: Flag) -> PyResult<()> {
        let data = data.read("data")?;
        for_either!(&self.own, one => hold(py, one).enable(data));
        Ok(())
    }

    /// Sets the setpoint: positions `q` [rad] and rates `qd` [rad/s] (zeros by default), (links,) each.
    #[pyo3(
        signature = (q=None, qd=None, *, positions=None, velocities=None),
        text_signature = "($self, q, qd=None)"
    )]
    fn set_setpoint(
        &self,
        py: Python<'_>,
        q: Option<&Object<'_>>,
        qd: Option<&Object<'_>>,
        positions: Option<&Object<'_>>,
        velocities: Option<&Object<'_>>,
    ) -> PyResult<()> {
        let q = required("q", q, "positions", positions)?;
        let qd = renamed("qd", qd, "velocities", velocities)?;
        for_either!(&self.own, one => {
            let setpoint = Setpoint {
                position: joints("q", &q, Bound::Finite)?,
                velocity: joints_or("qd", qd.as_ref(), Bound::Finite, [0.0; _])?,
            };
            hold(py, one).set_setpoint(setpoint);
        });
        Ok(())
    }

    /// Changes the given gains, (links,) each: `kp` [N m/rad], `ki` [N m/(rad s)], `kd` [N m s/rad]. The integral
    /// does not change.
    #[pyo3(signature = (kp=None, ki=None, kd=None))]
    fn set_gains(
        &self,
        py: Python<'_>,
        kp: Option<&Object<'_>>,
        ki: Option<&Object<'_>>,
        kd: Option<&Object<'_>>,
    ) -> PyResult<()> {
        for_either!(&self.own, one => {
            let present = *hold(py, one).pid().gains();
            let gains = Gains {
                kp: joints_or("kp", kp, Bound::NotNegative, present.kp)?,
                ki: joints_or("ki", ki, Bound::NotNegative, present.ki)?,
                kd: joints_or("kd", kd, Bound::NotNegative, present.kd)?,
            };
            hold(py, one).set_gains(gains);
        });
        Ok(())
    }

    /// Sets the state: positions `q` [rad] and rates `qd` [rad/s] (zeros by default), (links,) each. A divergence ends.
    /// Clock and controller do not change. With the bytes of `get_state` in place of `q`, everything is set:
    /// arm, controller, method, clock, disturbance and divergence.
    #[pyo3(
        signature = (q=None, qd=None, *, position=None, velocity=None),
        text_signature = "($self, q, qd=None)"
    )]
    fn set_state(
        &self,
        py: Python<'_>,
        q: Option<&Object<'_>>,
        qd: Option<&Object<'_>>,
        position: Option<&Object<'_>>,
        velocity: Option<&Object<'_>>,
    ) -> PyResult<()> {
        let q = required("q", q, "position", position)?;
        let qd = renamed("qd", qd, "velocity", velocity)?;
        if let Ok(state) = q.cast::<PyBytes>() {
            for_either!(&self.own, one => {
                if let Some(read) = state::read(state, 1, qd.as_ref())?.pop() {
                    *hold(py, one) = read;
                }
            });
            return Ok(());
        }
        for_either!(&self.own, one => {
            let state = State {
                position: joints("q", &q, Bound::Finite)?,
                velocity: joints_or("qd", qd.as_ref(), Bound::Finite, [0.0; _])?,
            };
            hold(py, one).set_state(state);
        });
        Ok(())
    }

    /// The whole state as bytes, for `set_state` of a simulation with as many links.
    fn get_state<'py>(&self, py: Python<'py>) -> PyResult<Held<'py, PyBytes>> {
        for_either!(&self.own, one => state::written(py, std::slice::from_ref(&*hold(py, one))))
    }

    fn __getnewargs__(&self, py: Python<'_>) -> (Arm,) {
        (self.arm(py),)
    }

    fn __getstate__<'py>(&self, py: Python<'py>) -> PyResult<Held<'py, PyBytes>> {
        self.get_state(py)
    }

    fn __setstate__(&self, py: Python<'_>, state: &Object<'_>) -> PyResult<()> {
        self.set_state(py, Some(state), None, None, None)
    }

    /// Adds `effort` [N m], (links,), to the controller's in every step that begins within `duration` [s] from now. It
    /// replaces an earlier disturbance. With the controller off it is the only effort.
    fn disturb(&self, py: Python<'_>, effort: &Object<'_>, duration: Real) -> PyResult<()> {
        let duration = fields::number("duration", duration, Bound::Positive)?;
        for_either!(&self.own, one => {
            let effort = joints("effort", effort, Bound::Finite)?;
            hold(py, one).disturb(effort, duration);
        });
        Ok(())
    }

    /// The arm. It can be replaced by another one with the same number of links.
    #[getter]
    fn arm(&self, py: Python<'_>) -> Arm {
        let chain = match &self.own {
            Either::Two(one) => Chain::Two(*hold(py, one).arm()),
            Either::Three(one) => Chain::Three(*hold(py, one).arm()),
        };
        Arm { chain }
    }

    #[setter]
    fn set_arm(&self, py: Python<'_>, arm: Given<'_>) -> PyResult<()> {
        match (&self.own, &arm.chain()?) {
            (Either::Two(one), Chain::Two(arm)) => hold(py, one).set_arm(*arm),
            (Either::Three(one), Chain::Three(arm)) => hold(py, one).set_arm(*arm),
            (Either::Two(_), _) => return Err(refused("arm must have 2 links, got 3")),
            (Either::Three(_), _) => return Err(refused("arm must have 3 links, got 2")),
        }
        Ok(())
    }

    /// Number of links, 2 or 3.
    #[getter]
    fn links(&self) -> usize {
        self.own.links()
    }

    /// Joint positions q [rad], (links,), never wrapped.
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> PyResult<ArrayProperty<'py>> {
        for_either!(&self.own, one => property(py, &hold(py, one).state().position))
    }

    /// Joint rates qd [rad/s], (links,).
    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> PyResult<ArrayProperty<'py>> {
        for_either!(&self.own, one => property(py, &hold(py, one).state().velocity))
    }

    /// Positions [rad] and rates [rad/s] as the controller measured them in its latest run, (links,) each.
    #[getter]
    fn measured<'py>(&self, py: Python<'py>) -> PyResult<(ArrayProperty<'py>, ArrayProperty<'py>)> {
        for_either!(&self.own, one => {
            let State { position, velocity } = hold(py, one).measured();
            Ok((property(py, &position)?, property(py, &velocity)?))
        })
    }

    /// Effort of the latest step [N m], (links,): that of the motors plus the disturbance's.
    #[getter]
    fn effort<'py>(&self, py: Python<'py>) -> PyResult<ArrayProperty<'py>> {
        for_either!(&self.own, one => property(py, hold(py, one).effort()))
    }

    /// Integral of the position error [rad s], (links,).
    #[getter]
    fn integral<'py>(&self, py: Python<'py>) -> PyResult<ArrayProperty<'py>> {
        for_either!(&self.own, one => property(py, hold(py, one).pid().integral()))
    }

    /// The setpoint: positions [rad] and velocities [rad/s], (links,) each.
    #[getter]
    fn setpoint<'py>(&self, py: Python<'py>) -> PyResult<(ArrayProperty<'py>, ArrayProperty<'py>)> {
        for_either!(&self.own, one => {
            let one = hold(py, one);
            let Setpoint { position, velocity } = one.pid().setpoint();
            Ok((property(py, position)?, property(py, velocity)?))
        })
    }

    /// The present gains by name, in a read-only mapping, which can be copied, pickled and handed in. `set_gains`
    /// changes them.
    #[getter]
    fn gains<'py>(&self, py: Python<'py>) -> PyResult<Object<'py>> {
        let found = PyDict::new(py);
        for_either!(&self.own, one => {
            let one = hold(py, one);
            let Gains { kp, ki, kd } = one.pid().gains();
            for (name, gain) in [("kp", kp), ("ki", ki), ("kd", kd)] {
                found.set_item(name, property(py, gain)?)?;
            }
        });
        py.import("pendularm._fields")?
            .call_method1("Gains", (found,))
    }

    /// Whether the controller is on.
    #[getter]
    fn enabled(&self, py: Python<'_>) -> bool {
        for_either!(&self.own, one => hold(py, one).pid().is_enabled())
    }

    /// The method that takes the steps: `euler`, `midpoint`, `verlet` or `rk4`.
    #[getter]
    fn method(&self, py: Python<'_>) -> &'static str {
        for_either!(&self.own, one => hold(py, one).method().name())
    }

    #[setter]
    fn set_method(&self, py: Python<'_>, method: Name) -> PyResult<()> {
        let method = method.method("method")?;
        for_either!(&self.own, one => hold(py, one).set_method(method));
        Ok(())
    }

    /// Length of a step [s].
    #[getter]
    fn timestep(&self, py: Python<'_>) -> f64 {
        for_either!(&self.own, one => hold(py, one).timestep())
    }

    #[setter]
    fn set_timestep(&self, py: Python<'_>, timestep: Real) -> PyResult<()> {
        let timestep = fields::number("timestep", timestep, Bound::Positive)?;
        for_either!(&self.own, one => hold(py, one).set_timestep(timestep));
        Ok(())
    }

    /// The requested control period [s]; 0 means every step. A change of it, of `control_delay` or of the
    /// timestep begins a period.
    #[getter]
    fn control_period(&self, py: Python<'_>) -> f64 {
        for_either!(&self.own, one => hold(py, one).control_period()).period
    }

    #[setter]
    fn set_control_period(&self, py: Python<'_>, control_period: Real) -> PyResult<()> {
        let period = fields::number("control_period", control_period, Bound::NotNegative)?;
        set_field!(self, py, control_period => set_control_period, period = period);
        Ok(())
    }

    /// The control period in whole timesteps [s]: the nearest number, at least 1.
    #[getter]
    fn effective_control_period(&self, py: Python<'_>) -> f64 {
        for_either!(&self.own, one => {
            let one = hold(py, one);
            one.control_period().effective(one.timestep())
        })
    }

    /// The number of control periods after which the controller's effort is applied, 0 to 16.
    #[getter]
    fn control_delay(&self, py: Python<'_>) -> u8 {
        for_either!(&self.own, one => hold(py, one).control_period()).delay
    }

    #[setter]
    fn set_control_delay(&self, py: Python<'_>, control_delay: &Object<'_>) -> PyResult<()> {
        let delay = robot::delay(control_delay)?;
        set_field!(self, py, control_period => set_control_period, delay = delay);
        Ok(())
    }

    /// The largest effort that each motor applies [N m], (links,); `inf` for no limit, 0 for no motor.
    #[getter]
    fn effort_limit<'py>(&self, py: Python<'py>) -> PyResult<ArrayProperty<'py>> {
        for_either!(&self.own, one => {
            property(py, &hold(py, one).limits().effort.unwrap_or([f64::INFINITY; _]))
        })
    }

    #[setter]
    fn set_effort_limit(&self, py: Python<'_>, effort_limit: &Object<'_>) -> PyResult<()> {
        set_field!(self, py, limits => set_limits, effort =
            robot::limited(joints("effort_limit", effort_limit, Bound::Limit)?));
        Ok(())
    }

    /// What the integral does while an effort is at its limit: `clamp`, `none`, `conditional` or `back_calculation`.
    #[getter]
    fn anti_windup(&self, py: Python<'_>) -> &'static str {
        for_either!(&self.own, one => hold(py, one).limits().anti_windup.name())
    }

    #[setter]
    fn set_anti_windup(&self, py: Python<'_>, anti_windup: Name) -> PyResult<()> {
        let anti_windup = robot::anti_windup(anti_windup)?;
        set_field!(self, py, limits => set_limits, anti_windup = anti_windup);
        Ok(())
    }

    /// The time in which `back_calculation` removes an excess of effort [s].
    #[getter]
    fn tracking_time(&self, py: Python<'_>) -> f64 {
        for_either!(&self.own, one => hold(py, one).limits().tracking_time)
    }

    #[setter]
    fn set_tracking_time(&self, py: Python<'_>, tracking_time: Real) -> PyResult<()> {
        let tracking_time = robot::tracking_time(tracking_time)?;
        set_field!(self, py, limits => set_limits, tracking_time = tracking_time);
        Ok(())
    }

    /// The step of each joint's encoder [rad], (links,); 0 for an exact position.
    #[getter]
    fn encoder_step<'py>(&self, py: Python<'py>) -> PyResult<ArrayProperty<'py>> {
        for_either!(&self.own, one => property(py, &hold(py, one).sensors().encoder_step))
    }

    #[setter]
    fn set_encoder_step(&self, py: Python<'_>, encoder_step: &Object<'_>) -> PyResult<()> {
        set_field!(self, py, sensors => set_sensors, encoder_step =
            joints("encoder_step", encoder_step, Bound::NotNegative)?);
        Ok(())
    }

    /// How the controller measures velocities: `exact`, or the `difference` of positions over a control period.
    #[getter]
    fn velocity_source(&self, py: Python<'_>) -> &'static str {
        for_either!(&self.own, one => hold(py, one).sensors().velocity.name())
    }

    #[setter]
    fn set_velocity_source(&self, py: Python<'_>, velocity_source: Name) -> PyResult<()> {
        let velocity = robot::velocity_source(velocity_source)?;
        set_field!(self, py, sensors => set_sensors, velocity = velocity);
        Ok(())
    }

    /// Simulation time since the reset [s].
    #[getter]
    fn time(&self, py: Python<'_>) -> f64 {
        for_either!(&self.own, one => hold(py, one).time())
    }

    /// Steps taken since the reset.
    #[getter]
    fn steps(&self, py: Python<'_>) -> u64 {
        for_either!(&self.own, one => hold(py, one).steps())
    }

    /// Kinetic plus potential energy [J], zero at rest along the x axis.
    #[getter]
    fn energy(&self, py: Python<'_>) -> f64 {
        for_either!(&self.own, one => {
            let one = hold(py, one);
            energy(one.arm(), one.state())
        })
    }

    /// Position of the end effector [m], (2,).
    #[getter]
    fn end_effector<'py>(&self, py: Python<'py>) -> PyResult<ArrayProperty<'py>> {
        for_either!(&self.own, one => {
            let one = hold(py, one);
            let tip = forward(one.arm().lengths(), &one.state().position);
            property(py, &tip.position.to_array())
        })
    }

    /// The step whose result would not be finite, if there was one since the last `reset` or `set_state`. The
    /// simulation takes no step after it.
    #[getter]
    fn divergence(&self, py: Python<'_>) -> Option<Divergence> {
        for_either!(&self.own, one => hold(py, one).divergence()).map(|found| Divergence {
            step: found.step,
            time: found.time,
        })
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        for_either!(&self.own, one => {
            let one = hold(py, one);
            format!(
                "<Simulation of {} links at {} s, {} at {} s>",
                one.effort().len(), one.time(), one.method(), one.timestep()
            )
        })
    }
}

/// Takes up to `steps` steps with this effort or the controller's, and returns their number.
fn take<const N: usize>(
    py: Python<'_>,
    one: &Mutex<Loop<N>>,
    steps: u64,
    effort: Option<[f64; N]>,
) -> PyResult<u64> {
    let mut left = steps;
    until_done(py, || {
        // The lock is held only for one piece, because a signal's handler may read the arm.
        let piece = left.min(STEPS_PER_LOOK);
        let mut one = one.lock().unwrap_or_else(PoisonError::into_inner);
        let is_driven = effort.is_some() && piece > 0;
        if is_driven {
            one.drive(effort);
        }
        let advanced = one.advance(piece);
        if is_driven {
            one.drive(None);
        }
        left -= advanced;
        (left == 0 || advanced < piece).then_some(steps - left)
    })
}
